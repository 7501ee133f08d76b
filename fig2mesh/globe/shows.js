// What is on the globe: files become figures, each with its place, its levels of detail and its parts.
'use strict';

// Where a loaded model is: ECEF from the frame of its mesh (glTF: y up, front +z), as CesiumJS draws it.
function ecefFromMesh(model) {
  const graph = model.sceneGraph;
  const node = graph._runtimeNodes.find((each) => each?.runtimePrimitives.length);
  return Cesium.Matrix4.multiplyTransformation(graph.computedModelMatrix, node.computedTransform, new Cesium.Matrix4());
}

// Longitude, latitude, height and the compass bearing of the nose; from a matrix of `ecefFromMesh`.
function placeOf(matrix) {
  const { Cartesian3, Matrix4, Transforms, Math: Angle } = Cesium;
  const feet = Matrix4.multiplyByPoint(matrix, Cartesian3.ZERO, new Cartesian3());
  const nose = Matrix4.multiplyByPointAsVector(matrix, Cartesian3.UNIT_Z, new Cartesian3());
  const at = Cesium.Cartographic.fromCartesian(feet);
  if (!at || Cartesian3.magnitude(feet) < 6e6) return null; // in the earth: the files keep their place elsewhere
  const enuFromEcef = Matrix4.inverseTransformation(Transforms.eastNorthUpToFixedFrame(feet), new Matrix4());
  const { x: east, y: north } = Matrix4.multiplyByPointAsVector(enuFromEcef, nose, new Cartesian3());
  return {
    lon_deg: Angle.toDegrees(at.longitude), lat_deg: Angle.toDegrees(at.latitude), height_m: at.height,
    heading_deg: Angle.toDegrees(Angle.zeroToTwoPi(Math.atan2(east, north))), feet,
  };
}

const featuresOfModel = (model) => {
  const table = model?.featureTables?.[model.featureTableId];
  return table ? Array.from({ length: table.featuresLength }, (_, i) => table.getFeature(i)) : [];
};
const featuresOfContent = (content) => Array.from({ length: content.featuresLength }, (_, i) => content.getFeature(i));

async function loadModel(viewer, given) {
  const { Cartesian3, Transforms, HeadingPitchRoll, HeightReference, Math: Angle } = Cesium;
  const { place } = given;
  const position = Cartesian3.fromDegrees(place.lon_deg, place.lat_deg, place.height_m);
  const clamp = place.altitude_mode === 'clamp';
  const turn = new HeadingPitchRoll(Angle.toRadians(place.entity_heading_deg), 0, 0);
  const model = viewer.scene.primitives.add(await Cesium.Model.fromGltfAsync({
    url: given.url, scene: viewer.scene, showCreditsOnScreen: true,
    modelMatrix: Transforms.headingPitchRollToFixedFrame(position, turn),
    heightReference: clamp ? HeightReference.RELATIVE_TO_GROUND : HeightReference.NONE,
  }));
  if (!model.ready) {
    await new Promise((done, failed) => {
      model.readyEvent.addEventListener(done);
      model.errorEvent.addEventListener(failed);
      viewer.scene.requestRender();
    });
  }
  return [{
    kind: 'model', name: given.name, credit: given.credit, metadata: given.metadata, drawn: model,
    sphere: () => model.boundingSphere, place: () => placeOf(ecefFromMesh(model)), ground: clamp ? 0 : place.height_m,
    size: place.figure_height_m, models: () => [model], features: () => featuresOfModel(model),
    levels: [{ error: 0, triangles: given.triangles }], shownLevel: () => 0, owns: (picked) => picked.primitive === model,
    show: (on) => { model.show = on; },
  }];
}

// A figure is the topmost tile with a model on its branch; the chain below it is its levels, coarse to fine.
function figureTiles(root) {
  const found = [];
  const pending = [root];
  while (pending.length) {
    const tile = pending.pop();
    const uri = tile._header.content?.uri ?? tile._header.content?.url ?? tile._header.contents?.[0]?.uri;
    if (uri && !/\.json$/i.test(uri.split('?')[0])) found.push(tile);
    else pending.push(...[...tile.children].reverse());
  }
  return found;
}

