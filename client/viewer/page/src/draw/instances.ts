// The bodies in the scene: for each shape one instanced draw call with as many places as there are bodies of it, more
// when some are spawned. A body that vanishes leaves its place to the last one.
import {
  DynamicDrawUsage,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  InstancedInterleavedBuffer,
  InterleavedBufferAttribute,
  BufferAttribute,
  Mesh,
  type Material,
  type Scene,
} from 'three';
import { bodyDepthMaterial, bodyMaterial } from './body_material';
import { sphere, type Shape, type Shapes } from './shapes';
import type { Bodies } from '../model/bodies';

const stride = 8; // floats of a moving body: place, time of flash, rotation
const never = -1000; // s, when a body flashed that did not
const manySpheres = 3000;

class Group {
  readonly mesh: Mesh<InstancedBufferGeometry, Material>;
  count = 0;
  capacity = 0;
  bodies = new Uint32Array(0);
  motion = new Float32Array(0);
  size = new Float32Array(0);
  tint = new Uint8Array(0);
  private material: Material;
  private motionBuffer!: InstancedInterleavedBuffer;
  private sizeBuffer!: InstancedBufferAttribute;
  private tintBuffer!: InstancedBufferAttribute;
  private low = Infinity; // slots whose motion is to be uploaded
  private high = -1;
  private tintLow = Infinity;
  private tintHigh = -1;

  constructor(private readonly shape: Shape, fine: boolean, depth: Material) {
    this.material = bodyMaterial(shape.kind, fine);
    this.mesh = new Mesh(new InstancedBufferGeometry(), this.material);
    this.mesh.customDepthMaterial = depth;
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.mesh.frustumCulled = false; // its geometry does not know where the bodies are
    this.reserve(16);
  }

  reserve(capacity: number): void {
    if (capacity <= this.capacity) return;
    const grow = <T extends Float32Array | Uint8Array | Uint32Array>(old: T, width: number): T => {
      const larger = new (old.constructor as new (n: number) => T)(width * capacity);
      larger.set(old);
      return larger;
    };
    this.capacity = capacity;
    this.bodies = grow(this.bodies, 1);
    this.motion = grow(this.motion, stride);
    this.size = grow(this.size, 3);
    this.tint = grow(this.tint, 4);

    // Buffers on the GPU cannot grow: a new geometry takes the old one's place.
    const drawn =
      this.shape.kind === 'round' ? sphere(1, capacity > manySpheres ? 0 : 2) : this.shape;
    const geometry = new InstancedBufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(drawn.positions, 3));
    geometry.setAttribute('normal', new BufferAttribute(drawn.normals, 3));
    geometry.setIndex(new BufferAttribute(drawn.indices, 1));
    this.motionBuffer = new InstancedInterleavedBuffer(this.motion, stride).setUsage(DynamicDrawUsage) as InstancedInterleavedBuffer;
    this.sizeBuffer = new InstancedBufferAttribute(this.size, 3);
    this.tintBuffer = new InstancedBufferAttribute(this.tint, 4, true);
    this.tintBuffer.setUsage(DynamicDrawUsage);
    geometry.setAttribute('iPlace', new InterleavedBufferAttribute(this.motionBuffer, 4, 0));
    geometry.setAttribute('iTurn', new InterleavedBufferAttribute(this.motionBuffer, 4, 4));
    geometry.setAttribute('iSize', this.sizeBuffer);
    geometry.setAttribute('iTint', this.tintBuffer);
    geometry.instanceCount = this.count;
    this.mesh.geometry.dispose();
    this.mesh.geometry = geometry;
  }

  touch(slot: number): void {
    if (slot < this.low) this.low = slot;
    if (slot > this.high) this.high = slot;
  }

  touchTint(slot: number): void {
    if (slot < this.tintLow) this.tintLow = slot;
    if (slot > this.tintHigh) this.tintHigh = slot;
  }

  touchSize(): void {
    this.sizeBuffer.needsUpdate = true;
  }

  // Tells the GPU what has changed since the picture before: one range, which is cheaper than many small ones.
  upload(): void {
    if (this.high >= this.low) {
      this.motionBuffer.addUpdateRange(this.low * stride, (this.high - this.low + 1) * stride);
      this.motionBuffer.needsUpdate = true;
    }
    if (this.tintHigh >= this.tintLow) {
      this.tintBuffer.addUpdateRange(4 * this.tintLow, 4 * (this.tintHigh - this.tintLow + 1));
      this.tintBuffer.needsUpdate = true;
    }
    this.low = this.tintLow = Infinity;
    this.high = this.tintHigh = -1;
    this.mesh.geometry.instanceCount = this.count;
    this.mesh.visible = this.count > 0;
  }

  depthOnly(on: boolean, depth: Material): void {
    this.mesh.material = on ? depth : this.material;
    this.mesh.visible = this.count > 0;
  }

  setFine(fine: boolean): void {
    this.material.dispose();
    this.mesh.material = this.material = bodyMaterial(this.shape.kind, fine);
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.material.dispose();
  }
}

