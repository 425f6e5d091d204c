// Materials of the bodies. Place, rotation, size and colour of each come as attributes, and the vertex shader puts them
// together: the page writes seven numbers per moving body and picture, where matrices would be sixteen and their
// products.
import {
  Color,
  MeshDepthMaterial,
  MeshLambertMaterial,
  MeshStandardMaterial,
  RGBADepthPacking,
  type Material,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import { redoneColour } from './colours';
import { dimByOcclusion } from './occlusion_uniforms';
import type { ShapeKind } from './shapes';

export const flashSeconds = 0.6;

// Shared by all materials of bodies.
export const bodyUniforms = {
  uTime: { value: 0 }, // s, of the clock that flashes are told by
  uFlash: { value: new Color(redoneColour) },
  uFlashOn: { value: 1 },
};

const vertexHead = /* glsl */ `
attribute vec4 iPlace; // xyz: place; w: when it was rolled back
attribute vec4 iTurn;  // quaternion
attribute vec3 iSize;  // half extents
attribute vec4 iTint;  // rgb: colour, sRGB; a: how much it shines by itself
vec3 turned(vec3 v, vec4 q) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }
`;

const placed = 'vec3 transformed = turned(position * iSize, iTurn) + iPlace.xyz;';

const vertexVaryings = /* glsl */ `
uniform float uTime;
varying vec4 vTint;
varying float vFlash;
varying vec3 vLocal;
varying vec3 vHalf;
`;

const fragmentHead = /* glsl */ `
uniform vec3 uFlash;
uniform float uFlashOn;
varying vec4 vTint;
varying float vFlash;
varying vec3 vLocal;
varying vec3 vHalf;
// Thin darker edges, so that boxes of one colour that touch are told apart; gone where they would be finer than pixels.
float edgeOf(vec3 local, vec3 size) {
  vec3 d = (1.0 - abs(local)) * size;
  float second = max(min(d.x, d.y), min(max(d.x, d.y), d.z));
  float width = 0.055 * min(size.x, min(size.y, size.z));
  float pixel = fwidth(second) + 1e-6;
  return (1.0 - smoothstep(width - pixel, width + pixel, second)) * clamp(1.5 * width / pixel, 0.0, 1.0);
}
// A band around spheres, so that one sees them spin.
float bandOf(vec3 local) {
  float d = abs(abs(local.z) - 0.28);
  float pixel = fwidth(local.z) + 1e-6;
  return (1.0 - smoothstep(0.06 - pixel, 0.06 + pixel, d)) * clamp(0.09 / pixel, 0.0, 1.0);
}
`;

const marks: Record<ShapeKind, string> = {
  box: 'diffuseColor.rgb *= 1.0 - 0.34 * edgeOf(vLocal, vHalf);',
  round: 'diffuseColor.rgb *= 1.0 - 0.26 * bandOf(vLocal);',
  other: '',
};

export function bodyMaterial(kind: ShapeKind, fine: boolean): Material {
  const material = fine
    ? new MeshStandardMaterial({ roughness: 0.58, metalness: 0 })
    : new MeshLambertMaterial();
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, bodyUniforms);
    patchVertex(shader, true);
    dimByOcclusion(shader);
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <common>', `#include <common>\n${fragmentHead}`)
      .replace('#include <color_fragment>', `diffuseColor.rgb *= vTint.rgb;\n${marks[kind]}`)
      .replace(
        '#include <emissivemap_fragment>',
        `totalEmissiveRadiance += 0.45 * vTint.a * vTint.rgb + uFlashOn * vFlash * (0.25 * diffuseColor.rgb + uFlash);
         diffuseColor.rgb *= 1.0 - 0.6 * uFlashOn * vFlash;`,
      );
  };
  material.customProgramCacheKey = () => `body-${kind}-${fine}`;
  return material;
}

// What throws shadows must stand where the body does.
export function bodyDepthMaterial(): Material {
  const material = new MeshDepthMaterial({ depthPacking: RGBADepthPacking });
  material.onBeforeCompile = (shader) => patchVertex(shader, false);
  material.customProgramCacheKey = () => 'body-depth';
  return material;
}

function patchVertex(shader: WebGLProgramParametersWithUniforms, lit: boolean): void {
  const varyings = lit
    ? /* glsl */ `
  vTint = vec4(pow(iTint.rgb, vec3(2.2)), iTint.a);
  float since = (uTime - iPlace.w) / ${flashSeconds.toFixed(2)};
  vFlash = since < 0.0 ? 0.0 : pow(max(0.0, 1.0 - since), 1.6);
  vLocal = position;
  vHalf = iSize;`
    : '';
  shader.vertexShader = shader.vertexShader
    .replace('#include <common>', `#include <common>\n${vertexHead}${lit ? vertexVaryings : ''}`)
    .replace('#include <beginnormal_vertex>', 'vec3 objectNormal = turned(normalize(normal / iSize), iTurn);')
    .replace('#include <begin_vertex>', `${placed}${varyings}`);
}
