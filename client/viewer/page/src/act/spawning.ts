// The body that the user adds: a message as in a scene file (idl/scene.proto), whose mass is that of water for its size.
import { create } from '@bufbuild/protobuf';
import { Vector3 } from 'three';
import { SpawnSchema, type Spawn } from '../gen/action_pb';
import { BodySchema, PoseSchema, ShapeSchema, Vec3Schema } from '../gen/scene_pb';
import { hashColour } from '../draw/colours';
import type { SpawnShape } from '../settings';

export const vec3 = (v: Vector3) => create(Vec3Schema, { x: v.x, y: v.y, z: v.z });

// How far its centre is from what it lies on.
export const halfHeight = (shape: SpawnShape, size: number) => (shape === 'capsule' ? size : 0.5 * size);

let counter = 0n;

// `size`: edge of the box, diameter of the sphere, of the capsule half its length.
export function spawnOf(shape: SpawnShape, size: number, at: Vector3): Spawn {
  const kind = {
    box: { case: 'box', value: { size: { x: size, y: size, z: size } } },
    sphere: { case: 'sphere', value: { radius: 0.5 * size } },
    capsule: { case: 'capsule', value: { radius: 0.5 * size, length: size } },
  } as const;
  return create(SpawnSchema, {
    body: create(BodySchema, {
      name: 'from the viewer',
      pose: create(PoseSchema, { position: vec3(at) }),
      shape: [create(ShapeSchema, { kind: kind[shape] as never })],
      colour: ((hashColour(0x517n + counter++) << 8) | 0xff) >>> 0,
    }),
  });
}
