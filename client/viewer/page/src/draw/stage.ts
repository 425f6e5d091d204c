// Renderer, light, sky and fog. What stands on the stage is elsewhere.
import {
  ACESFilmicToneMapping,
  BackSide,
  BasicShadowMap,
  Color,
  DirectionalLight,
  Fog,
  HemisphereLight,
  Mesh,
  PCFSoftShadowMap,
  PerspectiveCamera,
  Quaternion,
  Raycaster,
  type Ray,
  Scene,
  ShaderMaterial,
  SphereGeometry,
  Vector2,
  Vector3,
  WebGLRenderer,
  type Material,
} from 'three';
import type { Quality } from '../settings';
import { levels, looks, type Level, type Look } from './looks';

export class Stage {
  readonly renderer: WebGLRenderer;
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(42, 1, 0.1, 5000);
  readonly software: boolean; // no graphics hardware
  level: Level = levels.medium;
  look: Look = looks.dark;
  private sun = new DirectionalLight();
  private light = new HemisphereLight();
  private fog = new Fog(0, 1, 2);
  private sky: Mesh<SphereGeometry, ShaderMaterial>;
  private up = new Vector3(0, 0, 1);
  private toSun = new Vector3();
  private caster = new Raycaster();
  private radius = 20; // m, of the scene
  readonly focusPoint = new Vector3();

  // Whether edges are smoothed can be said only now, so it is by what the user has chosen before.
  constructor(readonly canvas: HTMLCanvasElement, quality: Quality) {
    this.software = isSoftware();
    const antialias = quality === 'auto' ? !this.software : quality === 'high' || quality === 'medium';
    this.renderer = new WebGLRenderer({ canvas, antialias, powerPreference: 'high-performance' });
    this.renderer.shadowMap.enabled = true;
    this.renderer.toneMapping = ACESFilmicToneMapping;
    this.sky = new Mesh(
      new SphereGeometry(1, 32, 16),
      new ShaderMaterial({
        side: BackSide,
        depthWrite: false,
        depthTest: false,
        toneMapped: false,
        fog: false,
        uniforms: {
          uUp: { value: this.up },
          uZenith: { value: new Color() },
          uHorizon: { value: new Color() },
          uNadir: { value: new Color() },
          uSun: { value: this.toSun },
          uGlow: { value: new Color() },
        },
        vertexShader: skyVertex,
        fragmentShader: skyFragment,
      }),
    );
    this.sky.renderOrder = -10;
    this.sky.frustumCulled = false;
    this.sun.castShadow = true;
    this.sun.shadow.bias = -0.0004;
    this.scene.fog = this.fog;
    this.scene.add(this.sky, this.light, this.sun, this.sun.target);
    this.setUp(this.up);
  }

