// What the mock has for physics: bodies fall, bounce, walk and fly, each by itself. The steps from some time ago to some
// ahead of the displayed one are kept, so that the page can look at both; an action changes steps that are there already.
import { FrameFlag } from '../../src/gen/viewer_pb';
import type { Action } from '../../src/gen/action_pb';
import { randoms, type Kind, type MockBody, type MockScene } from './scenes';

export const dt = 1 / 60;
export const lead = 4;
export const ahead = 28; // steps beyond the displayed one
const width = 13; // position 3, quaternion 4, velocity 3, spin 3

export interface State {
  step: number;
  values: Float32Array;
  there: Uint8Array;
  asleep: Uint8Array;
}

interface Applied {
  step: number;
  number: bigint;
  body: number; // index
  action: Action['kind'];
}

interface Hold {
  body: number;
  point: number[];
  target: number[];
}

export class Simulation {
  displayed = 0;
  oldest = 0;
  newest = 0;
  redone = new Map<number, number>(); // body: until when it is told of
  private states = new Map<number, State>();
  private log: Applied[] = [];
  private next = 1n;
  private kinds: Kind[] = [];
  private random = randoms(99);
  private byId = new Map<bigint, number>();

  constructor(
    readonly scene: MockScene,
    private readonly history: number,
  ) {
    scene.bodies.forEach((body, i) => this.byId.set(body.id, i));
    this.kinds = scene.bodies.map((b) => b.kind);
    const n = scene.bodies.length;
    const state: State = { step: 0, values: new Float32Array(width * n), there: new Uint8Array(n).fill(1), asleep: new Uint8Array(n) };
    scene.bodies.forEach((body, i) => {
      state.values.set(body.start, width * i);
      if (body.kind === 'stack') state.asleep[i] = 1;
    });
    this.states.set(0, state);
    this.runTo(ahead);
  }

  state(step: number): State | undefined {
    return this.states.get(step);
  }

  advance(): void {
    this.displayed++;
    this.runTo(this.displayed + ahead);
    while (this.displayed - this.oldest > this.history) this.states.delete(this.oldest++);
  }

  // Whose cell a body is in.
  ownerOf(state: State, i: number, dx = 0, dy = 0, dz = 0): number {
    const { origin, edge, size } = this.scene.grid;
    const off = [dx, dy, dz];
    const cell = [0, 1, 2].map((c) =>
      Math.min(size[c]! - 1, Math.max(0, Math.floor((state.values[width * i + c]! + off[c]! - origin[c]!) / edge))),
    );
    this.scene.territories.goTo(state.step);
    return this.scene.territories.ownerAt(cell[0]!, cell[1]!, cell[2]!);
  }

  flagsOf(state: State, i: number, owner: number): number {
    let flags = state.asleep[i] ? FrameFlag.FLAG_ASLEEP : 0;
    const half = 0.4 * this.scene.grid.edge;
    const near = [half, -half].some(
      (d) => this.ownerOf(state, i, d) !== owner || this.ownerOf(state, i, 0, d) !== owner || this.ownerOf(state, i, 0, 0, d) !== owner,
    );
    if (near) flags |= FrameFlag.FLAG_NEAR;
    if (near && !state.asleep[i] && i % 3 === 0) flags |= FrameFlag.FLAG_MIXED;
    return flags;
  }

  // Returns what the session would answer, and how many steps were done again.
  act(action: Action): { reason?: string; step: number; body: bigint; logged: bigint; steps: number; index: number } {
    const refuse = (reason: string) => ({ reason, step: 0, body: 0n, logged: 0n, steps: 0, index: -1 });
    const step = this.displayed + lead + 1;
    const kind = action.kind;
    let index = -1;
    let body = 0n;
    if (kind.case === 'spawn') {
      index = this.addBody(kind.value);
      body = this.scene.bodies[index]!.id;
    } else if (kind.case === 'move' || kind.case === 'release') {
      const grab = kind.value.grab;
      const of = this.log.find((entry) => entry.number === grab && entry.action.case === 'grab');
      if (!of) return refuse(`there is no grab ${grab}`);
      index = of.body;
    } else if (kind.case) {
      const found = this.byId.get(kind.value.body);
      if (found === undefined || !this.states.get(step)!.there[found]) return refuse(`there is no body ${kind.value.body}`);
      index = found;
    } else return refuse('nothing is asked for');
    const number = this.next++;
    this.log.push({ step, number, body: index, action: kind });
    const steps = this.newest - step + 1;
    this.newest = step - 1;
    this.runTo(this.displayed + ahead);
    this.redone.set(index, this.displayed + 3);
    return { step, body, logged: number, steps, index };
  }

  private addBody(spawn: Extract<Action['kind'], { case: 'spawn' }>['value']): number {
    const body = spawn.body!;
    const at = body.pose?.position;
    const shape = body.shape[0]?.kind;
    const half = shape?.case === 'box' ? (shape.value.size?.z ?? 1) / 2 : shape?.case === 'sphere' || shape?.case === 'capsule' ? shape.value.radius : 0.5;
    const made: MockBody = {
      id: this.scene.bodies.reduce((most, b) => (b.id > most ? b.id : most), 0n) + 1n,
      kind: 'ball',
      mesh: 0, // the server says which
      half,
      colour: body.colour ?? 0xb4b4b4ff,
      mass: 1000 * (2 * half) ** 3,
      group: -1,
      start: [at?.x ?? 0, at?.y ?? 0, at?.z ?? 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0],
    };
    this.scene.bodies.push(made);
    this.kinds.push(made.kind);
    this.byId.set(made.id, this.scene.bodies.length - 1);
    for (const [step, old] of this.states) {
      const grow = <T extends Float32Array | Uint8Array>(a: T, by: number): T => {
        const larger = new (a.constructor as new (n: number) => T)(a.length + by);
        larger.set(a);
        return larger;
      };
      this.states.set(step, { step, values: grow(old.values, width), there: grow(old.there, 1), asleep: grow(old.asleep, 1) });
    }
    return this.scene.bodies.length - 1;
  }

