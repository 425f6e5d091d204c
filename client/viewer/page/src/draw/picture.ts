// The scene as a whole: it takes what the session tells, and draws a picture when asked to.
import { Color, Vector3 } from 'three';
import { FrameFlag, type BodyList, type Frame, type Transfer, type Welcome } from '../gen/viewer_pb';
import { Bodies } from '../model/bodies';
import { Grid } from '../model/grid';
import { Playback } from '../model/playback';
import { unpack } from '../model/snapshot';
import type { SettingsStore } from '../settings';
import { BodyColours } from './body_colours';
import { bodyUniforms } from './body_material';
import { Instances } from './instances';
import { Labels } from './labels';
import { levels, looks, type LevelName } from './looks';
import { Marks } from './marks';
import { Occlusion } from './occlusion';
import { Picker } from './pick';
import { Shapes } from './shapes';
import { Stage } from './stage';
import { Statics } from './statics';
import { Territory } from './territory';
import { Views } from './views';

export class Picture {
  readonly bodies = new Bodies();
  readonly shapes = new Shapes();
  readonly stage: Stage;
  readonly views: Views;
  readonly marks: Marks;
  readonly picker: Picker;
  readonly instances: Instances;
  readonly colours: BodyColours;
  playback: Playback | null = null;
  readonly statics: Statics;
  private grid = new Grid(undefined);
  private worlds = 0;
  private ownersDrawn = false; // as they are at the step that is shown
  private territory: Territory;
  private labels: Labels;
  private occlusion: Occlusion;
  private framed = false; // the camera has been put where the scene is seen
  private dark = true;
  private known = ''; // the scene that the camera belongs to

  constructor(
    private readonly canvas: HTMLCanvasElement,
    labels: HTMLElement,
    private readonly settings: SettingsStore,
    cameraChanged: () => void,
  ) {
    this.stage = new Stage(canvas, settings.now.quality);
    const { scene, camera } = this.stage;
    this.views = new Views(camera, canvas, this.bodies, cameraChanged);
    this.statics = new Statics(scene);
    this.territory = new Territory(scene);
    this.labels = new Labels(labels);
    this.marks = new Marks(scene, camera, this.bodies, this.shapes);
    this.picker = new Picker(this.bodies, this.shapes, this.statics);
    this.colours = new BodyColours(this.bodies, settings.now);
    this.instances = new Instances(scene, this.bodies, this.shapes, (body) => this.colours.of(body));
    this.occlusion = new Occlusion(this.stage, this.instances, this.statics);
    settings.onChange((_, key) => {
      if (['colour', 'near', 'mixed', 'speedScale'].includes(key)) this.instances.recolourAll();
      this.applySettings();
    });
    new ResizeObserver(() => this.stage.resize()).observe(canvas);
  }

  // `restored`: the camera is where a link has put it.
  begin(welcome: Welcome, restored: boolean): void {
    const low = new Vector3(...padded(welcome.low));
    const high = new Vector3(...padded(welcome.high));
    if (!(low.x <= high.x)) [low, high].forEach((corner, k) => corner.set(...(k ? [5, 5, 5] : [-5, -5, 0]) as [number, number, number]));
    const gravity = new Vector3(...padded(welcome.gravity));
    const up = gravity.length() > 1e-6 ? gravity.normalize().negate() : new Vector3(0, 0, 1);
    // The same session again, after a broken connection: the camera stays.
    const scene = `${welcome.session}/${welcome.scene}`;
    const again = this.known === scene;
    this.known = scene;

    this.instances.clear();
    this.bodies.clear();
    this.shapes.clear();
    this.marks.clear();
    this.playback = new Playback(this.bodies, this, welcome.dt || 1 / 60);
    for (const mesh of welcome.meshes) this.shapes.add(mesh);
    this.grid = new Grid(welcome.grid);
    this.worlds = welcome.worlds;
    this.statics.build(welcome.statics, welcome.meshes, low, high, up, this.grid);
    this.ownersDrawn = false;
    if (!again) {
      this.stage.setUp(up);
      this.views.setScene(low, high);
      this.framed = restored;
    }
    this.stage.setExtent(this.views.extent());
    this.applySettings();
  }

