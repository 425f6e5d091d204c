// What does not move: floors, walls, obstacles. Floors have lines every metre and every ten, so that sizes and movement
// are seen; with borders on, the ground has the colour of who owns it. Walls between the camera and the bodies are left
// out, so that one looks into a closed room.
import {
  Box3,
  BufferAttribute,
  BufferGeometry,
  Color,
  Data3DTexture,
  DoubleSide,
  Mesh,
  MeshLambertMaterial,
  NearestFilter,
  RGBAFormat,
  UnsignedByteType,
  Vector3,
  MeshBasicMaterial,
  type Object3D,
  type Scene,
} from 'three';
import type { Mesh as MeshMessage, Static } from '../gen/viewer_pb';
import type { Grid } from '../model/grid';
import { worldColour } from './colours';
import { dimByOcclusion } from './occlusion_uniforms';

const largestTexture = 8 << 20; // cells; beyond, the ground has no tint

interface Piece {
  mesh: Mesh<BufferGeometry, MeshLambertMaterial>;
  box: Box3;
  material: MeshLambertMaterial;
}

const plain = new MeshBasicMaterial({ colorWrite: false, side: DoubleSide });

export class Statics {
  readonly pieces: Piece[] = [];
  private room = new Box3();
  private owners: Data3DTexture | null = null;
  private uniforms = {
    uUp: { value: new Vector3(0, 0, 1) },
    uLines: { value: new Color(0x000000) },
    uGrid: { value: 0.2 },
    uTint: { value: 0 },
    uOwners: { value: null as Data3DTexture | null },
    uOrigin: { value: new Vector3() },
    uExtent: { value: new Vector3(1, 1, 1) },
    uCell: { value: 1 },
  };

  constructor(private readonly scene: Scene) {}

  // `meshes` are those of Welcome; `low`, `high`: the box of the bodies.
  build(list: Static[], meshes: MeshMessage[], low: Vector3, high: Vector3, up: Vector3, grid: Grid): void {
    this.clear();
    this.room.set(low, high);
    this.uniforms.uUp.value.copy(up);
    this.setOwners(grid);
    for (const item of list) {
      const told = meshes[item.mesh];
      const source = told?.like === undefined ? told : meshes[told.like];
      if (!told || !source) continue;
      const geometry = new BufferGeometry();
      geometry.setAttribute('position', new BufferAttribute(floats(source.positions), 3));
      geometry.setAttribute('normal', new BufferAttribute(floats(source.normals), 3));
      geometry.setIndex(new BufferAttribute(new Uint32Array(source.indices.slice().buffer as ArrayBuffer), 1));
      if (source !== told) geometry.scale(told.stretch[0] ?? 1, told.stretch[1] ?? 1, told.stretch[2] ?? 1);
      const mesh = new Mesh(geometry, this.material(item.colour));
      const [x, y, z] = item.position;
      const [i, j, k, w] = item.orientation;
      mesh.position.set(x ?? 0, y ?? 0, z ?? 0);
      mesh.quaternion.set(i ?? 0, j ?? 0, k ?? 0, w ?? 1).normalize();
      mesh.updateMatrixWorld();
      mesh.receiveShadow = true;
      const box = new Box3().setFromObject(mesh);
      // Ceilings and walls around the bodies would leave them in the dark.
      mesh.castShadow = sidesOf(box, this.room).length === 0;
      this.scene.add(mesh);
      this.pieces.push({ mesh, box, material: mesh.material });
    }
  }

  // Triangles of all of them.
  triangles(): number {
    return this.pieces.reduce((sum, { mesh }) => sum + (mesh.geometry.index?.count ?? 0) / 3, 0);
  }