export class Instances {
  private groups: Group[] = [];
  private groupOf = new Uint32Array(0); // of each body
  private slotOf = new Uint32Array(0);
  private depth = bodyDepthMaterial(); // for shadows; three.js turns its sides round
  private plain = bodyDepthMaterial(); // for Occlusion
  private fine = true;
  drawn = 0;

  constructor(
    private readonly scene: Scene,
    private readonly bodies: Bodies,
    private readonly shapes: Shapes,
    private readonly colourOf: (body: number) => number, // 0xAARRGGBB, alpha: how much it shines
  ) {}

  clear(): void {
    for (const group of this.groups) {
      if (!group) continue;
      this.scene.remove(group.mesh);
      group.dispose();
    }
    this.groups = [];
    this.drawn = 0;
  }

  setFine(fine: boolean): void {
    if (fine === this.fine) return;
    this.fine = fine;
    for (const group of this.groups) group?.setFine(fine);
  }

  appeared(body: number): void {
    const form = this.shapes.form(this.bodies.mesh[body]!);
    const group = (this.groups[form.shape] ??= this.newGroup(form.shape));
    if (this.groupOf.length < this.bodies.mesh.length) {
      const larger = this.bodies.mesh.length;
      const groupOf = new Uint32Array(larger);
      groupOf.set(this.groupOf);
      const slotOf = new Uint32Array(larger);
      slotOf.set(this.slotOf);
      this.groupOf = groupOf;
      this.slotOf = slotOf;
    }
    if (group.count === group.capacity) group.reserve(2 * group.capacity);
    const slot = group.count++;
    group.bodies[slot] = body;
    this.groupOf[body] = form.shape;
    this.slotOf[body] = slot;
    group.size.set(form.size, 3 * slot);
    group.motion[slot * stride + 3] = never;
    group.touchSize();
    this.place(body);
    this.tint(body);
    this.drawn++;
  }

  vanished(body: number): void {
    const group = this.groups[this.groupOf[body]!]!;
    const slot = this.slotOf[body]!;
    const last = --group.count;
    if (slot !== last) {
      const moved = group.bodies[last]!;
      group.bodies[slot] = moved;
      this.slotOf[moved] = slot;
      group.motion.copyWithin(slot * stride, last * stride, (last + 1) * stride);
      group.size.copyWithin(3 * slot, 3 * last, 3 * last + 3);
      group.tint.copyWithin(4 * slot, 4 * last, 4 * last + 4);
      group.touch(slot);
      group.touchTint(slot);
      group.touchSize();
    }
    this.drawn--;
  }

  moved(list: Uint32Array): void {
    for (const body of list) if (this.bodies.present[body]) this.place(body);
  }

  recolour(list: Uint32Array): void {
    for (const body of list) if (this.bodies.present[body]) this.tint(body);
  }

  recolourAll(): void {
    for (let body = 0; body < this.bodies.count; body++) if (this.bodies.present[body]) this.tint(body);
  }

  flash(body: number, time: number): void {
    const slot = this.slotOf[body]!;
    const group = this.groups[this.groupOf[body]!]!;
    group.motion[slot * stride + 3] = time;
    group.touch(slot);
  }

  upload(): void {
    for (const group of this.groups) group?.upload();
  }

  // For Occlusion: drawn with a material that writes depth only.
  depthOnly(on: boolean): void {
    for (const group of this.groups) group?.depthOnly(on, this.plain);
  }

  private place(body: number): void {
    const { pos, rot } = this.bodies;
    const group = this.groups[this.groupOf[body]!]!;
    const slot = this.slotOf[body]!;
    const motion = group.motion;
    const m = slot * stride;
    const p = 3 * body;
    const q = 4 * body;
    motion[m] = pos[p]!;
    motion[m + 1] = pos[p + 1]!;
    motion[m + 2] = pos[p + 2]!;
    motion[m + 4] = rot[q]!;
    motion[m + 5] = rot[q + 1]!;
    motion[m + 6] = rot[q + 2]!;
    motion[m + 7] = rot[q + 3]!;
    group.touch(slot);
  }

  private tint(body: number): void {
    const group = this.groups[this.groupOf[body]!]!;
    const slot = this.slotOf[body]!;
    const colour = this.colourOf(body);
    const t = 4 * slot;
    group.tint[t] = colour >> 16;
    group.tint[t + 1] = colour >> 8;
    group.tint[t + 2] = colour;
    group.tint[t + 3] = colour >>> 24;
    group.touchTint(slot);
  }

  private newGroup(shape: number): Group {
    const group = new Group(this.shapes.shapes[shape]!, this.fine, this.depth);
    this.scene.add(group.mesh);
    return group;
  }
}