  addBodies(list: BodyList): void {
    for (const mesh of list.meshes) this.shapes.add(mesh);
    this.bodies.add(list);
  }

  addTransfers(list: Transfer[]): void {
    this.grid.add(list);
  }

  takeFrame(frame: Frame, now: number): void {
    this.playback?.take(unpack(frame, now));
    if (this.framed || frame.index.length === 0) return;
    this.playback?.advance(now);
    this.views.frameAll();
    this.framed = true;
  }

  setTheme(dark: boolean): void {
    this.dark = dark;
    this.applySettings();
  }

  setLevel(name: LevelName): void {
    this.stage.setLevel(levels[name]);
    this.instances.setFine(levels[name].fine);
    this.occlusion.enable(levels[name].occlusion);
  }

  // `now`: s.
  draw(now: number): void {
    bodyUniforms.uTime.value = now;
    this.playback?.advance(now);
    this.drawOwners();
    this.instances.upload();
    this.views.update();
    const { camera } = this.stage;
    this.stage.focus(this.views.controls.target);
    this.statics.cutAway(camera.position, this.settings.now.cutaway);
    this.marks.update(this.canvas.clientHeight);
    camera.updateMatrixWorld();
    this.occlusion.render();
    this.stage.render();
    this.labels.update(
      camera,
      this.canvas.clientWidth,
      this.canvas.clientHeight,
      this.settings.now.borders && this.settings.now.labels,
    );
  }

  // About once a second; whether the legend has to be written anew.
  measureSpeeds(): boolean {
    if (this.settings.now.colour !== 'speed' || !this.colours.measure()) return false;
    this.instances.recolourAll();
    return true;
  }

  // Where a body is on the page, in pixels; null: not in the scene, or behind the camera.
  screenPosition(body: number): [number, number] | null {
    if (!this.bodies.present[body]) return null;
    const at = new Vector3().fromArray(this.bodies.pos, 3 * body).project(this.stage.camera);
    if (at.z > 1) return null;
    const box = this.canvas.getBoundingClientRect();
    return [box.left + (0.5 + 0.5 * at.x) * box.width, box.top + (0.5 - 0.5 * at.y) * box.height];
  }

  // The id of the body that a click on the canvas there would meet, in CSS pixels of the page; null: none.
  bodyAt(x: number, y: number): bigint | null {
    const hit = this.picker.pick(this.stage.rayAt({ clientX: x, clientY: y }));
    return hit && hit.body >= 0 ? this.bodies.ids[hit.body]! : null;
  }

  // How many cells each world owns at the step that is shown.
  cells(): number[] {
    this.passTransfers();
    return this.grid.cells(this.worlds);
  }

  // ---- what Playback tells ----

  appeared(body: number): void {
    this.instances.appeared(body);
  }

  vanished(body: number): void {
    this.instances.vanished(body);
  }

  moved(bodies: Uint32Array): void {
    this.instances.moved(bodies);
  }

  changed(bodies: Uint32Array): void {
    this.instances.recolour(bodies);
    const now = bodyUniforms.uTime.value;
    for (const body of bodies)
      if (this.bodies.flags[body]! & FrameFlag.FLAG_REDONE) this.instances.flash(body, now);
  }

  private passTransfers(): void {
    if (this.grid.goTo(this.playback?.step() ?? 0)) this.ownersDrawn = false;
  }

  // Borders are made anew only where some are to be seen, and only once the step has passed a transfer of cells.
  private drawOwners(): void {
    this.passTransfers();
    if (this.ownersDrawn || !this.settings.now.borders) return;
    this.ownersDrawn = true;
    this.statics.paint(this.grid);
    this.territory.build(this.grid);
    this.labels.build(this.grid, this.worlds);
  }

  private applySettings(): void {
    const now = this.settings.now;
    const look = looks[this.dark ? 'dark' : 'light'];
    this.stage.setLook(look);
    this.statics.look(new Color(look.lines), now.grid ? look.lineStrength : 0, now.borders ? look.tint : 0);
    this.territory.show(now.borders);
    bodyUniforms.uFlashOn.value = now.redone ? 1 : 0;
  }
}

const padded = (values: number[]): [number, number, number] => [values[0] ?? 0, values[1] ?? 0, values[2] ?? 0];
