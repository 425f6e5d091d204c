// What a picture costs in script, without a browser: taking a frame from its bytes, moving bodies, filling the arrays
// that go to the GPU. `npm run bench -- [bodies ...]`. CPU time, so that a busy machine counts less.
import { create, fromBinary, toBinary } from '@bufbuild/protobuf';
import { Scene } from 'three';
import { BodyColours } from '../src/draw/body_colours';
import { Instances } from '../src/draw/instances';
import { Shapes } from '../src/draw/shapes';
import { BodyListSchema, FrameSchema, ToPageSchema } from '../src/gen/viewer_pb';
import { Bodies } from '../src/model/bodies';
import { Playback } from '../src/model/playback';
import { unpack } from '../src/model/snapshot';
import { defaults } from '../src/settings';
import { boxMesh, sphereMesh } from './mock/scenes';

const dt = 1 / 60;
const frames = 200;

function frameBytes(step: number, count: number): Uint8Array {
  const position = new Float32Array(3 * count);
  const orientation = new Int16Array(4 * count);
  for (let i = 0; i < count; i++) {
    const t = step * dt + i;
    position.set([i % 100, Math.floor(i / 100), 2 + Math.sin(t)], 3 * i);
    orientation.set([0, 0, 32767 * Math.sin(t / 2), 32767 * Math.cos(t / 2)], 4 * i);
  }
  const raw = (array: Float32Array | Int16Array | Uint32Array | Uint16Array) => new Uint8Array(array.buffer);
  const frame = create(FrameSchema, {
    number: step + 1, step: BigInt(step), whole: step === 0,
    index: raw(Uint32Array.from({ length: count }, (_, i) => i)), position: raw(position), orientation: raw(orientation),
    speed: raw(new Uint16Array(count).fill(100)), world: raw(new Uint16Array(count)), flags: new Uint8Array(count),
  });
  return toBinary(ToPageSchema, create(ToPageSchema, { what: { case: 'frame', value: frame } }));
}

function run(count: number): void {
  const bodies = new Bodies();
  const shapes = new Shapes();
  for (const mesh of [boxMesh(1, 1, 1), sphereMesh(0.5)]) shapes.add(mesh);
  const colours = new BodyColours(bodies, { ...defaults, colour: 'speed' });
  const instances = new Instances(new Scene(), bodies, shapes, (body) => colours.of(body));
  bodies.add(create(BodyListSchema, {
    first: 0, id: Array.from({ length: count }, (_, i) => BigInt(i + 1)), mesh: Array.from({ length: count }, (_, i) => i % 2),
    colour: new Array<number>(count).fill(0xff), mass: new Array<number>(count).fill(1),
  }));
  const playback = new Playback(bodies, {
    appeared: (b) => instances.appeared(b), vanished: (b) => instances.vanished(b),
    moved: (list) => instances.moved(list), changed: (list) => instances.recolour(list),
  }, dt);
  const messages = Array.from({ length: frames }, (_, step) => frameBytes(step, count));
  let taking = 0;
  let drawing = 0;
  const cpu = () => process.cpuUsage().user / 1000;
  messages.forEach((bytes, step) => {
    const now = step * dt;
    const a = cpu();
    const message = fromBinary(ToPageSchema, bytes);
    if (message.what.case === 'frame') playback.take(unpack(message.what.value, now));
    const b = cpu();
    playback.advance(now);
    instances.upload();
    const c = cpu();
    if (step < frames / 2) return; // until it is compiled
    taking += b - a;
    drawing += c - b;
  });
  const each = (total: number) => (total / (frames / 2)).toFixed(2);
  console.log(`${count} moving bodies: ${each(taking)} ms to take a frame (${(messages[1]!.length / 1000).toFixed(0)} KB), ${each(drawing)} ms to move them`);
}

const asked = process.argv.slice(2).map(Number);
for (const count of asked.length > 0 ? asked : [1000, 8000, 30000]) run(count);
