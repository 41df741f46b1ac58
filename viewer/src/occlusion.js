// Where an asset keeps its baked ambient occlusion, and materials in which it can be taken away or shown alone.
import { MeshStandardMaterial } from 'three';

const NAME = 'ambient occlusion'; // of the accessors that aobake writes

/** How much of the occlusion there is, and how much of all the rest is hidden: 0 to 1, of every material. */
export const uniforms = { aoAmount: { value: 1 }, aoAlone: { value: 0 } };

/**
 * Give every mesh of a loaded asset a material that obeys the uniforms.
 *
 * Returns { attribute, texture, colors, tinted, unmarked }: whether any mesh keeps occlusion in _AO, in an
 * occlusion texture, in vertex colours; whether such colours are not grey; whether nothing but their grey says
 * that they are occlusion.
 */
export async function dress({ scene, parser }) {
  const marked = await markedAttributes(parser);
  const found = { attribute: false, texture: false, colors: false, tinted: false, unmarked: false };
  const made = new Map();
  scene.traverse((object) => {
    if (!object.isMesh) return;
    const kinds = [object.material].flat().map((material) => {
      const kind = kindOf(object.geometry, material, marked);
      for (const name of Object.keys(found)) found[name] ||= kind[name];
      return [material, kind];
    });
    const dressed = kinds.map(([material, kind]) => cached(made, material, kind));
    object.material = Array.isArray(object.material) ? dressed : dressed[0];
  });
  return found;
}

/** The attributes that aobake wrote. */
async function markedAttributes(parser) {
  const numbers = [...(parser.json.accessors ?? []).entries()].filter(([, accessor]) => accessor.name === NAME);
  return new Set(await Promise.all(numbers.map(([number]) => parser.getDependency('accessor', number))));
}

/**
 * What of a geometry and a material is occlusion.
 *
 * _AO goes before an occlusion texture, as in aobake's own previews: it is not rounded. Colours are occlusion
 * where aobake says so; else, where nothing other is, they are taken for it.
 */
function kindOf({ attributes }, material, marked) {
  const attribute = attributes._ao !== undefined;
  const texture = !attribute && Boolean(material.aoMap);
  const own = attributes.color;
  const isMarked = own !== undefined && marked.has(own);
  const colors = own !== undefined && (isMarked || !(attribute || texture));
  return { attribute, texture, colors, tinted: colors && !isGrey(own), unmarked: colors && !isMarked };
}

function isGrey(colors) {
  const step = 1 / 128; // 8-bit colours may be rounded each by itself
  for (let i = 0; i < colors.count; i++) {
    const red = colors.getX(i);
    if (Math.abs(colors.getY(i) - red) > step || Math.abs(colors.getZ(i) - red) > step) return false;
  }
  return true;
}

function cached(made, material, kind) {
  const key = `${material.uuid} ${kind.attribute} ${kind.colors}`;
  if (!made.has(key)) made.set(key, withOcclusion(material, kind));
  return made.get(key);
}

function withOcclusion(material, { attribute, colors }) {
  const copy = material.clone();
  if (attribute) copy.aoMap = null;
  copy.defines = { ...copy.defines };
  if (attribute) copy.defines.AO_ATTRIBUTE = '';
  if (colors) copy.defines.AO_COLORS = '';
  if (copy instanceof MeshStandardMaterial) copy.defines.AO_LIT = '';
  copy.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    shader.vertexShader = edited(shader.vertexShader, VERTEX);
    shader.fragmentShader = edited(shader.fragmentShader, FRAGMENT);
  };
  copy.customProgramCacheKey = () => 'aobake';
  return copy;
}

/** A shader with pieces put after, or in place of, the chunks of three.js that they name. */
function edited(source, pieces) {
  return Object.entries(pieces).reduce((text, [chunk, piece]) => {
    const include = `#include <${chunk}>`;
    if (!text.includes(include)) throw new Error(`the shader has no ${chunk}`);
    return text.replace(include, () => piece.replace('CHUNK', include));
  }, source);
}

const VERTEX = {
  common: `CHUNK
    #ifdef AO_ATTRIBUTE
      attribute float _ao;
      varying float vAo;
    #endif`,
  color_vertex: `CHUNK
    #ifdef AO_ATTRIBUTE
      vAo = clamp(_ao, 0.0, 1.0);
    #endif`,
};

// Colours darken all light, as everywhere; the attribute darkens what an occlusion texture does: ambient light.
const FRAGMENT = {
  common: `CHUNK
    uniform float aoAmount;
    uniform float aoAlone;
    #ifdef AO_ATTRIBUTE
      varying float vAo;
    #endif`,
  color_fragment: `
    #ifdef AO_COLORS
      diffuseColor *= vec4(mix(vec3(1.0), vColor.rgb, aoAmount), vColor.a);
    #else
      CHUNK
    #endif`,
  aomap_fragment: `
    float aoSeen = 1.0;
    #ifdef USE_AOMAP
      aoSeen = (texture2D(aoMap, vAoMapUv).r - 1.0) * aoMapIntensity + 1.0;
    #endif
    #ifdef AO_ATTRIBUTE
      aoSeen = vAo;
    #endif
    #ifdef AO_LIT
      float aoNow = mix(1.0, aoSeen, aoAmount);
      reflectedLight.indirectDiffuse *= aoNow;
      #ifdef USE_CLEARCOAT
        clearcoatSpecularIndirect *= aoNow;
      #endif
      #ifdef USE_SHEEN
        sheenSpecularIndirect *= aoNow;
      #endif
      #ifdef USE_ENVMAP
        float aoCosine = saturate(dot(geometryNormal, geometryViewDir));
        reflectedLight.indirectSpecular *= computeSpecularOcclusion(aoCosine, aoNow, material.roughness);
      #endif
    #endif
    #ifdef AO_COLORS
      aoSeen *= dot(vColor.rgb, vec3(1.0 / 3.0));
    #endif`,
  premultiplied_alpha_fragment: `
    gl_FragColor.rgb = mix(gl_FragColor.rgb, vec3(aoSeen), aoAlone);
    CHUNK`,
};