  setUp(up: Vector3): void {
    this.up.copy(up).normalize();
    this.camera.up.copy(this.up);
    this.light.position.copy(this.up);
    // From behind the right shoulder of the first camera, at a height of about 50 degrees.
    const turn = new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), this.up);
    this.toSun.set(0.52, -0.34, 0.85).normalize().applyQuaternion(turn);
  }

  setExtent(radius: number): void {
    this.radius = Math.max(1, radius);
    this.camera.far = this.radius * 60 + 1000;
    this.camera.updateProjectionMatrix();
  }

  setLook(look: Look): void {
    this.look = look;
    const sky = this.sky.material.uniforms;
    (sky.uZenith!.value as Color).set(look.zenith);
    (sky.uHorizon!.value as Color).set(look.horizon);
    (sky.uNadir!.value as Color).set(look.nadir);
    (sky.uGlow!.value as Color).set(look.sun);
    this.fog.color.set(look.horizon);
    this.light.color.set(look.sky);
    this.light.groundColor.set(look.ground);
    this.light.intensity = look.ambient;
    this.sun.color.set(look.sun);
    this.sun.intensity = look.sunlight;
    this.renderer.toneMappingExposure = look.exposure;
  }

  setLevel(level: Level): void {
    this.level = level;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, level.pixelRatio));
    const shadow = this.sun.shadow;
    const type = level.softShadows ? PCFSoftShadowMap : BasicShadowMap;
    if (this.renderer.shadowMap.type !== type) {
      this.renderer.shadowMap.type = type;
      this.scene.traverse((object) => {
        if (object instanceof Mesh) (object.material as Material).needsUpdate = true;
      });
    }
    this.sun.castShadow = level.shadows > 0;
    if (level.shadows > 0 && shadow.mapSize.x !== level.shadows) {
      shadow.mapSize.set(level.shadows, level.shadows);
      shadow.map?.dispose();
      shadow.map = null;
    }
    this.resize();
  }

  resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  // From the eye through a point of the page, in CSS pixels.
  rayAt({ clientX: x, clientY: y }: { clientX: number; clientY: number }): Ray {
    const box = this.canvas.getBoundingClientRect();
    const place = new Vector2((2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height);
    this.caster.setFromCamera(place, this.camera);
    return this.caster.ray.clone();
  }

  // The light goes where the user looks: one shadow map then has texels of a few centimetres there, and none is spent
  // on what is far away.
  focus(target: Vector3): void {
    this.focusPoint.copy(target);
    const distance = this.camera.position.distanceTo(target);
    const half = Math.min(1.3 * this.radius + 4, Math.max(3, 0.85 * distance));
    const shadow = this.sun.shadow;
    const camera = shadow.camera;
    // In steps, so that shadows do not swim when the user zooms.
    const extent = 2 ** (Math.ceil(Math.log2(half) * 4) / 4);
    const depth = extent + 2 * this.radius;
    if (camera.right !== extent || camera.far !== 2 * depth) {
      camera.left = camera.bottom = -extent;
      camera.right = camera.top = extent;
      camera.near = 0.1;
      camera.far = 2 * depth;
      camera.updateProjectionMatrix();
      const texel = (2 * extent) / Math.max(1, this.level.shadows);
      shadow.normalBias = 1.2 * texel;
      shadow.bias = -0.5 * (texel / (2 * depth));
    }
    // And by whole texels, so that they do not crawl when they move.
    const texel = (2 * extent) / Math.max(1, this.level.shadows);
    const right = new Vector3().crossVectors(this.up, this.toSun).normalize();
    const above = new Vector3().crossVectors(this.toSun, right);
    const at = target.clone();
    for (const axis of [right, above]) {
      const along = at.dot(axis);
      at.addScaledVector(axis, Math.round(along / texel) * texel - along);
    }
    this.sun.target.position.copy(at);
    this.sun.position.copy(at).addScaledVector(this.toSun, depth);
    this.sun.target.updateMatrixWorld();

    // Depths are told apart in proportion to the nearest: not nearer than is needed from here.
    const near = Math.max(0.02, 0.012 * distance);
    if (Math.abs(near - this.camera.near) > 0.1 * this.camera.near) {
      this.camera.near = near;
      this.camera.updateProjectionMatrix();
    }

    this.sky.position.copy(this.camera.position);
    this.sky.scale.setScalar(this.camera.far * 0.5);
    this.fog.near = distance + this.radius * 0.6;
    this.fog.far = distance * 1.6 + this.radius * 4.5;
  }

  render(): void {
    this.renderer.render(this.scene, this.camera);
  }
}

// Asked of a context of its own, which is let go of at once.
function isSoftware(): boolean {
  const gl = document.createElement('canvas').getContext('webgl2');
  const info = gl?.getExtension('WEBGL_debug_renderer_info');
  const name = gl && info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : '';
  gl?.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

const skyVertex = /* glsl */ `
varying vec3 vWay;
void main() {
  vWay = position;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

const skyFragment = /* glsl */ `
varying vec3 vWay;
uniform vec3 uUp;
uniform vec3 uZenith;
uniform vec3 uHorizon;
uniform vec3 uNadir;
uniform vec3 uSun;
uniform vec3 uGlow;
void main() {
  vec3 way = normalize(vWay);
  float height = dot(way, uUp);
  vec3 colour = height > 0.0 ? mix(uHorizon, uZenith, pow(smoothstep(0.0, 0.9, height), 0.75))
                             : mix(uHorizon, uNadir, smoothstep(0.0, 0.5, -height));
  // A wide, faint glow on the sun's side.
  colour += uGlow * 0.07 * pow(max(0.0, dot(way, uSun)), 6.0);
  gl_FragColor = vec4(colour, 1.0);
  #include <colorspace_fragment>
  // A grain of noise against bands.
  gl_FragColor.rgb += (fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233))) * 43758.5453) - 0.5) / 255.0;
}`;
