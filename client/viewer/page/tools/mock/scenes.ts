// Scenes of the mock gateway: bodies, their meshes, floors, and territories. They are made up: what matters is that the
// page gets to see all that a session can show it.
import { create } from '@bufbuild/protobuf';
import { BoxGeometry, CapsuleGeometry, SphereGeometry, type BufferGeometry } from 'three';
import { GridSchema, MeshSchema, StaticSchema, type Grid, type Mesh, type Static } from '../../src/gen/viewer_pb';
import { Grid as Territories } from '../../src/model/grid';

export type Kind = 'stack' | 'walker' | 'ball' | 'flyer';

export interface MockBody {
  id: bigint;
  kind: Kind;
  mesh: number;
  half: number; // m, how high its centre is when it lies
  colour: number;
  mass: number;
  group: number; // what is woken together
  start: number[]; // position 3, quaternion 4, velocity 3, spin 3
}

export interface MockScene {
  name: string;
  gravity: number;
  bodies: MockBody[];
  meshes: Mesh[];
  statics: Static[];
  low: number[];
  high: number[];
  grid: Grid; // as pages are told it
  territories: Territories;
}

// The same numbers for each run.
export function randoms(seed: number): () => number {
  let state = seed >>> 0;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

const bytesOf = (array: Float32Array | Uint32Array | Uint16Array) => new Uint8Array(array.buffer, array.byteOffset, array.byteLength).slice();

export function meshOf(geometry: BufferGeometry): Mesh {
  const positions = geometry.attributes.position!.array as Float32Array;
  let radius = 0;
  for (let k = 0; k < positions.length; k += 3) radius = Math.max(radius, Math.hypot(positions[k]!, positions[k + 1]!, positions[k + 2]!));
  return create(MeshSchema, {
    positions: bytesOf(positions),
    normals: bytesOf(geometry.attributes.normal!.array as Float32Array),
    indices: bytesOf(Uint32Array.from(geometry.index!.array)),
    radius,
  });
}

export const boxMesh = (x: number, y: number, z: number) => meshOf(new BoxGeometry(x, y, z));
export const sphereMesh = (radius: number) => meshOf(new SphereGeometry(radius, 24, 14));
// three.js has its capsules along y, SODA along z.
export const capsuleMesh = (radius: number, length: number) => meshOf(new CapsuleGeometry(radius, length, 6, 20).rotateX(Math.PI / 2));

export function makeScene(name: string, count: number, worlds: number, plain: boolean): MockScene {
  const random = randoms(7);
  const meshes: Mesh[] = [];
  const bodies: MockBody[] = [];
  const statics: Static[] = [];
  const put = (kind: Kind, mesh: number, half: number, mass: number, colour: number, group: number, start: number[]) =>
    bodies.push({ id: BigInt(bodies.length + 1), kind, mesh, half, mass, colour: plain ? 0xb4b4b4ff : colour, group, start });
  const hues = [0xd98c5fff, 0xe0b870ff, 0x7fb08fff, 0x6f9fc4ff, 0x9a8fc9ff, 0xc97f8fff, 0xb9c0c9ff];
  const hue = () => hues[Math.floor(random() * hues.length)]!;

  if (name === 'cubes') {
    const scale = Math.cbrt(Math.max(1, count / 2400));
    const size = [40 * scale, 30 * scale, 20 * scale] as const;
    meshes.push(boxMesh(1, 1, 1));
    for (let k = 0; k < count; k++) {
      const q = [random() - 0.5, random() - 0.5, random() - 0.5, random() - 0.5];
      const norm = Math.hypot(...q) || 1;
      put('flyer', 0, 0.5, 1000, hue(), k, [
        ...size.map((s) => (random() - 0.5) * (s - 2)),
        ...q.map((c) => c / norm),
        ...[0, 0, 0].map(() => (random() - 0.5) * 5),
        ...[0, 0, 0].map(() => (random() - 0.5) * 3),
      ]);
    }
    for (let axis = 0; axis < 3; axis++)
      for (const side of [-1, 1]) {
        const extent = size.map((s, c) => (c === axis ? 0.5 : s + 1)) as [number, number, number];
        meshes.push(boxMesh(...extent));
        const position = [0, 0, 0];
        position[axis] = side * (size[axis]! / 2 + 0.25);
        statics.push(create(StaticSchema, { mesh: meshes.length - 1, position, orientation: [0, 0, 0, 1], colour: 0x8a93a0ff }));
      }
    return finish(name, 0, bodies, meshes, statics, worlds, 5);
  }

  // A small city: stacks of slabs, a crowd in the streets, balls.
  for (const size of [0.7, 0.85, 1, 1.2, 1.4]) meshes.push(boxMesh(size, size * 0.8, 0.4));
  const crowd = meshes.push(boxMesh(0.5, 0.4, 0.9)) - 1;
  const balls = [0.25, 0.35, 0.5].map((radius) => meshes.push(sphereMesh(radius)) - 1);
  const pill = meshes.push(capsuleMesh(0.25, 0.6)) - 1;
  const stacks = Math.round((0.5 * count) / 14);
  const side = Math.ceil(Math.sqrt(stacks));
  const apart = 6;
  const reach = (side * apart) / 2;
  for (let s = 0; s < stacks; s++) {
    const x = ((s % side) + 0.5) * apart - reach;
    const y = (Math.floor(s / side) + 0.5) * apart - reach;
    const floors = Math.min(14, Math.ceil(0.5 * count) - s * 14);
    for (let f = 0; f < floors; f++) {
      const m = Math.floor(random() * 5);
      const turn = (random() - 0.5) * 0.5;
      put('stack', m, 0.2, 250 * (1 + m), hue(), s, [x + (random() - 0.5) * 0.15, y + (random() - 0.5) * 0.15, 0.2 + 0.4 * f, 0, 0, Math.sin(turn / 2), Math.cos(turn / 2), 0, 0, 0, 0, 0, 0]);
    }
  }
  while (bodies.length < 0.85 * count) {
    const along = random() < 0.5 ? 0 : 1;
    const at: [number, number] = [0, 0];
    at[along] = (random() - 0.5) * 2 * reach;
    at[1 - along] = (Math.floor(random() * (side + 1)) * apart - reach) + (random() - 0.5) * 2.4;
    const velocity = [0, 0, 0];
    velocity[along] = (random() < 0.5 ? -1 : 1) * (0.9 + random());
    put('walker', crowd, 0.45, 70, hue(), -1, [at[0], at[1], 0.45, 0, 0, along ? Math.SQRT1_2 : 0, along ? Math.SQRT1_2 : 1, ...velocity, 0, 0, 0]);
  }
  while (bodies.length < count) {
    const m = Math.floor(random() * 4);
    const half = m < 3 ? [0.25, 0.35, 0.5][m]! : 0.25;
    put('ball', m < 3 ? balls[m]! : pill, half, 4200 * half ** 3, hue(), -1, [
      (random() - 0.5) * 2 * reach,
      (random() - 0.5) * 2 * reach,
      1 + random() * 6,
      0, 0, 0, 1,
      (random() - 0.5) * 3, (random() - 0.5) * 3, 0,
      (random() - 0.5) * 6, (random() - 0.5) * 6, 0,
    ]);
  }
  const floor = meshes.push(boxMesh(2 * reach + 60, 2 * reach + 60, 1)) - 1;
  statics.push(create(StaticSchema, { mesh: floor, position: [0, 0, -0.5], orientation: [0, 0, 0, 1], colour: 0x707884ff }));
  return finish(name, -9.81, bodies, meshes, statics, worlds, 3);
}

function finish(name: string, gravity: number, bodies: MockBody[], meshes: Mesh[], statics: Static[], worlds: number, edge: number): MockScene {
  const low = [0, 1, 2].map((c) => Math.min(...bodies.map((b) => b.start[c]! - b.half)));
  const high = [0, 1, 2].map((c) => Math.max(...bodies.map((b) => b.start[c]! + b.half)));
  const origin = low.map((x) => Math.floor(x / edge) * edge);
  const size = high.map((x, c) => Math.max(1, Math.ceil((x - origin[c]!) / edge)));
  const owners = new Uint16Array(size[0]! * size[1]! * size[2]!);
  bisect(origin, edge, size, [0, 0, 0], size, bodies.map((b) => b.start), 0, worlds, owners);
  const grid = create(GridSchema, { origin, edge, size, owner: bytesOf(owners) });
  return { name, gravity, bodies, meshes, statics, low, high, grid, territories: new Territories(grid) };
}

// Cuts the cells from `from` to `to` across their longest side such that each part has its share of the places.
function bisect(origin: number[], edge: number, size: number[], from: number[], to: number[], places: number[][], first: number, worlds: number, owners: Uint16Array): void {
  if (worlds === 1) {
    for (let z = from[2]!; z < to[2]!; z++)
      for (let y = from[1]!; y < to[1]!; y++)
        for (let x = from[0]!; x < to[0]!; x++) owners[x + size[0]! * (y + size[1]! * z)] = first;
    return;
  }
  const spans = to.map((t, c) => t - from[c]!);
  const axis = spans.indexOf(Math.max(...spans));
  const left = worlds >> 1;
  const cells = places.map((p) => Math.floor((p[axis]! - origin[axis]!) / edge)).sort((a, b) => a - b);
  const cut = Math.min(to[axis]! - 1, Math.max(from[axis]! + 1, cells[Math.floor((cells.length * left) / worlds)] ?? from[axis]! + 1));
  const parts = (lower: boolean) => places.filter((p) => lower === Math.floor((p[axis]! - origin[axis]!) / edge) < cut);
  const middle = (base: number[]) => base.map((b, c) => (c === axis ? cut : b));
  bisect(origin, edge, size, from, middle(to), parts(true), first, left, owners);
  bisect(origin, edge, size, middle(from), to, parts(false), first + left, worlds - left, owners);
}
