// node decompress_gltf.mjs IN.glb OUT.glb...: reads each IN with glTF Transform and meshoptimizer's own decoder and
// writes what it read, uncompressed and with plain floats, to OUT. Prints the required extensions of each IN.
// https://gltf-transform.dev/
import fs from 'node:fs';
import { require } from './packages.mjs';

const { NodeIO } = require('@gltf-transform/core');
const { ALL_EXTENSIONS } = require('@gltf-transform/extensions');
const { MeshoptDecoder } = require('meshoptimizer');

await MeshoptDecoder.ready;
const io = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({ 'meshopt.decoder': MeshoptDecoder });
const codecs = ['EXT_meshopt_compression', 'KHR_mesh_quantization'];
const required = [];
for (let index = 2; index < process.argv.length; index += 2) {
  const document = await io.readBinary(new Uint8Array(fs.readFileSync(process.argv[index])));
  const extensions = document.getRoot().listExtensionsRequired();
  required.push(extensions.map((extension) => extension.extensionName).sort());
  for (const accessor of document.getRoot().listAccessors()) {
    if (!accessor.getNormalized()) continue;
    const count = accessor.getCount();
    const size = accessor.getElementSize();
    const values = new Float32Array(count * size);
    const row = [];
    for (let i = 0; i < count; i++) values.set(accessor.getElement(i, row), i * size);
    accessor.setArray(values).setNormalized(false);
  }
  for (const extension of extensions) if (codecs.includes(extension.extensionName)) extension.dispose();
  fs.writeFileSync(process.argv[index + 1], await io.writeBinary(document));
}
console.log(JSON.stringify(required));
