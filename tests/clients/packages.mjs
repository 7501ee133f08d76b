// Where the packages are: the tests install them outside this folder and say so in NODE_PATH, which `import` ignores.
import { createRequire } from 'node:module';
import path from 'node:path';

const home = process.env.NODE_PATH ? path.resolve(process.env.NODE_PATH, '..', 'any.js') : import.meta.url;

export const require = createRequire(home);
