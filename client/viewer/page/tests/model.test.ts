// What needs no browser: playback, pace, territories, shapes.
import { create } from '@bufbuild/protobuf';
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Shapes } from '../src/draw/shapes';
import { BodyListSchema, GridSchema, TransferSchema } from '../src/gen/viewer_pb';
import { Bodies } from '../src/model/bodies';
import { Grid } from '../src/model/grid';
import { Playback } from '../src/model/playback';
import type { Snapshot } from '../src/model/snapshot';
import { boxMesh, capsuleMesh, sphereMesh } from '../tools/mock/scenes';

const dt = 1 / 60;

function makePlayback(count: number) {
  const bodies = new Bodies();
  bodies.add(create(BodyListSchema, { first: 0, id: Array.from({ length: count }, (_, k) => BigInt(k + 1)), mesh: [], colour: [], mass: [] }));
  const log: string[] = [];
  const playback = new Playback(
    bodies,
    { appeared: (b) => log.push(`+${b}`), vanished: (b) => log.push(`-${b}`), moved: () => {}, changed: () => {} },
    dt,
  );
  return { bodies, playback, log };
}

// Bodies at (x, 0, 0), turned about z by `angle`.
function snapshot(step: number, at: number, list: [body: number, x: number, speed?: number, angle?: number][], more: Partial<Snapshot> = {}): Snapshot {
  return {
    number: step, step, whole: false, anticipated: false, age: 0, at,
    index: Uint32Array.from(list.map(([b]) => b)),
    position: Float32Array.from(list.flatMap(([, x]) => [x, 0, 0])),
    orientation: Int16Array.from(list.flatMap(([, , , a = 0]) => [0, 0, Math.round(32767 * Math.sin(a / 2)), Math.round(32767 * Math.cos(a / 2))])),
    speed: Uint16Array.from(list.map(([, , s = 0]) => Math.round(100 * s))),
    world: new Uint16Array(list.length), flags: new Uint8Array(list.length), gone: new Uint32Array(0),
    ...more,
  };
}

test('a body that moves evenly is shown moving evenly, a little late', () => {
  const { bodies, playback } = makePlayback(1);
  const speed = 6;
  let last = -Infinity;
  const moves: number[] = [];
  const hertz = 240; // pictures, four times as often as frames
  // Frames are up to 8 ms late, each by another time.
  const arrival = (step: number) => step * dt + 0.008 * Math.abs(Math.sin(7 * step));
  for (let picture = 0, step = 0; picture < 2 * hertz; picture++) {
    const now = picture / hertz;
    for (; arrival(step) <= now; step++)
      playback.take(snapshot(step, arrival(step), [[0, speed * step * dt, speed]], { whole: step === 0 }));
    playback.advance(now);
    const x = bodies.pos[0]!;
    assert.ok(x >= last - 1e-6, 'never backwards');
    if (picture > hertz / 2) moves.push(x - last);
    last = x;
  }
  const even = speed / hertz;
  for (const move of moves) assert.ok(Math.abs(move - even) < 0.35 * even, `moved ${move}, evenly would be ${even}`);
  const late = 2 - last / speed;
  assert.ok(late > 0 && late < 0.06, `${late} s late`);
});

test('a body that jumped is put there, and not drawn on its way', () => {
  const { bodies, playback } = makePlayback(2);
  playback.take(snapshot(0, 0, [[0, 0], [1, 0, 3]], { whole: true }));
  playback.advance(0);
  playback.take(snapshot(1, dt, [[0, 50], [1, 0.05, 3]]));
  const seen = new Set<number>();
  for (let k = 0; k <= 40; k++) {
    playback.advance(k * 0.002);
    seen.add(bodies.pos[0]!);
  }
  assert.deepEqual([...seen].sort((a, b) => a - b), [0, 50]);
  assert.ok(Math.abs(bodies.pos[3]! - 0.05) < 1e-6);
});

test('rotations take the shorter way, with unit length', () => {
  const { bodies, playback } = makePlayback(1);
  playback.take(snapshot(0, 0, [[0, 0, 0, 3]], { whole: true }));
  playback.advance(0);
  playback.take(snapshot(1, dt, [[0, 0, 0, -3]])); // 0.28 rad away across the half turn
  for (let k = 0; k <= 30; k++) {
    playback.advance(k * 0.002);
    const [x, y, z, w] = bodies.rot.slice(0, 4) as unknown as [number, number, number, number];
    assert.ok(Math.abs(Math.hypot(x, y, z, w) - 1) < 1e-4);
    assert.ok(Math.abs(2 * Math.atan2(Math.abs(z), w) - Math.PI) < 0.15, 'stays near the half turn');
  }
});

test('a frame with everything removes what it does not name', () => {
  const { bodies, playback, log } = makePlayback(3);
  playback.take(snapshot(0, 0, [[0, 0], [1, 1], [2, 2]], { whole: true }));
  playback.take(snapshot(1, dt, [[0, 0], [2, 2]], { whole: true }));
  for (let k = 0; k < 40; k++) playback.advance(k * 0.005);
  assert.deepEqual(log, ['+0', '+1', '+2', '-1']);
  playback.take(snapshot(2, 2 * dt, [], { gone: Uint32Array.of(0) }));
  for (let k = 0; k < 40; k++) playback.advance(0.2 + k * 0.005);
  assert.deepEqual([...bodies.present.slice(0, 3)], [0, 0, 1]);
});

