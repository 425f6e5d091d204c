// The worlds' territories: translucent walls where owners of neighbouring cells differ, each side in its owner's colour,
// and their outlines.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  FrontSide,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  type Scene,
} from 'three';
import type { BorderFace, Grid } from '../model/grid';
import { worldColour } from './colours';

export class Territory {
  private readonly group = new Group();
  private readonly walls = new MeshBasicMaterial({
    vertexColors: true,
    transparent: true,
    opacity: 0.16,
    side: FrontSide,
    depthWrite: false,
    fog: true,
    toneMapped: false,
  });
  private readonly lines = new LineBasicMaterial({ vertexColors: true, transparent: true, opacity: 0.75, depthWrite: false, toneMapped: false });

  constructor(scene: Scene) {
    this.group.visible = false;
    scene.add(this.group);
  }

  show(on: boolean): void {
    this.group.visible = on;
  }

  build(grid: Grid): void {
    this.clear();
    const faces = grid.faces();
    if (faces.length === 0) return;
    const positions: number[] = [];
    const colours: number[] = [];
    const edges: number[] = [];
    const edgeColours: number[] = [];
    const apart = 0.004 * grid.edge;
    for (const face of faces) {
      // The wall of the lower side looks up the axis and stands a little below, and the other way round.
      wall(positions, colours, face, face.at - apart, true, worldColour(face.below));
      wall(positions, colours, face, face.at + apart, false, worldColour(face.above));
      outline(edges, edgeColours, face);
    }
    this.group.add(new Mesh(geometryOf(positions, colours), this.walls));
    this.group.add(new LineSegments(geometryOf(edges, edgeColours), this.lines));
    for (const child of this.group.children) child.renderOrder = 5;
  }

  clear(): void {
    for (const child of [...this.group.children]) {
      (child as Mesh).geometry.dispose();
      this.group.remove(child);
    }
  }
}

function geometryOf(positions: number[], colours: number[]): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(positions), 3));
  geometry.setAttribute('color', new BufferAttribute(new Float32Array(colours), 3));
  return geometry;
}

// A point of the face, by its place along the axis and along the two others.
function point(face: BorderFace, at: number, a: number, b: number): [number, number, number] {
  return face.axis === 0 ? [at, a, b] : face.axis === 1 ? [a, at, b] : [a, b, at];
}

const shade = new Color();

function push(colours: number[], rgb: number, times: number): void {
  shade.set(rgb);
  for (let k = 0; k < times; k++) colours.push(shade.r, shade.g, shade.b);
}

function wall(positions: number[], colours: number[], face: BorderFace, at: number, facingUp: boolean, rgb: number): void {
  const corners = [
    point(face, at, face.low[0], face.low[1]),
    point(face, at, face.high[0], face.low[1]),
    point(face, at, face.high[0], face.high[1]),
    point(face, at, face.low[0], face.high[1]),
  ] as const;
  // (x, z) seen along y is left-handed, the two other pairs are not.
  const forward = facingUp === (face.axis !== 1);
  for (const k of forward ? [0, 1, 2, 0, 2, 3] : [0, 2, 1, 0, 3, 2]) positions.push(...corners[k]!);
  push(colours, rgb, 6);
}

function outline(edges: number[], colours: number[], face: BorderFace): void {
  const { low, high, at } = face;
  const corners = [
    point(face, at, low[0], low[1]),
    point(face, at, high[0], low[1]),
    point(face, at, high[0], high[1]),
    point(face, at, low[0], high[1]),
  ] as const;
  for (let k = 0; k < 4; k++) edges.push(...corners[k]!, ...corners[(k + 1) % 4]!);
  push(colours, worldColour(face.below), 4);
  push(colours, worldColour(face.above), 4);
}
