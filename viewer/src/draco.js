// Draco's decoder, its WebAssembly within this file. A page holds it where its asset needs it.
import createDecoderModule from 'draco3dgltf/draco_decoder_gltf_nodejs.js';
import wasmBinary from 'draco3dgltf/draco_decoder_gltf.wasm';

const TYPES = {
  Float32Array: [Float32Array, 'DT_FLOAT32'],
  Int8Array: [Int8Array, 'DT_INT8'],
  Int16Array: [Int16Array, 'DT_INT16'],
  Uint8Array: [Uint8Array, 'DT_UINT8'],
  Uint16Array: [Uint16Array, 'DT_UINT16'],
  Uint32Array: [Uint32Array, 'DT_UINT32'],
};

let starting;

/** The module, started once. It is handed over in a box: it has a `then` of its own, and await would follow it. */
function started() {
  starting ??= new Promise((resolve) => {
    createDecoderModule({ wasmBinary, onModuleLoaded: (module) => resolve({ module }) });
  });
  return starting;
}

/**
 * Decodes one mesh.
 *
 * ids: name -> unique id of an attribute; types: name -> name of a typed array.
 * Returns { index, attributes: name -> { array, itemSize } }; throws where the data is broken.
 */
export async function decode(buffer, ids, types) {
  const { module: draco } = await started();
  const decoder = new draco.Decoder();
  const mesh = new draco.Mesh();
  try {
    const data = new Int8Array(buffer);
    const status = decoder.DecodeArrayToMesh(data, data.byteLength, mesh);
    if (!status.ok() || mesh.ptr === 0) throw new Error(`Draco: ${status.error_msg()}`);
    const attributes = {};
    for (const [name, id] of Object.entries(ids)) {
      const attribute = decoder.GetAttributeByUniqueId(mesh, id);
      attributes[name] = column(draco, decoder, mesh, attribute, types[name] ?? 'Float32Array');
    }
    return { index: triangles(draco, decoder, mesh), attributes };
  } finally {
    draco.destroy(mesh);
    draco.destroy(decoder);
  }
}

function column(draco, decoder, mesh, attribute, type) {
  const [Kind, dataType] = TYPES[type];
  const itemSize = attribute.num_components();
  const count = mesh.num_points() * itemSize;
  const array = copied(draco, Kind, count, (bytes, at) =>
    decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, draco[dataType], bytes, at),
  );
  return { array, itemSize };
}

function triangles(draco, decoder, mesh) {
  return copied(draco, Uint32Array, mesh.num_faces() * 3, (bytes, at) =>
    decoder.GetTrianglesUInt32Array(mesh, bytes, at),
  );
}

/** What `fill` writes into the module's memory, as an array of our own. */
function copied(draco, Kind, count, fill) {
  const bytes = count * Kind.BYTES_PER_ELEMENT;
  const at = draco._malloc(bytes);
  try {
    fill(bytes, at);
    return new Kind(draco.HEAPU8.buffer, at, count).slice();
  } finally {
    draco._free(at);
  }
}
