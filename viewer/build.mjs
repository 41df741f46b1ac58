// Bundles the viewer and its decoder of Draco, each into one minified file of the package, with the licences
// of what is in it, and records what was built from what. The same versions give the same bytes.
import { build } from 'esbuild';
import { createHash } from 'node:crypto';
import { mkdir, readFile, rm, writeFile } from 'node:fs/promises';

const target = new URL('../aobake/viewer/vendor/', import.meta.url);
const read = (path) => readFile(new URL(path, import.meta.url), 'utf8');

const bundles = {
  viewer: { entry: 'src/main.js', holds: ['three', 'meshoptimizer'] },
  draco: { entry: 'src/draco.js', holds: ['draco3dgltf'] },
};
const licences = {
  three: () => read('node_modules/three/LICENSE'),
  meshoptimizer: () => read('node_modules/meshoptimizer/LICENSE.md'),
  draco3dgltf: () => read('licences/Apache-2.0.txt'), // the package names its licence and has no copy of it
};

async function bundled(name, entry) {
  const result = await build({
    absWorkingDir: new URL('.', import.meta.url).pathname,
    entryPoints: [entry],
    bundle: true,
    minify: true,
    write: false,
    format: 'iife',
    globalName: `aobake_${name}`,
    target: 'es2022',
    charset: 'ascii', // a page is read the same whatever its encoding is taken for
    legalComments: 'none', // the licences stand beside the code, whole
    loader: { '.wasm': 'binary' },
    external: ['fs', 'path'], // what the decoder would ask for outside of browsers
    logLevel: 'warning',
  });
  return result.outputFiles[0].text;
}

async function version(name) {
  return JSON.parse(await read(`node_modules/${name}/package.json`)).version;
}

const sha256 = (text) => createHash('sha256').update(text).digest('hex');

await rm(target, { recursive: true, force: true });
await mkdir(target, { recursive: true });
const manifest = { files: {}, packages: {} };
for (const [name, { entry, holds }] of Object.entries(bundles)) {
  const parts = [];
  for (const held of holds) {
    manifest.packages[held] = await version(held);
    parts.push(`${held} ${manifest.packages[held]}\n\n${(await licences[held]()).trim()}\n`);
  }
  const files = { [`${name}.min.js`]: await bundled(name, entry), [`${name}.licences.txt`]: parts.join('\n\n') };
  for (const [file, text] of Object.entries(files)) {
    manifest.files[file] = sha256(text);
    await writeFile(new URL(file, target), text);
  }
}
await writeFile(new URL('manifest.json', target), `${JSON.stringify(manifest, null, 2)}\n`);
