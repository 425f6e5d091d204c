// What is drawn over the scene for the user's sake: the outline of the selected body, the spring of a grab.
import {
  BackSide,
  BufferAttribute,
  BufferGeometry,
  Color,
  CylinderGeometry,
  Mesh,
  MeshBasicMaterial,
  Quaternion,
  ShaderMaterial,
  SphereGeometry,
  Vector3,
  type PerspectiveCamera,
  type Scene,
} from 'three';
import type { Bodies } from '../model/bodies';
import type { Shapes } from './shapes';

export class Marks {
  selected = -1;
  hovered = -1;
  private outlines: [Outline, Outline];
  private rod: Mesh;
  private ball: Mesh;
  private spring: { body: number; point: Vector3; target: Vector3 } | null = null;

  constructor(
    scene: Scene,
    private readonly camera: PerspectiveCamera,
    private readonly bodies: Bodies,
    private readonly shapes: Shapes,
  ) {
    this.outlines = [new Outline(scene, 0x4cb4ff, 2.6), new Outline(scene, 0xbfd6ee, 1.4)];
    const material = new MeshBasicMaterial({ color: 0xffb02e, toneMapped: false, fog: false, depthTest: false, transparent: true });
    this.rod = new Mesh(new CylinderGeometry(1, 1, 1, 8, 1, true), material);
    this.ball = new Mesh(new SphereGeometry(1, 16, 12), material);
    for (const mesh of [this.rod, this.ball]) {
      mesh.renderOrder = 20;
      mesh.visible = false;
      mesh.frustumCulled = false;
      scene.add(mesh);
    }
  }

  setSpring(spring: { body: number; point: Vector3; target: Vector3 } | null): void {
    this.spring = spring;
  }

  clear(): void {
    this.selected = this.hovered = -1;
    this.spring = null;
    for (const outline of this.outlines) outline.forget();
  }

  update(height: number): void {
    const perPixel = (2 * Math.tan((this.camera.fov * Math.PI) / 360)) / Math.max(1, height); // at distance 1
    [this.selected, this.hovered === this.selected ? -1 : this.hovered].forEach((body, k) =>
      this.outlines[k]!.show(body, this.bodies, this.shapes, perPixel),
    );
    const spring = this.spring;
    this.rod.visible = this.ball.visible = !!spring && !!this.bodies.present[spring.body];
    if (!spring || !this.rod.visible) return;
    const turn = new Quaternion().fromArray(this.bodies.rot, 4 * spring.body);
    const from = spring.point.clone().applyQuaternion(turn).add(new Vector3().fromArray(this.bodies.pos, 3 * spring.body));
    const way = spring.target.clone().sub(from);
    const thick = (at: Vector3, pixels: number) => at.distanceTo(this.camera.position) * perPixel * pixels;
    this.rod.position.copy(from).addScaledVector(way, 0.5);
    this.rod.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), way.lengthSq() > 0 ? way.clone().normalize() : new Vector3(0, 1, 0));
    const width = thick(this.rod.position, 1.4);
    this.rod.scale.set(width, Math.max(1e-6, way.length()), width);
    this.ball.position.copy(spring.target);
    this.ball.scale.setScalar(thick(spring.target, 5));
  }
}

// The body's shape once more, seen from inside and grown by some pixels: only its rim is seen.
class Outline {
  private mesh: Mesh<BufferGeometry, ShaderMaterial>;
  private shape = -1;

  constructor(scene: Scene, colour: number, private readonly pixels: number) {
    this.mesh = new Mesh(
      new BufferGeometry(),
      new ShaderMaterial({
        side: BackSide,
        toneMapped: false,
        uniforms: {
          uColour: { value: new Color(colour) },
          uPixel: { value: 0.001 },
          uSize: { value: new Vector3(1, 1, 1) },
          uRound: { value: 0 },
        },
        // Away from the centre, because at an edge the normals of its two faces would tear the rim open.
        vertexShader: /* glsl */ `
          uniform float uPixel;
          uniform vec3 uSize;
          uniform float uRound;
          void main() {
            vec3 p = position * uSize;
            vec4 view = modelViewMatrix * vec4(p, 1.0);
            p += (uRound > 0.5 ? normalize(p) : sign(p)) * uPixel * -view.z;
            gl_Position = projectionMatrix * modelViewMatrix * vec4(p, 1.0);
          }`,
        fragmentShader: /* glsl */ `
          uniform vec3 uColour;
          void main() {
            gl_FragColor = vec4(uColour, 1.0);
            #include <colorspace_fragment>
          }`,
      }),
    );
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    scene.add(this.mesh);
  }

  show(body: number, bodies: Bodies, shapes: Shapes, perPixel: number): void {
    this.mesh.visible = body >= 0 && !!bodies.present[body];
    if (!this.mesh.visible) return;
    const form = shapes.form(bodies.mesh[body]!);
    if (form.shape !== this.shape) {
      this.shape = form.shape;
      const shape = shapes.shapes[form.shape]!;
      const geometry = new BufferGeometry();
      geometry.setAttribute('position', new BufferAttribute(shape.positions, 3));
      geometry.setIndex(new BufferAttribute(shape.indices, 1));
      this.mesh.geometry.dispose();
      this.mesh.geometry = geometry;
    }
    const uniforms = this.mesh.material.uniforms;
    (uniforms.uSize!.value as Vector3).set(...(form.size as [number, number, number]));
    uniforms.uRound!.value = shapes.shapes[form.shape]!.kind === 'box' ? 0 : 1;
    uniforms.uPixel!.value = perPixel * this.pixels;
    this.mesh.position.fromArray(bodies.pos, 3 * body);
    this.mesh.quaternion.fromArray(bodies.rot, 4 * body);
  }

  // A new scene's shapes have other numbers.
  forget(): void {
    this.shape = -1;
  }
}
