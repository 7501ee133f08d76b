// node tiles_tools.mjs TILESET_JSON: what 3d-tiles-tools, a reader that shares no code with ours, finds in a tileset.
//
// stdout: {metadata: {...}, tiles: [{level, geometric_error, uris, parts: [{name, label, observedShare}]}, ...]}
// https://github.com/CesiumGS/3d-tiles-tools
import fs from 'node:fs';
import path from 'node:path';
import { require } from './packages.mjs';

const {
  BinaryPropertyTableModel,
  GltfUtilities,
  MetadataEntityModels,
  ResourceResolvers,
  TilesetTraverser,
} = require('3d-tiles-tools');

function parts(file) {
  const { jsonData, binData } = GltfUtilities.extractDataFromGlb(fs.readFileSync(file));
  const gltf = JSON.parse(jsonData.toString('utf8'));
  const { schema, propertyTables } = gltf.extensions?.EXT_structural_metadata ?? { propertyTables: [] };
  return propertyTables.flatMap((propertyTable) => {
    const bufferViewsData = gltf.bufferViews.map(({ byteOffset, byteLength }) =>
      binData.subarray(byteOffset, byteOffset + byteLength),
    );
    const binaryMetadata = {
      metadataClass: schema.classes[propertyTable.class],
      binaryEnumInfo: { enumValueTypes: {}, enumValueNameValues: {}, enumValueValueNames: {} },
      binaryBufferStructure: { buffers: gltf.buffers, bufferViews: gltf.bufferViews },
      binaryBufferData: { buffersData: [binData], bufferViewsData },
    };
    const model = new BinaryPropertyTableModel({ propertyTable, binaryMetadata });
    return Array.from({ length: propertyTable.count }, (_, row) => {
      const entity = model.getMetadataEntityModel(row);
      return Object.fromEntries(Object.keys(propertyTable.properties).map((key) => [key, entity.getPropertyValue(key)]));
    });
  });
}

const file = path.resolve(process.argv[2]);
const folder = path.dirname(file);
const tileset = JSON.parse(fs.readFileSync(file, 'utf8'));
const entity = MetadataEntityModels.create(tileset.schema, tileset.metadata);
const metadata = Object.fromEntries(
  Object.keys(tileset.metadata.properties).map((key) => [key, entity.getPropertyValue(key)]),
);
const tiles = [];
const traverser = new TilesetTraverser(folder, ResourceResolvers.createFileResourceResolver(folder));
await traverser.traverse(tileset, async (traversed) => {
  const uris = traversed.getFinalContents().map(({ uri }) => uri);
  const contents = uris.flatMap((uri) => parts(path.join(folder, decodeURIComponent(uri))));
  tiles.push({ level: traversed.level, geometric_error: traversed.asFinalTile().geometricError, uris, parts: contents });
  return true;
});
console.log(JSON.stringify({ metadata, tiles }));