  clear(): void {
    for (const { mesh } of this.pieces) {
      this.scene.remove(mesh);
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
    this.pieces.length = 0;
    this.owners?.dispose();
    this.owners = null;
  }

  look(lines: Color, strength: number, tint: number): void {
    this.uniforms.uLines.value.copy(lines);
    this.uniforms.uGrid.value = strength;
    this.uniforms.uTint.value = this.owners ? tint : 0;
  }

  // Leaves out what stands between the camera and the bodies.
  cutAway(camera: Vector3, on: boolean): void {
    for (const { mesh, box } of this.pieces)
      mesh.visible =
        !on ||
        !sidesOf(box, this.room).some(({ axis, upper }) => {
          const at = camera.getComponent(axis);
          return upper ? at > box.min.getComponent(axis) : at < box.max.getComponent(axis);
        });
  }

  // For Occlusion: whether they are drawn with a material that writes depth only. `seen` are those that are drawn.
  depthOnly(on: boolean, seen: Object3D[]): void {
    for (const piece of this.pieces) {
      piece.mesh.material = on ? (plain as unknown as MeshLambertMaterial) : piece.material;
      piece.mesh.visible = seen.includes(piece.mesh);
    }
  }

  private setOwners(grid: Grid): void {
    const [nx, ny, nz] = grid.size;
    const cells = nx * ny * nz;
    this.uniforms.uOrigin.value.set(...(grid.origin as [number, number, number]));
    this.uniforms.uExtent.value.set(nx || 1, ny || 1, nz || 1).multiplyScalar(grid.edge);
    this.uniforms.uCell.value = grid.edge;
    if (cells === 0 || cells > largestTexture || Math.max(nx, ny, nz) > 2048) {
      this.uniforms.uOwners.value = null;
      return;
    }
    const texture = new Data3DTexture(new Uint8Array(4 * cells), nx, ny, nz);
    texture.format = RGBAFormat;
    texture.type = UnsignedByteType;
    texture.minFilter = texture.magFilter = NearestFilter;
    this.owners = texture;
    this.uniforms.uOwners.value = texture;
    this.paint(grid);
  }

  // The ground in the colours of the grid's owners: the grid of build(), when they have changed.
  paint(grid: Grid): void {
    if (!this.owners) return;
    const data = this.owners.image.data as Uint8Array;
    for (let c = 0; 4 * c < data.length; c++) {
      const colour = worldColour(grid.owner[c]!);
      data[4 * c] = colour >> 16;
      data[4 * c + 1] = (colour >> 8) & 255;
      data[4 * c + 2] = colour & 255;
      data[4 * c + 3] = 255;
    }
    this.owners.needsUpdate = true;
  }

  private material(rgba: number): MeshLambertMaterial {
    // Planes and height fields are sheets, so both sides are drawn.
    const material = new MeshLambertMaterial({ side: DoubleSide });
    material.color.set((rgba >>> 8) & 0xffffff);
    const tinted = this.owners !== null;
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, this.uniforms);
      dimByOcclusion(shader);
      shader.vertexShader = shader.vertexShader
        .replace('#include <common>', '#include <common>\nvarying vec3 vPlace;\nvarying vec3 vFacing;')
        .replace(
          '#include <begin_vertex>',
          `#include <begin_vertex>
           vPlace = (modelMatrix * vec4(position, 1.0)).xyz;
           vFacing = mat3(modelMatrix) * normal;`,
        );
      shader.fragmentShader = shader.fragmentShader
        .replace('#include <common>', `#include <common>\n${tinted ? '#define TINTED\n' : ''}${fragmentHead}`)
        .replace('#include <color_fragment>', fragmentBody);
    };
    material.customProgramCacheKey = () => `static-${tinted}`;
    return material;
  }
}

const fragmentHead = /* glsl */ `
varying vec3 vPlace;
varying vec3 vFacing;
uniform vec3 uUp;
uniform vec3 uLines;
uniform float uGrid;
uniform float uTint;
uniform vec3 uOrigin;
uniform vec3 uExtent;
uniform float uCell;
#ifdef TINTED
uniform mediump sampler3D uOwners;
#endif
// How much of a pixel lines of that distance cover; where they come closer than pixels, none.
float linesOf(vec2 place, float apart, float width) {
  vec2 p = place / apart;
  vec2 pixel = fwidth(p);
  vec2 off = abs(fract(p - 0.5) - 0.5);
  vec2 half_width = max(vec2(0.5 * width / apart), 0.5 * pixel);
  vec2 line = 1.0 - smoothstep(half_width, half_width + pixel, off);
  line *= 1.0 - smoothstep(0.05, 0.22, pixel);
  return max(line.x, line.y);
}
`;

const fragmentBody = /* glsl */ `
vec3 facing = normalize(vFacing);
float level = abs(dot(facing, uUp));
// The two axes that lie in the surface.
vec3 along = abs(facing);
vec2 place = along.x > max(along.y, along.z) ? vPlace.yz : along.y > along.z ? vPlace.xz : vPlace.xy;
#ifdef TINTED
// Ground lies just on the bottom of a cell: look a little above it. Beyond the grid, the nearest cell counts.
vec3 cell = clamp((vPlace + facing * 0.02 * uCell - uOrigin) / uExtent, 0.0005, 0.9995);
vec3 owner = pow(texture(uOwners, cell).rgb, vec3(2.2));
diffuseColor.rgb = mix(diffuseColor.rgb, owner * (0.25 + 0.75 * max(diffuseColor.r, max(diffuseColor.g, diffuseColor.b))), uTint);
#endif
float fine = linesOf(place, 1.0, 0.012);
float coarse = linesOf(place, 10.0, 0.05);
diffuseColor.rgb = mix(diffuseColor.rgb, uLines, uGrid * step(0.7, max(level, max(along.x, max(along.y, along.z)))) * max(0.45 * fine, coarse));
`;

const floats = (bytes: Uint8Array) => new Float32Array(bytes.slice().buffer as ArrayBuffer);

// On which sides of `room` a box lies wholly, give or take a little.
function sidesOf(box: Box3, room: Box3): { axis: 0 | 1 | 2; upper: boolean }[] {
  const found: { axis: 0 | 1 | 2; upper: boolean }[] = [];
  for (const axis of [0, 1, 2] as const) {
    const low = room.min.getComponent(axis);
    const high = room.max.getComponent(axis);
    const slack = 0.02 * (high - low) + 0.1;
    if (box.min.getComponent(axis) >= high - slack) found.push({ axis, upper: true });
    if (box.max.getComponent(axis) <= low + slack) found.push({ axis, upper: false });
  }
  return found;
}
