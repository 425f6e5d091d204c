// A Frame with its packed bytes as arrays. The bytes in a message lie at any address; typed arrays need aligned ones, so
// they are copied (which also lets go of the rest of the message).
import type { Frame } from '../gen/viewer_pb';

export interface Snapshot {
  number: number;
  step: number;
  whole: boolean;
  anticipated: boolean;
  age: number;
  index: Uint32Array;
  position: Float32Array;
  orientation: Int16Array;
  speed: Uint16Array;
  world: Uint16Array;
  flags: Uint8Array;
  gone: Uint32Array;
  at: number; // s, when it came
}

const aligned = (bytes: Uint8Array): ArrayBuffer => bytes.slice().buffer as ArrayBuffer;

// Of what was told about the bodies only as much is taken as all arrays have: a frame that is malformed shows fewer
// bodies rather than none.
export function unpack(frame: Frame, now: number): Snapshot {
  const count = Math.min(
    frame.index.length >> 2,
    Math.floor(frame.position.length / 12),
    frame.orientation.length >> 3,
    frame.speed.length >> 1,
    frame.world.length >> 1,
    frame.flags.length,
  );
  return {
    number: frame.number,
    step: Number(frame.step),
    whole: frame.whole,
    anticipated: frame.anticipated,
    age: frame.age,
    index: new Uint32Array(aligned(frame.index), 0, count),
    position: new Float32Array(aligned(frame.position), 0, 3 * count),
    orientation: new Int16Array(aligned(frame.orientation), 0, 4 * count),
    speed: new Uint16Array(aligned(frame.speed), 0, count),
    world: new Uint16Array(aligned(frame.world), 0, count),
    flags: new Uint8Array(aligned(frame.flags), 0, count),
    gone: new Uint32Array(aligned(frame.gone), 0, frame.gone.length >> 2),
    at: now,
  };
}
