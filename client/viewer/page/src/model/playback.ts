// From frames that come over the network to what is displayed at each picture: a short queue of frames, and between two
// of them straight lines for places and slerp for rotations. A body that jumped is put there rather than drawn on its
// way; so is everything when the step jumps.
import { FrameFlag } from '../gen/viewer_pb';
import type { Bodies } from './bodies';
import { Pacer } from './pacer';
import type { Snapshot } from './snapshot';

const queueLimit = 40; // frames; a page that does not draw (hidden tab) must not keep more
const shortJump = 10; // steps that may be missing between two frames before it counts as a jump
const quantum = 1 / 32767; // of orientation

export interface PlaybackEvents {
  appeared(body: number): void;
  vanished(body: number): void;
  moved(bodies: Uint32Array): void; // places and rotations
  changed(bodies: Uint32Array): void; // speed, world, flags
}

export class Playback {
  head = 0; // steps, where the picture is
  anticipated = false; // of the frame that the picture is moving to
  delay = 0; // s, from when a world had computed what was reached last until it was shown
  private queue: Snapshot[] = [];
  private active: Uint32Array = new Uint32Array(0); // bodies on their way from frame a to frame b
  private a = 0;
  private b = 0;
  private settled = true;
  private started = false;
  private jumpUntil = 0;
  private jumped = new Uint8Array(0);
  private last = 0; // s, the picture before
  private age = 0; // s, of frame b when it was sent
  private at = 0; // s, when it came
  private newest = 0;
  readonly pacer: Pacer;

  constructor(
    private readonly bodies: Bodies,
    private readonly events: PlaybackEvents,
    private readonly dt: number,
  ) {
    this.pacer = new Pacer(1 / dt);
  }

  // The step of the frame at or before the picture.
  step(): number {
    return this.settled ? this.b : this.a;
  }

  // Somebody asked for another step: what comes next is not the next picture of a movement.
  expectJump(now: number): void {
    this.jumpUntil = now + 0.4;
  }

  take(frame: Snapshot): void {
    const difference = frame.step - this.newest;
    const stride = this.pacer.stride();
    const limit = frame.at < this.jumpUntil ? 2.5 * stride : Math.max(shortJump, 4 * stride);
    const jump = !this.started || difference < 0 || difference > limit;
    this.newest = frame.step;
    this.queue.push(frame);
    if (jump) {
      this.flush();
      this.pacer.restart();
      this.head = frame.step;
      this.started = true;
    }
    if (jump || difference > 0) this.pacer.arrived(frame.at, frame.step);
    if (this.queue.length > queueLimit) this.flush();
  }

  // To the picture at `now` (s).
  advance(now: number): void {
    const passed = Math.min(0.1, Math.max(0, now - this.last));
    this.last = now;
    if (!this.started) return;
    const speed = this.pacer.speed();
    // Towards the target gently: being late or early by a frame is not seen, a change of speed is.
    const pull = (this.pacer.target(now) - this.head) * 5;
    this.head += passed * Math.min(4 * speed, Math.max(0.2 * speed, speed + pull));
    if (this.head > this.newest) this.head = this.newest;
    while (this.head >= this.b || this.settled) {
      if (!this.settled) this.delay = now - this.at + this.age;
      this.settle();
      const next = this.queue.shift();
      if (!next) break;
      this.begin(next);
    }
    if (!this.settled) this.interpolate((this.head - this.a) / (this.b - this.a));
    else this.head = this.b;
  }

  // Shows the newest frame as it is.
  private flush(): void {
    for (let next = this.queue.shift(); next; next = this.queue.shift()) {
      this.settle();
      this.begin(next);
    }
    this.settle();
    this.head = this.b;
  }

  private settle(): void {
    if (this.settled) return;
    this.settled = true;
    const { pos, rot, fromPos, fromRot, toPos, toRot } = this.bodies;
    for (const i of this.active) {
      for (let c = 3 * i; c < 3 * i + 3; c++) pos[c] = fromPos[c] = toPos[c]!;
      for (let c = 4 * i; c < 4 * i + 4; c++) rot[c] = fromRot[c] = toRot[c]!;
    }
    this.events.moved(this.active);
  }

