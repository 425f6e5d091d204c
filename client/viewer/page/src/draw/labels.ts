// Names of territories, as text over the picture.
import { Vector3, type PerspectiveCamera } from 'three';
import type { Grid } from '../model/grid';
import { css, worldColour } from './colours';

export class Labels {
  private names: { element: HTMLElement; at: Vector3 }[] = [];
  private place = new Vector3();

  constructor(private readonly root: HTMLElement) {}

  build(grid: Grid, worlds: number): void {
    this.root.replaceChildren();
    this.names = [];
    grid.centres(worlds).forEach((centre, world) => {
      if (!centre) return;
      const element = document.createElement('div');
      element.className = 'label';
      element.textContent = `world ${world}`;
      element.style.setProperty('--world', css(worldColour(world)));
      this.root.append(element);
      this.names.push({ element, at: new Vector3(...centre) });
    });
  }

  update(camera: PerspectiveCamera, width: number, height: number, on: boolean): void {
    this.root.hidden = !on;
    if (!on) return;
    for (const { element, at } of this.names) {
      this.place.copy(at).project(camera);
      const seen = this.place.z < 1 && Math.abs(this.place.x) < 1.1 && Math.abs(this.place.y) < 1.1;
      element.hidden = !seen;
      if (!seen) continue;
      const x = (0.5 + 0.5 * this.place.x) * width;
      const y = (0.5 - 0.5 * this.place.y) * height;
      element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
    }
  }
}