function chainOf(tile) {
  const tiles = [tile];
  while (tiles.at(-1).children.length === 1) tiles.push(tiles.at(-1).children[0]);
  return tiles.reverse();
}

const valueOf = (metadata, name) => (metadata?.hasProperty?.(name) ? metadata.getProperty(name) : undefined);
const allOf = (metadata) => Object.fromEntries((metadata?.getPropertyIds?.([]) ?? []).map((id) => [id, metadata.getProperty(id)]));

async function loadTileset(viewer, given) {
  const { BoundingSphere, Matrix3, Matrix4, Cartesian3 } = Cesium;
  const tileset = viewer.scene.primitives.add(await Cesium.Cesium3DTileset.fromUrl(given.url, { showCreditsOnScreen: true }));
  const visible = new Set();
  viewer.scene.preRender.addEventListener(() => visible.clear());
  tileset.tileVisible.addEventListener((tile) => visible.add(tile));
  const errors = new Map(); // tile → its own geometric error, kept while levels are forced
  const levelOf = new Map();

  const make = (tile) => {
    const chain = chainOf(tile);
    chain.forEach((each, level) => { levelOf.set(each, level); errors.set(each, each.geometricError); });
    const mine = new Set(chain);
    const metadata = tile.metadata ?? tile.content?.metadata ?? tile.content?.group?.metadata;
    const facts = { ...given.metadata, ...allOf(metadata) };
    const { name = given.name, copyright, credit = copyright ?? given.credit, ...rest } = facts;
    const volume = tile.boundingVolume.boundingVolume;
    const up = volume?.halfAxes ? Matrix3.getColumn(volume.halfAxes, 2, new Cartesian3()) : null;
    const matrix = Matrix4.multiply(tile.computedTransform, Cesium.Axis.Y_UP_TO_Z_UP, new Matrix4());
    const place = placeOf(matrix);
    const shownTile = () => chain.find((each) => visible.has(each));
    return {
      kind: 'tiles', name: valueOf(metadata, 'name') ?? name, credit, metadata: rest, drawn: tileset, tile,
      sphere: () => BoundingSphere.clone(tile.boundingSphere), place: () => place, ground: place ? place.height_m : 0,
      size: up ? 2 * Cartesian3.magnitude(up) : 2 * tile.boundingSphere.radius,
      models: () => chain.map((each) => each.content?._model).filter(Boolean),
      features: () => chain.filter((each) => each.contentReady).flatMap((each) => featuresOfContent(each.content)),
      levels: chain.map((each) => ({ error: errors.get(each), get triangles() { return each.contentReady ? each.content.trianglesLength : undefined; } })),
      shownLevel: () => { const found = shownTile(); return found ? levelOf.get(found) : -1; },
      owns: (picked) => mine.has(picked.content?.tile ?? picked.content?._tile),
      show: (on) => { tileset.show = on; },
    };
  };

  const found = [];
  const add = (root) => {
    const fresh = figureTiles(root).filter((tile) => !levelOf.has(tile)).map(make);
    found.push(...fresh);
    return fresh;
  };
  add(tileset.root);
  const force = (tile) => {
    const level = levelOf.get(tile);
    if (level === undefined) return;
    // Finer than what is asked for never loads, coarser is always refined: whatever the distance.
    tile.geometricError = found.forced === null ? errors.get(tile) : level > found.forced ? 1e12 : 0;
  };
  Object.assign(found, {
    forced: null,
    force: (level) => { found.forced = level; for (const tile of levelOf.keys()) force(tile); },
    drawn: tileset,
  });
  // Tilesets within tilesets arrive late.
  tileset.tileLoad.addEventListener((tile) => {
    if (tile.hasTilesetContent) found.late?.(tile.children.flatMap(add));
    if (found.forced !== null) force(tile);
    found.painted?.(tile);
  });
  return found;
}