  private runTo(step: number): void {
    while (this.newest < step) {
      const before = this.states.get(this.newest)!;
      this.newest++;
      const state: State = { step: this.newest, values: before.values.slice(), there: before.there.slice(), asleep: before.asleep.slice() };
      for (let i = 0; i < state.there.length; i++) if (state.there[i] && !state.asleep[i]) this.move(state, i);
      this.apply(state, this.newest);
      this.states.set(this.newest, state);
    }
  }

  private apply(state: State, step: number): void {
    const holds = new Map<bigint, Hold>();
    for (const { step: at, number, body, action } of this.log) {
      if (at > step) continue;
      if (action.case === 'grab') {
        const { point: p, target: t } = action.value;
        holds.set(number, { body, point: [p?.x ?? 0, p?.y ?? 0, p?.z ?? 0], target: [t?.x ?? 0, t?.y ?? 0, t?.z ?? 0] });
      }
      if (action.case === 'move') {
        const t = action.value.target;
        const hold = holds.get(action.value.grab);
        if (hold) hold.target = [t?.x ?? 0, t?.y ?? 0, t?.z ?? 0];
      }
      if (action.case === 'release') holds.delete(action.value.grab);
      if (at !== step) continue;
      this.wake(state, body);
      const v = width * body + 7;
      if (action.case === 'push') {
        const { impulse } = action.value;
        const mass = this.scene.bodies[body]!.mass;
        [impulse?.x, impulse?.y, impulse?.z].forEach((x, c) => (state.values[v + c]! += (x ?? 0) / mass));
        for (let c = 0; c < 3; c++) state.values[v + 3 + c]! += (this.random() - 0.5) * 4;
      }
      if (action.case === 'spawn') {
        state.there[body] = 1;
        state.values.set(this.scene.bodies[body]!.start, width * body);
      }
      if (action.case === 'remove') state.there[body] = 0;
    }
    for (const { body, target } of holds.values())
      for (let c = 0; c < 3; c++) {
        // A critically damped spring of 3 Hz, and no gravity while it holds.
        const at = width * body + c;
        const w = 2 * Math.PI * 3;
        state.values[at + 7]! += dt * (w * w * (target[c]! - state.values[at]!) - 2 * w * state.values[at + 7]!) + (c === 2 ? -dt * this.scene.gravity : 0);
      }
  }

  private wake(state: State, body: number): void {
    const group = this.scene.bodies[body]!.group;
    this.scene.bodies.forEach((other, i) => {
      if (i !== body && (group < 0 || other.group !== group)) return;
      if (state.asleep[i]) for (let c = 7; c < 9; c++) state.values[width * i + c] = (this.random() - 0.5) * 0.6;
      state.asleep[i] = 0;
    });
  }

  private move(state: State, i: number): void {
    const s = state.values;
    const o = width * i;
    const kind = this.kinds[i]!;
    const { low, high, gravity, bodies } = this.scene;
    const half = bodies[i]!.half;
    if (kind === 'walker' && s[o + 2]! <= half + 0.01 && Math.abs(s[o + 9]!) < 0.01) {
      for (let c = 0; c < 2; c++) {
        s[o + c]! += dt * s[o + 7 + c]!;
        if (s[o + c]! > high[c]!) s[o + 7 + c] = -Math.abs(s[o + 7 + c]!);
        if (s[o + c]! < low[c]!) s[o + 7 + c] = Math.abs(s[o + 7 + c]!);
      }
      return;
    }
    s[o + 9]! += dt * gravity;
    for (let c = 0; c < 3; c++) s[o + c]! += dt * s[o + 7 + c]!;
    const floor = kind === 'flyer' ? low[2]! : 0;
    for (let c = 0; c < 3; c++) {
      const least = c === 2 ? floor + half : low[c]! - (kind === 'flyer' ? 0 : 8);
      if (s[o + c]! < least) {
        s[o + c] = least;
        s[o + 7 + c] = Math.abs(s[o + 7 + c]!) * (kind === 'stack' ? 0.15 : kind === 'flyer' ? 1 : 0.72);
        if (c === 2 && kind !== 'flyer') for (const k of [7, 8, 10, 11, 12]) s[o + k]! *= kind === 'stack' ? 0.6 : 0.93;
      }
      if ((c < 2 || kind === 'flyer') && s[o + c]! > high[c]! + (kind === 'flyer' ? 0 : 8)) s[o + 7 + c] = -Math.abs(s[o + 7 + c]!);
    }
    turn(s, o + 3, s[o + 10]! * dt, s[o + 11]! * dt, s[o + 12]! * dt);
    let still = 0;
    for (let c = 7; c < 13; c++) still += s[o + c]! ** 2;
    if (kind !== 'flyer' && still < 0.03 && s[o + 2]! < half + 0.02) state.asleep[i] = 1;
  }
}

// Turns the quaternion at q by a small rotation.
function turn(s: Float32Array, q: number, wx: number, wy: number, wz: number): void {
  const [x, y, z, w] = [s[q]!, s[q + 1]!, s[q + 2]!, s[q + 3]!];
  const a = [x + 0.5 * (wx * w + wy * z - wz * y), y + 0.5 * (wy * w + wz * x - wx * z), z + 0.5 * (wz * w + wx * y - wy * x), w - 0.5 * (wx * x + wy * y + wz * z)];
  const norm = 1 / Math.hypot(...a);
  for (let c = 0; c < 4; c++) s[q + c] = a[c]! * norm;
}
