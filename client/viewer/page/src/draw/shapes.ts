// Meshes as they are drawn. A scene with boxes of a thousand sizes has a thousand meshes, and a thousand draw calls
// would be slow; but they are one shape, stretched. So meshes are brought to half extents of 1, those that are then equal
// share a shape, and each body has a size.
import { SphereGeometry } from 'three';
import type { Mesh } from '../gen/viewer_pb';

export type ShapeKind = 'box' | 'round' | 'other';

export interface Shape {
  kind: ShapeKind;
  positions: Float32Array;
  normals: Float32Array;
  indices: Uint32Array;
}

// A mesh of Welcome: a shape and how large it is along its axes.
export interface Form {
  shape: number;
  size: readonly [number, number, number];
  radius: number;
}

const copied = (bytes: Uint8Array) => bytes.slice().buffer as ArrayBuffer;

export class Shapes {
  readonly shapes: Shape[] = [];
  readonly forms: Form[] = [];
  private known = new Map<string, number>();

  add(mesh: Mesh): void {
    const like = mesh.like === undefined ? undefined : this.forms[mesh.like];
    if (like) {
      const size = like.size.map((s, c) => s * (mesh.stretch[c] ?? 1)) as [number, number, number];
      this.forms.push({ shape: like.shape, size, radius: mesh.radius });
      return;
    }
    const positions = new Float32Array(copied(mesh.positions));
    const normals = new Float32Array(copied(mesh.normals));
    const indices = new Uint32Array(copied(mesh.indices));
    this.forms.push(this.fit(positions, normals, indices, mesh.radius));
  }

  clear(): void {
    this.shapes.length = this.forms.length = 0;
    this.known.clear();
    this.standIn = null;
  }

  // Of a mesh that the page was not told of: something that can be seen rather than nothing.
  form(mesh: number): Form {
    const found = this.forms[mesh];
    if (found) return found;
    if (!this.standIn) {
      const { positions, normals, indices } = sphere(0.25, 1);
      this.standIn = this.fit(positions, normals, indices, 0.25);
    }
    return this.standIn;
  }

  private standIn: Form | null = null;

  private fit(positions: Float32Array, normals: Float32Array, indices: Uint32Array, radius: number): Form {
    const size: [number, number, number] = [0, 0, 0];
    for (let k = 0; k < positions.length; k++) size[k % 3] = Math.max(size[k % 3]!, Math.abs(positions[k]!));
    for (let c = 0; c < 3; c++) if (!(size[c]! > 0)) size[c] = 1;
    for (let k = 0; k < positions.length; k += 3) {
      let norm = 0;
      for (let c = 0; c < 3; c++) {
        positions[k + c]! /= size[c]!;
        normals[k + c]! *= size[c]!; // the inverse of how stretching changes normals
        norm += normals[k + c]! ** 2;
      }
      norm = Math.sqrt(norm) || 1;
      for (let c = 0; c < 3; c++) normals[k + c]! /= norm;
    }
    const key = keyOf(positions, indices);
    let shape = this.known.get(key);
    if (shape === undefined) {
      shape = this.shapes.length;
      this.shapes.push({ kind: kindOf(positions), positions, normals, indices });
      this.known.set(key, shape);
    }
    return { shape, size, radius: radius > 0 ? radius : Math.hypot(...size) };
  }
}

// Two hashes (FNV-1a with different primes) over the rounded numbers: equal keys are equal shapes.
function keyOf(positions: Float32Array, indices: Uint32Array): string {
  let h = 0x811c9dc5;
  let g = 0x9747b28c;
  const mix = (value: number) => {
    h = Math.imul(h ^ value, 0x01000193);
    g = Math.imul(g ^ value, 0x85ebca6b);
    g ^= g >>> 15;
  };
  for (const p of positions) mix(Math.round(p * 2048));
  for (const i of indices) mix(i);
  return `${positions.length}/${indices.length}/${h >>> 0}/${g >>> 0}`;
}

function kindOf(positions: Float32Array): ShapeKind {
  let box = positions.length >= 24;
  let round = positions.length >= 60;
  for (let k = 0; k < positions.length && (box || round); k += 3) {
    const [x, y, z] = [positions[k]!, positions[k + 1]!, positions[k + 2]!];
    if (Math.min(Math.abs(x), Math.abs(y), Math.abs(z)) < 0.999) box = false;
    if (Math.abs(x * x + y * y + z * z - 1) > 0.01) round = false;
  }
  return box ? 'box' : round ? 'round' : 'other';
}

// A sphere with as many triangles as `detail` says, 0 to 2. Thousands of spheres need not be finer.
export function sphere(radius: number, detail: number): Omit<Shape, 'kind'> {
  const made = new SphereGeometry(radius, 14 + 6 * detail, 9 + 4 * detail);
  const positions = made.attributes.position!.array as Float32Array;
  const normals = made.attributes.normal!.array as Float32Array;
  const indices = Uint32Array.from(made.index!.array);
  made.dispose();
  return { positions, normals, indices };
}
