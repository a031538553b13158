// How drawing.js shades what moves where drawing is slow: light is worked out at the corners of
// triangles instead of at every pixel, which a processor does in a third of the time.
"use strict";

const CORNER_SHADER = `
#include <common>
#include <bsdfs>
#include <lights_pars_begin>
uniform vec3 hue;
uniform float alpha, roughness, metalness;
varying vec4 vShade;
void main() {
  vec4 place = modelViewMatrix * vec4( position, 1.0 );
  gl_Position = projectionMatrix * place;
  vec3 view = normalize( - place.xyz ), away = normalize( normalMatrix * normal );
  #ifdef DOUBLE_SIDED
    away *= sign( dot( away, view ) );
  #endif
  vec4 base = vec4( hue, alpha );
  #if defined( USE_COLOR_ALPHA )
    base *= color;
  #elif defined( USE_COLOR )
    base.rgb *= color;
  #endif
  vec3 matt = BRDF_Lambert( base.rgb * ( 1.0 - metalness ) ), sheen = mix( vec3( 0.04 ), base.rgb, metalness );
  vec3 shade = ambientLightColor * matt;
  #if NUM_DIR_LIGHTS > 0
    IncidentLight light;
    #pragma unroll_loop_start
    for ( int i = 0; i < NUM_DIR_LIGHTS; i ++ ) {
      light.direction = directionalLights[ i ].direction;
      light.color = saturate( dot( away, light.direction ) ) * directionalLights[ i ].color;
      shade += light.color * matt;
      #ifdef SHINES
        shade += light.color * BRDF_GGX( light, view, away, sheen, 1.0, roughness );
      #endif
    }
    #pragma unroll_loop_end
  #endif
  #if NUM_HEMI_LIGHTS > 0
    #pragma unroll_loop_start
    for ( int i = 0; i < NUM_HEMI_LIGHTS; i ++ ) {
      shade += matt * mix( hemisphereLights[ i ].groundColor, hemisphereLights[ i ].skyColor,
        0.5 * dot( away, hemisphereLights[ i ].direction ) + 0.5 );
    }
    #pragma unroll_loop_end
  #endif
  vShade = vec4( shade, base.a );
}`;
const FLAT_SHADER = `
varying vec4 vShade;
void main() {
  gl_FragColor = vShade;
  #include <encodings_fragment>
}`;

const corners = {
  made: new WeakMap(), // by the material that is stood in for

  // Draw with stand-ins for all materials that are lit.
  draw(scene, drawAll) {
    const lit = [];
    let near = false; // lights that shine from near are worked out at every pixel
    scene.traverseVisible((each) => {
      near ||= each.isPointLight || each.isSpotLight || each.isRectAreaLight;
      if (each.layers.mask && this.fits(each)) lit.push([each, each.material]);
    });
    if (near) return drawAll();
    lit.forEach(([mesh, material]) => { mesh.material = this.standIn(material); });
    try {
      return drawAll();
    } finally {
      lit.forEach(([mesh, material]) => { mesh.material = material; });
    }
  },

  fits({ isMesh, isInstancedMesh, isSkinnedMesh, geometry, material }) {
    return isMesh && !isInstancedMesh && !isSkinnedMesh && geometry.attributes.normal && !material.flatShading
      && (material.isMeshStandardMaterial || material.isMeshLambertMaterial || material.isMeshPhongMaterial)
      && !material.map && !material.emissive.getHex();
  },

  standIn(material) {
    let made = this.made.get(material);
    if (!made || made.side !== material.side || made.vertexColors !== material.vertexColors) {
      made = this.make(material);
      this.made.set(material, made);
    }
    for (const name of ["visible", "transparent", "depthWrite", "depthTest"]) made[name] = material[name];
    made.uniforms.alpha.value = material.transparent ? material.opacity : 1;
    return made;
  },

  make({ color, side, vertexColors, isMeshStandardMaterial, roughness, metalness }) {
    const { ShaderMaterial, UniformsLib, UniformsUtils } = MeshCat.THREE;
    const made = new ShaderMaterial({
      vertexShader: CORNER_SHADER, fragmentShader: FLAT_SHADER, lights: true, side, vertexColors,
      defines: isMeshStandardMaterial ? { SHINES: "" } : {},
      uniforms: UniformsUtils.merge([UniformsLib.lights, {
        hue: { value: null }, alpha: { value: 1 },
        roughness: { value: roughness ?? 1 }, metalness: { value: metalness ?? 0 },
      }]),
    });
    made.uniforms.hue.value = color; // the very one, whatever becomes of it
    return made;
  },
};
