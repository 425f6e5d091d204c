// What materials need of Occlusion, apart from it so that neither needs the other.
import { Vector2, type Texture, type WebGLProgramParametersWithUniforms } from 'three';

export const occlusionUniforms = {
  uOcclusion: { value: null as Texture | null },
  uScreen: { value: new Vector2(1, 1) },
  uOccluding: { value: 0 },
};

// To be called in onBeforeCompile.
export function dimByOcclusion(shader: WebGLProgramParametersWithUniforms): void {
  Object.assign(shader.uniforms, occlusionUniforms);
  shader.fragmentShader = shader.fragmentShader
    .replace(
      '#include <common>',
      `#include <common>
       uniform sampler2D uOcclusion;
       uniform vec2 uScreen;
       uniform float uOccluding;`,
    )
    .replace(
      '#include <aomap_fragment>',
      `if (uOccluding > 0.5) {
         float open = texture2D(uOcclusion, gl_FragCoord.xy * uScreen).r;
         reflectedLight.indirectDiffuse *= open;
         reflectedLight.directDiffuse *= 0.6 + 0.4 * open;
       }`,
    );
}
