// What is under the pointer: the nearest body or static that a ray hits. Spheres around the bodies first, for all; then
// the triangles of those few whose sphere is hit.
import { Quaternion, Ray, Raycaster, Vector3 } from 'three';
import type { Bodies } from '../model/bodies';
import type { Shapes } from './shapes';
import type { Statics } from './statics';

export interface Hit {
  body: number; // -1: a static
  point: Vector3; // world
  normal: Vector3; // world, outward
  distance: number;
}

export class Picker {
  private local = new Ray();
  private turn = new Quaternion();
  private centre = new Vector3();
  private caster = new Raycaster();

  constructor(
    private readonly bodies: Bodies,
    private readonly shapes: Shapes,
    private readonly statics: Statics,
  ) {}

  pick(ray: Ray, withStatics = true): Hit | null {
    const body = this.pickBody(ray);
    const ground = withStatics ? this.pickStatic(ray) : null;
    if (!body || (ground && ground.distance < body.distance)) return ground;
    return body;
  }

  private pickBody(ray: Ray): Hit | null {
    const { pos, present, count, mesh } = this.bodies;
    const { origin: o, direction: d } = ray;
    const candidates: { body: number; enter: number }[] = [];
    for (let i = 0; i < count; i++) {
      if (!present[i]) continue;
      const x = pos[3 * i]! - o.x;
      const y = pos[3 * i + 1]! - o.y;
      const z = pos[3 * i + 2]! - o.z;
      const along = x * d.x + y * d.y + z * d.z;
      const radius = this.shapes.form(mesh[i]!).radius;
      if (along < -radius) continue;
      const off = x * x + y * y + z * z - along * along;
      if (off < radius * radius) candidates.push({ body: i, enter: along - Math.sqrt(radius * radius - off) });
    }
    candidates.sort((a, b) => a.enter - b.enter);
    let best: Hit | null = null;
    for (const { body, enter } of candidates) {
      if (best && enter > best.distance) break;
      const hit = this.triangles(ray, body);
      if (hit && (!best || hit.distance < best.distance)) best = hit;
    }
    return best;
  }

  // In the body's axes, where its mesh is.
  private triangles(ray: Ray, body: number): Hit | null {
    const form = this.shapes.form(this.bodies.mesh[body]!);
    const shape = this.shapes.shapes[form.shape]!;
    const [sx, sy, sz] = form.size;
    this.turn.fromArray(this.bodies.rot, 4 * body);
    this.centre.fromArray(this.bodies.pos, 3 * body);
    const inverse = this.turn.clone().invert();
    this.local.origin.copy(ray.origin).sub(this.centre).applyQuaternion(inverse);
    this.local.direction.copy(ray.direction).applyQuaternion(inverse);
    const { positions: p, indices } = shape;
    const corner = [new Vector3(), new Vector3(), new Vector3()] as const;
    const at = new Vector3();
    let nearest = Infinity;
    const normal = new Vector3();
    for (let t = 0; t < indices.length; t += 3) {
      for (let c = 0; c < 3; c++) {
        const v = 3 * indices[t + c]!;
        corner[c]!.set(p[v]! * sx, p[v + 1]! * sy, p[v + 2]! * sz);
      }
      if (!this.local.intersectTriangle(corner[0], corner[1], corner[2], true, at)) continue;
      const distance = at.distanceTo(this.local.origin);
      if (distance >= nearest) continue;
      nearest = distance;
      normal.subVectors(corner[1], corner[0]).cross(corner[2].sub(corner[0])).normalize();
    }
    if (nearest === Infinity) return null;
    return {
      body,
      point: ray.at(nearest, new Vector3()),
      normal: normal.clone().applyQuaternion(this.turn),
      distance: nearest,
    };
  }

  private pickStatic(ray: Ray): Hit | null {
    this.caster.ray.copy(ray);
    const seen = this.statics.pieces.filter((piece) => piece.mesh.visible).map((piece) => piece.mesh);
    const found = this.caster.intersectObjects(seen, false)[0];
    if (!found) return null;
    const normal = found.face ? found.face.normal.clone().transformDirection(found.object.matrixWorld) : new Vector3(0, 0, 1);
    if (normal.dot(ray.direction) > 0) normal.negate();
    return { body: -1, point: found.point, normal, distance: found.distance };
  }
}
