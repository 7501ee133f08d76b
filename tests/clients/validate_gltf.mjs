// node validate_gltf.mjs FILE...: prints a JSON array of the Khronos validator's reports, one for each file.
// https://github.com/KhronosGroup/glTF-Validator
import fs from 'node:fs';
import path from 'node:path';
import { require } from './packages.mjs';

const validator = require('gltf-validator');

const reports = process.argv.slice(2).map((file) =>
  validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
    uri: path.basename(file),
    externalResourceFunction: async (uri) =>
      new Uint8Array(fs.readFileSync(path.join(path.dirname(file), decodeURIComponent(uri)))),
  }),
);
console.log(JSON.stringify(await Promise.all(reports)));