  // From what is displayed towards `frame`.
  private begin(frame: Snapshot): void {
    const bodies = this.bodies;
    const known = frame.index.every((i) => i < bodies.count) ? frame.index : frame.index.filter((i) => i < bodies.count);
    if (this.jumped.length < bodies.mesh.length) this.jumped = new Uint8Array(bodies.mesh.length);
    if (frame.whole) this.keepOnly(known);
    for (const i of frame.gone) if (i < bodies.count && bodies.present[i]) this.vanish(i);
    this.a = Math.min(this.b, frame.step);
    this.b = frame.step;
    this.active = known;
    this.anticipated = frame.anticipated;
    this.age = frame.age;
    this.at = frame.at;
    this.settled = false;

    const { toPos, toRot, fromPos, fromRot, pos, rot } = bodies;
    const time = Math.max(1, this.b - this.a) * this.dt;
    for (let k = 0, all = 0; all < frame.index.length; all++) {
      const i = frame.index[all]!;
      if (i !== known[k]) continue; // a body that the page was not told of
      k++;
      const p = 3 * i;
      const q = 4 * i;
      for (let c = 0; c < 3; c++) toPos[p + c] = frame.position[3 * all + c]!;
      for (let c = 0; c < 4; c++) toRot[q + c] = frame.orientation[4 * all + c]! * quantum;
      const speed = frame.speed[all]! / 100;
      const fresh = !bodies.present[i];
      // Farther than it can have moved.
      const reach = 2 * time * Math.max(speed, bodies.speed[i]!) + 0.1;
      const dx = toPos[p]! - fromPos[p]!;
      const dy = toPos[p + 1]! - fromPos[p + 1]!;
      const dz = toPos[p + 2]! - fromPos[p + 2]!;
      const jumped = fresh || dx * dx + dy * dy + dz * dz > reach * reach;
      this.jumped[i] = jumped ? 1 : 0;
      // What is new is there at once; what jumped stays until its frame is reached.
      if (fresh) {
        for (let c = 0; c < 3; c++) pos[p + c] = fromPos[p + c] = toPos[p + c]!;
        for (let c = 0; c < 4; c++) rot[q + c] = fromRot[q + c] = toRot[q + c]!;
      }
      bodies.speed[i] = speed;
      bodies.world[i] = frame.world[all]!;
      bodies.flags[i] = frame.flags[all]!;
      if (fresh) {
        bodies.present[i] = 1;
        this.events.appeared(i);
      }
    }
    this.events.changed(known);
  }

  private keepOnly(named: Uint32Array): void {
    const { present, count, flags } = this.bodies;
    const stays = new Uint8Array(count);
    for (const i of named) stays[i] = 1;
    for (let i = 0; i < count; i++) {
      flags[i]! &= ~FrameFlag.FLAG_REDONE;
      if (present[i] && !stays[i]) this.vanish(i);
    }
  }

  private vanish(body: number): void {
    this.bodies.present[body] = 0;
    this.events.vanished(body);
  }

  private interpolate(share: number): void {
    const t = Math.min(1, Math.max(0, share));
    const { pos, rot, fromPos, fromRot, toPos, toRot } = this.bodies;
    for (const i of this.active) {
      if (this.jumped[i]) continue;
      const p = 3 * i;
      pos[p] = fromPos[p]! + t * (toPos[p]! - fromPos[p]!);
      pos[p + 1] = fromPos[p + 1]! + t * (toPos[p + 1]! - fromPos[p + 1]!);
      pos[p + 2] = fromPos[p + 2]! + t * (toPos[p + 2]! - fromPos[p + 2]!);
      slerp(rot, fromRot, toRot, 4 * i, t);
    }
    this.events.moved(this.active);
  }
}

// out = from turned by the share t of the way to `to`, all at offset q.
function slerp(out: Float32Array, from: Float32Array, to: Float32Array, q: number, t: number): void {
  const ax = from[q]!;
  const ay = from[q + 1]!;
  const az = from[q + 2]!;
  const aw = from[q + 3]!;
  let dot = ax * to[q]! + ay * to[q + 1]! + az * to[q + 2]! + aw * to[q + 3]!;
  const sign = dot < 0 ? -1 : 1; // the shorter way round: q and -q are one rotation
  dot *= sign;
  let u = 1 - t;
  let v = t;
  if (dot < 0.9995) {
    const angle = Math.acos(Math.min(1, dot));
    const sine = 1 / Math.sin(angle);
    u = Math.sin(u * angle) * sine;
    v = Math.sin(v * angle) * sine;
  }
  v *= sign;
  const x = u * ax + v * to[q]!;
  const y = u * ay + v * to[q + 1]!;
  const z = u * az + v * to[q + 2]!;
  const w = u * aw + v * to[q + 3]!;
  const norm = 1 / Math.sqrt(x * x + y * y + z * z + w * w || 1);
  out[q] = x * norm;
  out[q + 1] = y * norm;
  out[q + 2] = z * norm;
  out[q + 3] = w * norm;
}
