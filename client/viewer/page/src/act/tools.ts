// The pointer on the scene. Without a tool it is the camera's (OrbitControls) and a click selects; with one, or with Ctrl
// held, the left button does something to bodies.
import { create } from '@bufbuild/protobuf';
import { Quaternion, Ray, Vector3 } from 'three';
import { PushSchema, RemoveSchema } from '../gen/action_pb';
import type { Hit, Picker } from '../draw/pick';
import type { Marks } from '../draw/marks';
import type { Stage } from '../draw/stage';
import type { Views } from '../draw/views';
import type { Bodies } from '../model/bodies';
import type { Requests } from '../net/requests';
import type { SettingsStore, Tool } from '../settings';
import { Grabbing } from './grab';
import { halfHeight, spawnOf, vec3 } from './spawning';

const clickSlop = 4; // pixels that a click may move

export interface ToolsHost {
  mayAct(): boolean;
  whyNot(): string;
  say(text: string, kind?: 'info' | 'bad'): void;
  selected(body: number): void;
  toolChanged(tool: Tool): void;
}

export class Tools {
  tool: Tool = 'select';
  private grabbing: Grabbing | null = null;
  private down: { x: number; y: number; button: number; used: boolean } | null = null;
  private awaited: bigint | null = null; // a spawned body, to be selected once it is there
  private hoverAt: PointerEvent | null = null;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly stage: Stage,
    private readonly views: Views,
    private readonly bodies: Bodies,
    private readonly picker: Picker,
    private readonly marks: Marks,
    private readonly requests: Requests,
    private readonly settings: SettingsStore,
    private readonly host: ToolsHost,
  ) {
    // Before OrbitControls hears of it: what a tool takes is not the camera's.
    canvas.addEventListener('pointerdown', (event) => this.pressed(event), { capture: true });
    canvas.addEventListener('pointermove', (event) => this.dragged(event), { capture: true });
    canvas.addEventListener('pointerup', (event) => this.lifted(event), { capture: true });
    canvas.addEventListener('pointercancel', () => this.letGo(), { capture: true });
    canvas.addEventListener('wheel', (event) => this.wheeled(event), { capture: true, passive: false });
    canvas.addEventListener('dblclick', (event) => {
      const hit = this.picker.pick(this.stage.rayAt(event));
      if (hit && hit.body >= 0) {
        this.select(hit.body);
        this.views.follow(hit.body);
      }
    });
    window.addEventListener('pagehide', () => this.letGo());
    canvas.addEventListener('pointerleave', () => (this.marks.hovered = -1));
    canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  }

  choose(tool: Tool): void {
    if (tool !== 'select' && !this.host.mayAct()) {
      this.host.say(this.host.whyNot(), 'bad');
      return;
    }
    this.tool = tool;
    this.canvas.dataset.tool = tool;
    this.marks.hovered = -1;
    this.host.toolChanged(tool);
  }

  select(body: number): void {
    this.marks.selected = body;
    this.host.selected(body);
  }

  removeSelected(): void {
    const body = this.marks.selected;
    if (body < 0) return;
    if (!this.host.mayAct()) {
      this.host.say(this.host.whyNot(), 'bad');
      return;
    }
    void this.requests.act({ case: 'remove', value: create(RemoveSchema, { body: this.bodies.ids[body]! }) });
  }

  // On what is under the pointer, or is looked at; where that is nothing, in the air before the camera.
  spawn(pointed: Hit | null = null): void {
    if (!this.host.mayAct()) {
      this.host.say(this.host.whyNot(), 'bad');
      return;
    }
    const { spawnShape, spawnSize } = this.settings.now;
    const at = new Vector3();
    const camera = this.stage.camera;
    const ahead = new Ray(camera.position.clone(), camera.getWorldDirection(new Vector3()));
    const distance = camera.position.distanceTo(this.views.controls.target);
    const hit = pointed ?? this.picker.pick(ahead);
    if (hit && (pointed || hit.distance < 2 * distance))
      at.copy(hit.point).addScaledVector(hit.normal, halfHeight(spawnShape, spawnSize) + 0.02);
    else ahead.at(distance, at);
    void this.requests.act({ case: 'spawn', value: spawnOf(spawnShape, spawnSize, at) }).then((answer) => {
      if (answer.accepted) this.awaited = answer.body;
    });
  }

  // Once per picture.
  update(): void {
    if (this.grabbing?.over) this.letGo();
    const spawned = this.awaited === null ? undefined : this.bodies.indexOf(this.awaited);
    if (spawned !== undefined && this.bodies.present[spawned]) {
      this.awaited = null;
      this.select(spawned);
    }
    this.marks.setSpring(
      this.grabbing && { body: this.grabbing.body, point: this.grabbing.point, target: this.grabbing.target },
    );
    const event = this.hoverAt;
    this.hoverAt = null;
    if (!event || this.down || this.grabbing) return;
    const acting = this.tool !== 'select' || event.ctrlKey;
    if (!acting || this.tool === 'spawn') {
      this.marks.hovered = -1;
      return;
    }
    this.marks.hovered = this.picker.pick(this.stage.rayAt(event))?.body ?? -1;
  }

  get busy(): boolean {
    return this.grabbing !== null;
  }

  private pressed(event: PointerEvent): void {
    if (event.button !== 0) {
      this.down = null;
      return;
    }
    this.down = { x: event.clientX, y: event.clientY, button: event.button, used: false };
    const tool = event.ctrlKey || event.metaKey ? 'grab' : this.tool;
    if (tool !== 'grab' && tool !== 'push') return;
    const hit = this.picker.pick(this.stage.rayAt(event));
    if (!hit || hit.body < 0) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    this.down.used = true;
    if (!this.host.mayAct()) {
      this.host.say(this.host.whyNot(), 'bad');
      return;
    }
    this.canvas.setPointerCapture(event.pointerId);
    if (tool === 'push') this.push(hit, event);
    else this.grab(hit);
  }

  private dragged(event: PointerEvent): void {
    this.hoverAt = event;
    if (this.grabbing) {
      event.stopImmediatePropagation();
      this.grabbing.drag(this.stage.rayAt(event));
    }
  }

  private lifted(event: PointerEvent): void {
    const down = this.down;
    this.down = null;
    if (this.grabbing) {
      event.stopImmediatePropagation();
      this.letGo();
      return;
    }
    if (!down || down.used || Math.hypot(event.clientX - down.x, event.clientY - down.y) > clickSlop) return;
    const hit = this.picker.pick(this.stage.rayAt(event));
    if (this.tool === 'spawn') {
      if (hit) this.spawn(hit);
      return;
    }
    this.select(hit ? hit.body : -1);
  }

  private wheeled(event: WheelEvent): void {
    if (!this.grabbing) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    this.grabbing.reach(this.stage.camera.position, event.deltaY < 0 ? 1.06 : 1 / 1.06);
  }

  private push(hit: Hit, event: PointerEvent): void {
    const { body } = hit;
    const impulse = this.stage.rayAt(event).direction.clone().multiplyScalar(this.bodies.mass[body]! * this.settings.now.pushSpeed);
    const turn = new Quaternion().fromArray(this.bodies.rot, 4 * body);
    const centre = new Vector3().fromArray(this.bodies.pos, 3 * body);
    const point = hit.point.clone().sub(centre).applyQuaternion(turn.invert());
    this.select(body);
    void this.requests.act({
      case: 'push',
      value: create(PushSchema, { body: this.bodies.ids[body]!, impulse: vec3(impulse), point: vec3(point) }),
    });
  }

  private grab(hit: Hit): void {
    const { body } = hit;
    this.select(body);
    this.views.controls.enabled = false;
    this.grabbing = new Grabbing(
      this.requests,
      body,
      this.bodies.ids[body]!,
      hit.point,
      new Vector3().fromArray(this.bodies.pos, 3 * body),
      new Quaternion().fromArray(this.bodies.rot, 4 * body),
      this.stage.camera.getWorldDirection(new Vector3()),
    );
  }

  private letGo(): void {
    this.down = null;
    this.grabbing?.release();
    this.grabbing = null;
    this.views.controls.enabled = true;
  }
}
