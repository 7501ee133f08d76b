// What CesiumJS draws of a tileset, by its own tiles, distances and screen space errors; no browser needed.
//
// stdin:  {tileset: path, views: [{lon_deg, lat_deg, height_m}, ...]}, cameras that look everywhere at once, in a
//         drawing buffer of 1920 x 1080 with the default field of view
// stdout: [{drawn: [uri, ...], files: number of tileset files loaded, visited: number of tiles}, ...]
//
// The order of decisions is that of Cesium3DTilesetBaseTraversal and Cesium3DTilesetTraversal, without loading over
// time; tiles, volumes, distances and errors are CesiumJS's. dynamicScreenSpaceError, which shortens the range of views
// to the horizon near the ground, is off.
import fs from 'node:fs';
import path from 'node:path';
import { require } from './packages.mjs';

const { Cartesian3, Cartographic, Cesium3DTile, Cesium3DTileRefine, Ellipsoid, Matrix4, MetadataSchema, PerspectiveFrustum, SceneMode } =
  require('cesium');

const { tileset: file, views } = JSON.parse(fs.readFileSync(0, 'utf8'));
const folder = path.dirname(path.resolve(file));
const read = (name) => JSON.parse(fs.readFileSync(path.join(folder, decodeURIComponent(name)), 'utf8'));
const first = read(path.basename(file));
const LIMIT = 16;
const tileset = {
  modelMatrix: Matrix4.IDENTITY,
  ellipsoid: Ellipsoid.WGS84,
  _geometricError: first.geometricError,
  _scaledGeometricError: first.geometricError,
  schema: first.schema && MetadataSchema.fromJson(first.schema),
  dynamicScreenSpaceError: false,
};

function build(header, parent) {
  const tile = new Cesium3DTile(tileset, folder, header, parent);
  tile.uri = header.content?.uri;
  tile.external = tile.uri?.endsWith('.json');
  for (const child of header.children ?? []) {
    tile.children.push(build(child, tile));
  }
  return tile;
}

const root = build(first.root, undefined);

function select({ lon_deg, lat_deg, height_m }) {
  const positionWC = Cartesian3.fromDegrees(lon_deg, lat_deg, height_m);
  const frustum = new PerspectiveFrustum({ fov: Math.PI / 3, aspectRatio: 1920 / 1080 });
  const frameState = {
    mode: SceneMode.SCENE3D,
    pixelRatio: 1,
    context: { drawingBufferWidth: 1920, drawingBufferHeight: 1080 },
    camera: { frustum, positionWC, positionCartographic: Cartographic.fromDegrees(lon_deg, lat_deg, height_m) },
  };
  const measure = (tile) => {
    tile._distanceToCamera = tile.distanceToTile(frameState);
    return tile;
  };
  const error = (tile, ofParent) => measure(tile).getScreenSpaceError(frameState, ofParent);
  const drawn = [];
  const files = new Set();
  let visited = 0;

  const visit = (tile, parentExternal) => {
    // meetsScreenSpaceErrorEarly
    if (tile.parent && !parentExternal && tile.parent.refine === Cesium3DTileRefine.ADD && error(tile, true) <= LIMIT) {
      return false;
    }
    visited += 1;
    if (tile.external) {
      files.add(tile.uri);
      if (!tile.children.length) {
        tile.children.push(build(read(tile.uri).root, tile));
      }
      return visit(tile.children[0], true);
    }
    const refines = tile.children.length > 0 && error(tile, false) > LIMIT;
    const below = refines ? tile.children.map((child) => visit(child, false)).some(Boolean) : false;
    if (tile.uri && (tile.refine === Cesium3DTileRefine.ADD || !below)) {
      drawn.push(decodeURIComponent(tile.uri));
    }
    return true;
  };
  if (error(root, true) > LIMIT) {
    visit(root, false);
  }
  return { drawn, files: files.size, visited };
}

const facts = (tile) => Object.fromEntries((tile.metadata?.getPropertyIds([]) ?? []).map((id) => [id, tile.metadata.getProperty(id)]));
const metadata = {};
const collect = (tile) => {
  if (tile.uri && !tile.external) {
    metadata[decodeURIComponent(tile.uri)] = facts(tile);
  }
  tile.children.forEach(collect);
};
const selected = views.map(select);
collect(root);
console.log(JSON.stringify({ views: selected, metadata }));
