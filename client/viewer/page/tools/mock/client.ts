// One page at the mock gateway: what it looks at, and the frames it is sent, each only with what differs.
import { create, toBinary } from '@bufbuild/protobuf';
import type { WebSocket } from 'ws';
import { FrameSchema, ToPageSchema, type ToPage } from '../../src/gen/viewer_pb';
import type { Simulation } from './simulation';

const width = 13;
const mostBehind = 6; // frames that the page has not confirmed

export class Client {
  offset = 0;
  held: number | null = null;
  confirmed = 0;
  anew = true; // the next frame has everything
  private number = 0;
  private sentStep = -1;
  private sent = new Float32Array(0);
  private sentThere = new Uint8Array(0);
  private sentFlags = new Uint8Array(0);

  constructor(
    private readonly socket: WebSocket,
    readonly mayAct: boolean,
  ) {}

  send(what: ToPage['what']): void {
    if (this.socket.readyState === this.socket.OPEN) this.socket.send(toBinary(ToPageSchema, create(ToPageSchema, { what })));
  }

  frame(simulation: Simulation, final: number): void {
    const wanted = this.held ?? simulation.displayed + this.offset;
    const step = Math.min(simulation.newest, Math.max(simulation.oldest, wanted));
    if (this.number - this.confirmed > mostBehind || (step === this.sentStep && simulation.redone.size === 0)) return;
    const state = simulation.state(step);
    if (!state) return;
    const n = state.there.length;
    const whole = this.anew;
    this.anew = false;
    if (this.sent.length < n * 7) {
      const grow = <T extends Float32Array | Uint8Array>(old: T, size: number): T => {
        const larger = new (old.constructor as new (n: number) => T)(size);
        larger.set(old);
        return larger;
      };
      this.sent = grow(this.sent, 7 * n);
      this.sentThere = grow(this.sentThere, n);
      this.sentFlags = grow(this.sentFlags, n);
    }
    const index = new Uint32Array(n);
    const position = new Float32Array(3 * n);
    const orientation = new Int16Array(4 * n);
    const speed = new Uint16Array(n);
    const world = new Uint16Array(n);
    const flags = new Uint8Array(n);
    const gone: number[] = [];
    let count = 0;
    for (let i = 0; i < n; i++) {
      if (!state.there[i]) {
        if (this.sentThere[i]) gone.push(i);
        this.sentThere[i] = 0;
        continue;
      }
      const o = width * i;
      const owner = simulation.ownerOf(state, i);
      let flag = simulation.flagsOf(state, i, owner);
      if (simulation.redone.has(i)) flag |= 8;
      let same = !whole && this.sentThere[i] === 1 && this.sentFlags[i] === flag && !(flag & 8);
      for (let c = 0; c < 7 && same; c++) same = this.sent[7 * i + c] === state.values[o + c];
      if (same) continue;
      this.sentThere[i] = 1;
      this.sentFlags[i] = flag;
      for (let c = 0; c < 7; c++) this.sent[7 * i + c] = state.values[o + c]!;
      index[count] = i;
      for (let c = 0; c < 3; c++) position[3 * count + c] = state.values[o + c]!;
      for (let c = 0; c < 4; c++) orientation[4 * count + c] = Math.round(32767 * state.values[o + 3 + c]!);
      speed[count] = state.asleep[i] ? 0 : Math.min(65535, Math.round(100 * Math.hypot(state.values[o + 7]!, state.values[o + 8]!, state.values[o + 9]!)));
      world[count] = owner;
      flags[count] = flag;
      count++;
    }
    this.sentStep = step;
    this.number++;
    const packed = (array: { buffer: ArrayBufferLike; BYTES_PER_ELEMENT: number }, each: number) =>
      new Uint8Array(array.buffer as ArrayBuffer, 0, each * count * array.BYTES_PER_ELEMENT);
    this.send({
      case: 'frame',
      value: create(FrameSchema, {
        number: this.number,
        step: BigInt(step),
        whole,
        anticipated: step > final,
        index: packed(index, 1),
        position: packed(position, 3),
        orientation: packed(orientation, 4),
        speed: packed(speed, 1),
        world: packed(world, 1),
        flags: packed(flags, 1),
        gone: new Uint8Array(Uint32Array.from(gone).buffer),
        age: 0.004,
      }),
    });
  }
}
