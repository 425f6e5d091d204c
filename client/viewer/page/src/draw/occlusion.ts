// Light from the sky reaches less of what is in corners and between bodies. That share is estimated from the depths
// around each pixel (screen-space ambient occlusion): first the depths of the scene at half resolution, then for each
// pixel how much of the half sphere over it is closed, then a blur that keeps to surfaces. Materials of bodies and
// statics dim the light from the sky by it, and that only, so that what the sun lights stays bright.
import {
  DepthTexture,
  FloatType,
  Mesh,
  NearestFilter,
  LinearFilter,
  OrthographicCamera,
  PlaneGeometry,
  RGBAFormat,
  Scene,
  ShaderMaterial,
  UnsignedByteType,
  Vector2,
  WebGLRenderTarget,
  Matrix4,
} from 'three';
import { occlusionUniforms } from './occlusion_uniforms';
import type { Instances } from './instances';
import type { Stage } from './stage';
import type { Statics } from './statics';

const share = 0.5; // of the resolution
const samples = 14;

export class Occlusion {
  private on = false;
  private depth: WebGLRenderTarget;
  private raw: WebGLRenderTarget;
  private blurred: WebGLRenderTarget;
  private gather: ShaderMaterial;
  private blur: ShaderMaterial;
  private quad = new Mesh(new PlaneGeometry(2, 2));
  private quadScene = new Scene();
  private quadCamera = new OrthographicCamera(-1, 1, 1, -1, 0, 1);
  private size = new Vector2();

  constructor(
    private readonly stage: Stage,
    private readonly instances: Instances,
    private readonly statics: Statics,
  ) {
    const target = (withDepth: boolean) => {
      const made = new WebGLRenderTarget(4, 4, {
        format: RGBAFormat,
        type: UnsignedByteType,
        minFilter: withDepth ? NearestFilter : LinearFilter,
        magFilter: withDepth ? NearestFilter : LinearFilter,
        depthBuffer: withDepth,
      });
      if (withDepth) made.depthTexture = new DepthTexture(4, 4, FloatType);
      return made;
    };
    this.depth = target(true);
    this.raw = target(false);
    this.blurred = target(false);
    const shared = {
      uDepth: { value: this.depth.depthTexture },
      uPixel: { value: new Vector2() },
      uProjection: { value: new Matrix4() },
      uInverse: { value: new Matrix4() },
    };
    this.gather = new ShaderMaterial({
      uniforms: { ...shared, uRadius: { value: 1 } },
      vertexShader: passVertex,
      fragmentShader: passHead + gatherFragment,
      depthTest: false,
      depthWrite: false,
      toneMapped: false,
    });
    this.blur = new ShaderMaterial({
      uniforms: { ...shared, uRaw: { value: this.raw.texture } },
      vertexShader: passVertex,
      fragmentShader: passHead + blurFragment,
      depthTest: false,
      depthWrite: false,
      toneMapped: false,
    });
    this.quad.frustumCulled = false;
    this.quadScene.add(this.quad);
    occlusionUniforms.uOcclusion.value = this.blurred.texture;
  }

  enable(on: boolean): void {
    this.on = on;
    if (!on) occlusionUniforms.uOccluding.value = 0;
  }

  render(): void {
    if (!this.on) return;
    const { renderer, camera } = this.stage;
    renderer.getDrawingBufferSize(this.size);
    occlusionUniforms.uScreen.value.set(1 / this.size.x, 1 / this.size.y);
    const width = Math.max(1, Math.round(this.size.x * share));
    const height = Math.max(1, Math.round(this.size.y * share));
    if (this.depth.width !== width || this.depth.height !== height)
      for (const target of [this.depth, this.raw, this.blurred]) target.setSize(width, height);

    this.depths();
    for (const material of [this.gather, this.blur]) {
      const uniforms = material.uniforms;
      uniforms.uPixel!.value.set(1 / width, 1 / height);
      uniforms.uProjection!.value.copy(camera.projectionMatrix);
      uniforms.uInverse!.value.copy(camera.projectionMatrixInverse);
    }
    // As far as bodies are large, or a share of the picture when one looks from far away.
    const distance = camera.position.distanceTo(this.stage.focusPoint);
    this.gather.uniforms.uRadius!.value = Math.max(0.035 * distance, Math.min(0.6, 0.2 * distance));
    const shadows = renderer.shadowMap.autoUpdate;
    renderer.shadowMap.autoUpdate = false;
    this.pass(this.gather, this.raw);
    this.pass(this.blur, this.blurred);
    renderer.setRenderTarget(null);
    renderer.shadowMap.autoUpdate = shadows;
    occlusionUniforms.uOccluding.value = 1;
  }

