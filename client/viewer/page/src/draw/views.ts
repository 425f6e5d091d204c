// Where the camera is: orbit, pan, zoom; following a body; the first view of a scene.
import { Vector3, type PerspectiveCamera } from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import type { Bodies } from '../model/bodies';

export interface CameraState {
  position: [number, number, number];
  target: [number, number, number];
}

export class Views {
  controls: OrbitControls;
  following: bigint | null = null;
  private low = new Vector3(-5, -5, 0);
  private high = new Vector3(5, 5, 5);
  private followed = new Vector3();

  constructor(
    private readonly camera: PerspectiveCamera,
    private readonly canvas: HTMLCanvasElement,
    private readonly bodies: Bodies,
    private readonly changed: () => void,
  ) {
    this.controls = this.newControls();
  }

  // Up, and the box of the scene, from Welcome.
  setScene(low: Vector3, high: Vector3): void {
    this.low.copy(low);
    this.high.copy(high);
    this.controls.dispose();
    this.controls = this.newControls(); // it keeps the up direction that it was made with
  }

  extent(): number {
    return Math.max(0.5, 0.5 * this.low.distanceTo(this.high));
  }

  // The whole scene, from a little above and aside.
  frameAll(): void {
    this.follow(null);
    const box = this.currentBox();
    const centre = box.low.clone().add(box.high).multiplyScalar(0.5);
    const up = this.camera.up;
    const aside = this.aside();
    const along = new Vector3().crossVectors(up, aside);
    const direction = aside.multiplyScalar(-0.55).addScaledVector(along, -1).addScaledVector(up, 0.56).normalize();
    this.camera.position.copy(centre).addScaledVector(direction, this.distanceFor(box.low, box.high, direction));
    this.controls.target.copy(centre);
    this.controls.update();
    this.changed();
  }

  follow(body: number | null): void {
    this.controls.zoomToCursor = body === null; // it would zoom away from what is followed
    this.following = body === null ? null : this.bodies.ids[body]!;
    if (body === null) return;
    const at = this.place(body);
    const offset = this.camera.position.clone().sub(this.controls.target);
    this.followed.copy(at);
    this.controls.target.copy(at);
    this.camera.position.copy(at).add(offset);
    this.changed();
  }

  // Where following has taken the camera since the picture before.
  update(): void {
    if (this.following !== null) {
      const body = this.bodies.indexOf(this.following);
      if (body !== undefined && this.bodies.present[body]) {
        const at = this.place(body);
        const moved = at.clone().sub(this.followed);
        this.camera.position.add(moved);
        this.controls.target.add(moved);
        this.followed.copy(at);
      }
    }
    this.controls.update();
  }

  state(): CameraState {
    return { position: this.camera.position.toArray(), target: this.controls.target.toArray() };
  }

  restore(state: CameraState): void {
    this.camera.position.fromArray(state.position);
    this.controls.target.fromArray(state.target);
    this.controls.update();
  }

  private newControls(): OrbitControls {
    const controls = new OrbitControls(this.camera, this.canvas);
    controls.enableDamping = true;
    controls.dampingFactor = 0.12;
    controls.zoomToCursor = true;
    controls.screenSpacePanning = true;
    controls.addEventListener('change', this.changed);
    return controls;
  }

  private place(body: number): Vector3 {
    return new Vector3().fromArray(this.bodies.pos, 3 * body);
  }

  private aside(): Vector3 {
    const up = this.camera.up;
    const aside = Math.abs(up.x) < 0.9 ? new Vector3(1, 0, 0) : new Vector3(0, 1, 0);
    return aside.addScaledVector(up, -aside.dot(up)).normalize();
  }

  // Where most bodies are: one that flew off does not make the rest small.
  private currentBox(): { low: Vector3; high: Vector3 } {
    const { present, pos, count } = this.bodies;
    const axes: number[][] = [[], [], []];
    for (let i = 0; i < count; i++) if (present[i]) for (let c = 0; c < 3; c++) axes[c]!.push(pos[3 * i + c]!);
    if (axes[0]!.length === 0) return { low: this.low, high: this.high };
    const low = new Vector3();
    const high = new Vector3();
    axes.forEach((values, c) => {
      values.sort((a, b) => a - b);
      low.setComponent(c, values[Math.floor(0.01 * (values.length - 1))]! - 0.5);
      high.setComponent(c, values[Math.ceil(0.99 * (values.length - 1))]! + 0.5);
    });
    return { low, high };
  }

  // How far away the box is wholly in view, looked at from `direction`.
  private distanceFor(low: Vector3, high: Vector3, direction: Vector3): number {
    const right = new Vector3().crossVectors(this.camera.up, direction).normalize();
    const above = new Vector3().crossVectors(direction, right);
    const tall = Math.tan((this.camera.fov * Math.PI) / 360) * 0.97;
    const wide = tall * this.camera.aspect;
    const half = high.clone().sub(low).multiplyScalar(0.5);
    let distance = 1;
    // Corners of a box that is wide are empty mostly; they may lie at the rim of the picture.
    for (let k = 0; k < 8; k++) {
      const corner = new Vector3(k & 1 ? half.x : -half.x, k & 2 ? half.y : -half.y, k & 4 ? half.z : -half.z);
      const near = corner.dot(direction);
      distance = Math.max(
        distance,
        near + Math.abs(corner.dot(right)) / wide,
        near + Math.abs(corner.dot(above)) / tall,
      );
    }
    return distance;
  }
}