async function loadCzml(viewer, given) {
  const { Cartesian3, Matrix3, Matrix4, Quaternion, BoundingSphere, JulianDate, HeightReference } = Cesium;
  const source = await viewer.dataSources.add(Cesium.CzmlDataSource.load(given.url));
  const now = source.clock?.currentTime ?? JulianDate.now();
  const named = source.entities.values.filter((entity) => entity.position);
  const modelOf = (entity) => {
    const { primitives } = viewer.scene;
    for (let i = 0; i < primitives.length; i++) if (primitives.get(i).id === entity && primitives.get(i).sceneGraph) return primitives.get(i);
    return undefined;
  };
  return named.map((entity) => {
    const at = entity.position.getValue(now);
    const properties = entity.properties?.getValue(now) ?? {};
    const { credit = properties.copyright ?? given.credit, ...rest } = properties;
    const clamp = ![undefined, HeightReference.NONE].includes(entity.model?.heightReference?.getValue(now));
    const ready = () => { const model = modelOf(entity); return model?.ready ? model : undefined; };
    const place = () => {
      if (ready()) return placeOf(ecefFromMesh(ready()));
      // As CesiumJS will: +x of an entity is the front of its model.
      const turn = entity.orientation?.getValue(now) ?? Cesium.Transforms.headingPitchRollQuaternion(at, new Cesium.HeadingPitchRoll());
      const local = Matrix4.fromRotationTranslation(Matrix3.fromQuaternion(turn, new Matrix3()), at, new Matrix4());
      const axes = Matrix4.multiply(Cesium.Axis.Z_UP_TO_X_UP, Cesium.Axis.Y_UP_TO_Z_UP, new Matrix4());
      return placeOf(Matrix4.multiply(local, axes, new Matrix4()));
    };
    const size = () => 2 * (ready()?.boundingSphere.radius ?? 1);
    return {
      kind: 'czml', name: entity.name ?? entity.id, credit, metadata: rest, drawn: null, entity,
      sphere: () => ready()?.boundingSphere ?? new BoundingSphere(at, 1), place,
      ground: clamp ? 0 : Cesium.Cartographic.fromCartesian(at).height, get size() { return size(); },
      models: () => [ready()].filter(Boolean), features: () => featuresOfModel(ready()),
      levels: [{ error: 0 }], shownLevel: () => 0, pending: () => Boolean(entity.model) && !ready(),
      owns: (picked) => picked.id === entity || (ready() !== undefined && picked.primitive === ready()),
      show: (on) => { entity.show = on; },
    };
  });
}

async function loadGeoJson(viewer, given) {
  const { BoundingSphere, Cartesian3, JulianDate, Color } = Cesium;
  const source = await viewer.dataSources.add(Cesium.GeoJsonDataSource.load(given.url, { clampToGround: true, markerColor: Color.fromCssColorString('#c0392b') }));
  return source.entities.values.map((entity, index) => {
    const properties = entity.properties?.getValue(JulianDate.now()) ?? {};
    const ring = entity.polygon?.hierarchy?.getValue(JulianDate.now())?.positions ?? entity.polyline?.positions?.getValue(JulianDate.now());
    const sphere = ring ? BoundingSphere.fromPoints(ring) : new BoundingSphere(entity.position.getValue(JulianDate.now()), 3);
    const at = Cesium.Cartographic.fromCartesian(sphere.center);
    const { name, credit = properties.copyright ?? '', ...rest } = properties;
    const heading = Number(rest.heading_deg);
    return {
      kind: 'geojson', name: entity.name ?? name ?? `${given.name} ${index + 1}`, credit, metadata: rest, drawn: null, entity,
      sphere: () => sphere, ground: 0, size: 2 * sphere.radius, models: () => [], features: () => [], levels: [], shownLevel: () => -1,
      place: () => ({
        lon_deg: Cesium.Math.toDegrees(at.longitude), lat_deg: Cesium.Math.toDegrees(at.latitude), height_m: at.height,
        heading_deg: Number.isFinite(heading) ? heading : 180, feet: Cartesian3.clone(sphere.center),
      }),
      owns: (picked) => picked.id === entity, show: (on) => { entity.show = on; },
    };
  });
}

const LOADERS = { model: loadModel, tileset: loadTileset, czml: loadCzml, geojson: loadGeoJson };
