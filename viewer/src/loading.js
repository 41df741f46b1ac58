// The asset from the page's own text to a three.js scene, without a single request.
import { BufferAttribute, BufferGeometry, TextureLoader } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'meshoptimizer/decoder';

/** The bytes that an element of the page holds in base64. */
export function bytesOf(element) {
  const text = element.textContent.trim();
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = characters.charCodeAt(i);
  return bytes;
}

/** A GLB as GLTFLoader gives it: { scene, parser, ... }. Rejects where it is broken. */
export async function loaded(glb) {
  const loader = new GLTFLoader();
  loader.setMeshoptDecoder(MeshoptDecoder);
  loader.setDRACOLoader(dracoLoader);
  loader.register(imageElements);
  loader.register(withoutKtx2);
  return loader.parseAsync(glb.buffer, '');
}

// GLTFLoader would fetch images from blob: addresses, and the page allows no fetching of any kind.
function imageElements(parser) {
  parser.textureLoader = new TextureLoader(parser.options.manager);
  return { name: 'aobake_image_elements' };
}

// Its transcoder weighs as much as the whole viewer; without it the surface keeps its plain colour.
function withoutKtx2(parser) {
  const name = 'KHR_texture_basisu';
  const isKtx2 = (texture) => texture.extensions?.[name] && texture.source === undefined;
  return {
    name,
    loadTexture: (number) => (isKtx2(parser.json.textures[number]) ? Promise.resolve(null) : null),
  };
}

// What GLTFLoader asks of a DRACOLoader; the decoder is in a script of its own, where the asset needs it.
const dracoLoader = {
  preload() {},
  decodeDracoFile(buffer, done, ids, types, colorSpace, failed) {
    globalThis.aobake_draco
      .decode(buffer, ids, types)
      .then(({ index, attributes }) => {
        const geometry = new BufferGeometry().setIndex(new BufferAttribute(index, 1));
        for (const [name, { array, itemSize }] of Object.entries(attributes)) {
          geometry.setAttribute(name, new BufferAttribute(array, itemSize));
        }
        done(geometry);
      })
      .catch(failed);
  },
};