  // What stands in the scene, with materials that write depth only.
  private depths(): void {
    const { renderer, scene, camera } = this.stage;
    const hidden = scene.children.filter((child) => child.visible);
    for (const child of hidden) child.visible = false;
    this.instances.depthOnly(true);
    this.statics.depthOnly(true, hidden);
    const shadows = renderer.shadowMap.autoUpdate;
    renderer.shadowMap.autoUpdate = false;
    renderer.setRenderTarget(this.depth);
    renderer.clear();
    renderer.render(scene, camera);
    renderer.shadowMap.autoUpdate = shadows;
    this.instances.depthOnly(false);
    this.statics.depthOnly(false, hidden);
    for (const child of scene.children) child.visible = hidden.includes(child);
  }

  private pass(material: ShaderMaterial, target: WebGLRenderTarget): void {
    this.quad.material = material;
    this.stage.renderer.setRenderTarget(target);
    this.stage.renderer.render(this.quadScene, this.quadCamera);
  }
}

const passVertex = /* glsl */ `
varying vec2 vUv;
void main() {
  vUv = uv;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

const passHead = /* glsl */ `
varying vec2 vUv;
uniform sampler2D uDepth;
uniform vec2 uPixel;
uniform mat4 uProjection;
uniform mat4 uInverse;
// In the camera's axes; it looks along -z.
vec3 placeAt(vec2 uv) {
  vec4 p = uInverse * vec4(2.0 * vec3(uv, texture2D(uDepth, uv).r) - 1.0, 1.0);
  return p.xyz / p.w;
}
`;

const gatherFragment = /* glsl */ `
uniform float uRadius;
// The side on which the depth changes less lies on the same surface.
vec3 slope(vec3 here, vec3 before, vec3 after) {
  return abs(after.z - here.z) < abs(here.z - before.z) ? after - here : here - before;
}
void main() {
  if (texture2D(uDepth, vUv).r >= 1.0) {
    gl_FragColor = vec4(1.0);
    return;
  }
  vec3 here = placeAt(vUv);
  vec3 dx = slope(here, placeAt(vUv - vec2(uPixel.x, 0.0)), placeAt(vUv + vec2(uPixel.x, 0.0)));
  vec3 dy = slope(here, placeAt(vUv - vec2(0.0, uPixel.y)), placeAt(vUv + vec2(0.0, uPixel.y)));
  vec3 normal = normalize(cross(dx, dy));
  // Radius on the screen.
  float reach = uRadius * uProjection[1][1] * 0.5 / -here.z;
  reach = min(reach, 0.12);
  // Samples on a spiral, turned differently at neighbouring pixels; the blur evens that out.
  float turn = 6.2831853 * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  float closed = 0.0;
  for (int k = 0; k < ${samples}; k++) {
    float along = (float(k) + 0.5) / ${samples}.0;
    float angle = turn + float(k) * 2.3999632;
    vec2 off = vec2(cos(angle) * uProjection[0][0] / uProjection[1][1], sin(angle)) * reach * along;
    vec3 way = placeAt(vUv + off) - here;
    float distance = length(way);
    float above = dot(way, normal) / max(distance, 1e-4);
    float bias = 0.06;
    // Far things do not count: they are only before it in the picture.
    float near = 1.0 - smoothstep(0.6 * uRadius, 1.4 * uRadius, distance);
    closed += max(0.0, above - bias) * near;
  }
  float open = clamp(1.0 - 2.1 * closed / ${samples}.0, 0.0, 1.0);
  gl_FragColor = vec4(vec3(open), 1.0);
}`;

const blurFragment = /* glsl */ `
uniform sampler2D uRaw;
void main() {
  float here = placeAt(vUv).z;
  float sum = 0.0;
  float weights = 0.0;
  for (int y = -2; y <= 2; y++)
    for (int x = -2; x <= 2; x++) {
      vec2 uv = vUv + vec2(float(x), float(y)) * uPixel;
      float weight = 1.0 / (1.0 + 900.0 * abs(placeAt(uv).z - here) / max(0.1, -here));
      sum += weight * texture2D(uRaw, uv).r;
      weights += weight;
    }
  gl_FragColor = vec4(vec3(sum / weights), 1.0);
}`;