test('another step is shown at once when the time jumps back', () => {
  const { bodies, playback } = makePlayback(1);
  playback.take(snapshot(100, 0, [[0, 10]], { whole: true }));
  playback.advance(0);
  playback.take(snapshot(60, 0.02, [[0, 6]]));
  playback.advance(0.021);
  assert.equal(playback.step(), 60);
  assert.equal(bodies.pos[0], 6);
});

test('what is corrected while time stands still is shown', () => {
  const { bodies, playback } = makePlayback(1);
  playback.take(snapshot(10, 0, [[0, 1]], { whole: true }));
  playback.advance(0);
  playback.take(snapshot(10, 1, [[0, 1.02]]));
  playback.advance(1.02);
  assert.ok(Math.abs(bodies.pos[0]! - 1.02) < 1e-6);
});

test('bodies that were not listed are left out', () => {
  const { bodies, playback, log } = makePlayback(1);
  playback.take(snapshot(0, 0, [[5, 1], [0, 2]], { whole: true }));
  playback.advance(0);
  assert.deepEqual(log, ['+0']);
  assert.equal(bodies.pos[0], 2);
});

test('borders are put together into few rectangles', () => {
  const size = [20, 10, 5];
  const owner = new Uint16Array(1000);
  for (let k = 0; k < 1000; k++) owner[k] = k % 20 < 8 ? 0 : 1;
  const grid = new Grid(create(GridSchema, { origin: [-10, 0, 1], edge: 2, size, owner: new Uint8Array(owner.buffer) }));
  const faces = grid.faces();
  assert.equal(faces.length, 1);
  assert.deepEqual(faces[0], { axis: 0, at: 6, low: [0, 1], high: [20, 11], below: 0, above: 1 });
  assert.deepEqual(grid.centres(2)[0], [-2, 10, 6]);
});

test('cells change hands at the steps of their transfers, forwards and backwards', () => {
  const size = [6, 1, 1];
  const owner = Uint16Array.of(0, 0, 0, 0, 1, 1);
  const grid = new Grid(create(GridSchema, { origin: [0, 0, 0], edge: 1, size, owner: new Uint8Array(owner.buffer) }));
  const transfer = (step: number, giver: number, taker: number, cell: number[]) =>
    create(TransferSchema, { step: BigInt(step), giver, taker, cell });
  const owners = () => [...grid.owner];
  const borders = () => grid.faces().map(({ at, below, above }) => [at, below, above]);
  assert.equal(grid.goTo(10), false, 'nothing is known yet');
  grid.add([transfer(20, 0, 1, [3]), transfer(40, 1, 2, [4, 5])]);
  assert.equal(grid.goTo(19), false);
  assert.deepEqual(owners(), [0, 0, 0, 0, 1, 1]);
  assert.deepEqual(borders(), [[4, 0, 1]]);
  assert.equal(grid.goTo(20), true);
  assert.deepEqual(owners(), [0, 0, 0, 1, 1, 1]);
  assert.deepEqual(borders(), [[3, 0, 1]]);
  assert.deepEqual(grid.cells(3), [3, 3, 0]);
  assert.equal(grid.goTo(39), false, 'walls are not to be made anew');
  assert.equal(grid.goTo(90), true);
  assert.deepEqual(owners(), [0, 0, 0, 1, 2, 2]);
  assert.equal(grid.goTo(40), false);
  assert.equal(grid.goTo(39), true, 'back in time');
  assert.deepEqual(owners(), [0, 0, 0, 1, 1, 1]);
  assert.equal(grid.goTo(0), true);
  assert.deepEqual(owners(), [0, 0, 0, 0, 1, 1]);
  grid.goTo(50);
  // One that became known late counts before those of later steps: cell 5 goes to 0 first, and then on to 2.
  grid.add([transfer(30, 1, 0, [5, 3])]);
  assert.equal(grid.goTo(50), true);
  assert.deepEqual(owners(), [0, 0, 0, 0, 2, 2]);
  assert.equal(grid.goTo(50), false);
  grid.goTo(35);
  assert.deepEqual(owners(), [0, 0, 0, 0, 1, 0]);
  // Cells that there are not are left alone.
  grid.add([transfer(36, 0, 1, [2, 6, 4000000])]);
  assert.equal(grid.goTo(36), true);
  assert.deepEqual(owners(), [0, 0, 1, 0, 1, 0]);
});

test('boxes of all sizes are one shape, and so are spheres', () => {
  const shapes = new Shapes();
  for (const mesh of [boxMesh(1, 2, 3), boxMesh(0.3, 0.3, 5), sphereMesh(0.2), sphereMesh(1.7), capsuleMesh(0.2, 1)]) shapes.add(mesh);
  assert.deepEqual(shapes.shapes.map((s) => s.kind), ['box', 'round', 'other']);
  assert.deepEqual(shapes.forms.map((f) => f.shape), [0, 0, 1, 1, 2]);
  shapes.forms[1]!.size.forEach((s, c) => assert.ok(Math.abs(s - [0.15, 0.15, 2.5][c]!) < 1e-6));
});
