// node tiles_tools_many.mjs TILESET_JSON: the structure of a tileset of many figures, as 3d-tiles-tools reads it.
//
// stdout: {metadata, depth, tiles, contents: {uri: {metadata, extras, kind, batch}}}; external tilesets are followed,
//         uris are seen from the first one, `batch` is the batch table of b3dm content (with --batch)
// https://github.com/CesiumGS/3d-tiles-tools
import fs from 'node:fs';
import path from 'node:path';
import { require } from './packages.mjs';

const { MetadataEntityModels, ResourceResolvers, TileFormats, TilesetTraverser } = require('3d-tiles-tools');

const file = path.resolve(process.argv[2]);
const batches = process.argv[3] === '--batch';
const folder = path.dirname(file);
const tileset = JSON.parse(fs.readFileSync(file, 'utf8'));
const read = (schema, entity) => {
  const model = MetadataEntityModels.create(schema, entity);
  return Object.fromEntries(Object.keys(entity.properties).map((key) => [key, model.getPropertyValue(key)]));
};
const contents = {};
let tiles = 0;
let depth = 0;
const traverser = new TilesetTraverser(folder, ResourceResolvers.createFileResourceResolver(folder), {
  depthFirst: true,
  traverseExternalTilesets: true,
});
await traverser.traverse(tileset, async (traversed) => {
  const tile = traversed.asFinalTile();
  tiles += 1;
  depth = Math.max(depth, traversed.level);
  for (const { uri } of traversed.getFinalContents()) {
    if (uri.endsWith('.json')) {
      continue;
    }
    const data = fs.readFileSync(path.join(folder, decodeURIComponent(uri)));
    contents[decodeURIComponent(uri)] = {
      metadata: tile.metadata && read(tileset.schema, tile.metadata),
      extras: tile.extras,
      kind: data.subarray(0, 4).toString('latin1'),
      batch: batches ? TileFormats.readTileData(data).batchTable.json : undefined,
    };
  }
  return true;
});
const metadata = tileset.metadata && read(tileset.schema, tileset.metadata);
console.log(JSON.stringify({ metadata, depth, tiles, contents }));
