// What the page knows of the bodies, by their index (BodyList): structures of arrays, because some thousands of them are
// gone through at each picture. `pos` and `rot` are what is displayed; `from` and `to` are the frames around it.
import type { BodyList } from '../gen/viewer_pb';

function grown<T extends Float32Array | Uint32Array | Uint16Array | Uint8Array | Float64Array>(old: T, size: number): T {
  const larger = new (old.constructor as new (n: number) => T)(size);
  larger.set(old);
  return larger;
}

export class Bodies {
  count = 0;
  ids: bigint[] = [];
  mesh = new Uint32Array(0);
  colour = new Uint32Array(0); // 0xRRGGBBAA
  mass = new Float64Array(0);
  present = new Uint8Array(0); // is in the scene at the step that is displayed
  pos = new Float32Array(0); // x, y, z of each
  rot = new Float32Array(0); // x, y, z, w of each
  fromPos = new Float32Array(0);
  fromRot = new Float32Array(0);
  toPos = new Float32Array(0);
  toRot = new Float32Array(0);
  speed = new Float32Array(0); // m/s
  world = new Uint16Array(0);
  flags = new Uint8Array(0); // FrameFlag
  oneColour = true; // all bodies have the same: it says nothing
  private byId = new Map<bigint, number>();

  add(list: BodyList): void {
    const end = list.first + list.id.length;
    if (end > this.mesh.length) this.reserve(Math.max(end, Math.ceil(this.mesh.length * 1.5), 256));
    for (let k = 0; k < list.id.length; k++) {
      const i = list.first + k;
      this.ids[i] = list.id[k]!;
      this.byId.set(list.id[k]!, i);
      this.mesh[i] = list.mesh[k] ?? 0;
      this.colour[i] = list.colour[k] ?? 0;
      this.mass[i] = list.mass[k] ?? 0;
      if (i > 0 && this.colour[i] !== this.colour[0]) this.oneColour = false;
    }
    this.count = Math.max(this.count, end);
  }

  clear(): void {
    this.count = 0;
    this.ids = [];
    this.byId.clear();
    this.present.fill(0);
    this.flags.fill(0);
    this.oneColour = true;
  }

  indexOf(id: bigint): number | undefined {
    return this.byId.get(id);
  }

  private reserve(size: number): void {
    this.mesh = grown(this.mesh, size);
    this.colour = grown(this.colour, size);
    this.mass = grown(this.mass, size);
    this.present = grown(this.present, size);
    this.pos = grown(this.pos, 3 * size);
    this.rot = grown(this.rot, 4 * size);
    this.fromPos = grown(this.fromPos, 3 * size);
    this.fromRot = grown(this.fromRot, 4 * size);
    this.toPos = grown(this.toPos, 3 * size);
    this.toRot = grown(this.toRot, 4 * size);
    this.speed = grown(this.speed, size);
    this.world = grown(this.world, size);
    this.flags = grown(this.flags, size);
  }
}
