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
const stemOf = (uri) => decodeURIComponent(uri.split('/').at(-1)).replace(/(_lod\d+)?\.\w+$/, '');
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
const uriOf = (header) => header.content?.uri ?? header.content?.url ?? header.contents?.[0]?.uri;
const isTileset = (uri) => /\.json$/i.test(uri.split('?')[0]);

function figureTiles(root) {
  const found = [];
  const pending = [root];
  while (pending.length) {
    const tile = pending.pop();
    const uri = uriOf(tile._header);
    if (uri && !isTileset(uri)) found.push(tile);
    else pending.push(...[...tile.children].reverse());
  }
  return found;
}

function chainOf(tile) {
  const tiles = [tile];
  while (tiles.at(-1).children.length === 1) tiles.push(tiles.at(-1).children[0]);
  return tiles.reverse();
}

// What a file says of a figure: metadata of 3D Tiles 1.1, extras of 1.0.
function saidOf(header, given) {
  const facts = header.metadata?.properties ?? header.extras ?? given.metadata;
  const { name, copyright, credit = copyright ?? given.credit, figureHeight, figure_height_m, ...metadata } = facts;
  return { name: name ?? given.name, credit, metadata, tall: figureHeight ?? figure_height_m };
}

const ecefFromContent = (transform) => Cesium.Matrix4.multiply(transform, Cesium.Axis.Y_UP_TO_Z_UP, new Cesium.Matrix4());

// Smallest geometric error above a figure: where it covers too little of the screen, CesiumJS draws nothing of it.
// It always looks into further files, whatever the error of the tile that names them.
function errorAbove(tile, tileset) {
  const errors = [tileset._geometricError];
  for (let above = tile.parent; above; above = above.parent) if (!above.hasTilesetContent) errors.push(above.geometricError);
  return Math.min(...errors);
}

const awayFrom = (sphere, camera) => Math.max(0, Cesium.Cartesian3.distance(camera.positionWC, sphere.center) - sphere.radius);

// Figures in files that CesiumJS has not opened yet, as it opens those that the camera is near: to be listed and flown to.
async function distantFigures(url, given, transform, opened, above = Infinity, found = []) {
  const { BoundingSphere, Cartesian3, Matrix3, Matrix4, OrientedBoundingBox } = Cesium;
  const { root, geometricError } = await (await fetch(url)).json();
  const pending = [{ header: root, frame: transform, errorAbove: Math.min(above, opened ? geometricError : Infinity) }];
  while (pending.length) {
    const { header, frame, errorAbove } = pending.pop();
    const matrix = header.transform ? Matrix4.multiply(frame, Matrix4.unpack(header.transform), new Matrix4()) : frame;
    const uri = uriOf(header);
    if (uri && isTileset(uri)) {
      await distantFigures(new URL(uri, new URL(url, location.href)).href, given, matrix, false, errorAbove, found);
    } else if (uri) {
      const { box } = header.boundingVolume;
      if (opened || !box) continue;
      const centre = Matrix4.multiplyByPoint(matrix, Cartesian3.unpack(box), new Cartesian3());
      const axes = Matrix3.multiply(Matrix4.getMatrix3(matrix, new Matrix3()), Matrix3.unpack(box, 3), new Matrix3());
      const sphere = BoundingSphere.fromOrientedBoundingBox(new OrientedBoundingBox(centre, axes));
      const place = placeOf(ecefFromContent(matrix));
      const { tall, ...said } = saidOf(header, given);
      found.push({
        kind: 'tiles', ...said, distant: true, drawn: null, errorAbove, away: (camera) => awayFrom(sphere, camera), sphere: () => BoundingSphere.clone(sphere), place: () => place,
        ground: place ? place.height_m : 0, size: tall ?? 2 * sphere.radius, models: () => [], features: () => [], levels: [],
        shownLevel: () => -1, owns: () => false, show: () => {},
      });
      continue;
    }
    pending.push(...(header.children ?? []).map((child) => ({ header: child, frame: matrix, errorAbove: Math.min(errorAbove, header.geometricError) })).reverse());
  }
  return found;
}

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
    const { tall, ...said } = saidOf(tile._header, given);
    const volume = tile.boundingVolume.boundingVolume;
    const up = volume?.halfAxes ? 2 * Cartesian3.magnitude(Matrix3.getColumn(volume.halfAxes, 2, new Cartesian3())) : undefined;
    const place = placeOf(ecefFromContent(tile.computedTransform));
    return {
      kind: 'tiles', ...said, drawn: tileset, tile, errorAbove: errorAbove(tile, tileset),
      away: () => tile.distanceToTile(viewer.scene.frameState),
      sphere: () => BoundingSphere.clone(tile.boundingSphere), place: () => place, ground: place ? place.height_m : 0,
      size: tall ?? up ?? 2 * tile.boundingSphere.radius,
      models: () => chain.map((each) => each.content?._model).filter(Boolean),
      features: () => chain.filter((each) => each.contentReady).flatMap((each) => featuresOfContent(each.content)),
      levels: chain.map((each) => ({ error: errors.get(each), get triangles() { return each.contentReady ? each.content.trianglesLength : undefined; } })),
      shownLevel: () => levelOf.get(chain.find((each) => visible.has(each))) ?? -1,
      owns: (picked) => mine.has(picked.content?.tile ?? picked.content?._tile),
      show: (on) => { tileset.show = on; },
    };
  };

  const found = figureTiles(tileset.root).map(make);
  // Several models without a name each: told apart by their files.
  if (found.length > 1) for (const each of found) if (each.name === given.name) each.name = stemOf(uriOf(each.tile._header));
  const distant = await distantFigures(given.url, given, Matrix4.IDENTITY, true);
  found.push(...distant);

  const force = (tile) => {
    const level = levelOf.get(tile);
    if (level === undefined) return;
    // Finer than what is asked for never loads, coarser is always refined: whatever the distance.
    tile.geometricError = found.forced === null ? errors.get(tile) : level > found.forced ? 1e12 : 0;
  };
  Object.assign(found, {
    forced: null,
    force: (level) => { found.forced = level; for (const tile of levelOf.keys()) force(tile); },
  });
  tileset.tileLoad.addEventListener((tile) => {
    if (tile.hasTilesetContent) {
      // A tileset within this one: its figures take the places of those that were only listed.
      for (const figure of tile.children.flatMap(figureTiles).filter((each) => !levelOf.has(each)).map(make)) {
        const { center } = figure.sphere();
        const listed = distant.find((each) => !each.real && each.name === figure.name && Cartesian3.distance(each.sphere().center, center) < 1);
        if (listed) listed.real = figure;
        found.late?.(figure, listed);
      }
      if (found.forced !== null) found.force(found.forced);
    }
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
    const { credit = properties.copyright ?? given.credit, figure_height_m: tall, ...rest } = properties;
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
    const size = () => tall ?? 2 * (ready()?.boundingSphere.radius ?? 1);
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
      sphere: () => sphere, ground: at.height > 0 || at.height < 0 ? at.height : 0, size: rest.figure_height_m ?? 2 * sphere.radius,
      models: () => [], features: () => [], levels: [], shownLevel: () => -1,
      place: () => ({
        lon_deg: Cesium.Math.toDegrees(at.longitude), lat_deg: Cesium.Math.toDegrees(at.latitude), height_m: at.height,
        heading_deg: Number.isFinite(heading) ? heading : 180, feet: Cartesian3.clone(sphere.center),
      }),
      owns: (picked) => picked.id === entity, show: (on) => { entity.show = on; },
    };
  });
}

const LOADERS = { model: loadModel, tileset: loadTileset, czml: loadCzml, geojson: loadGeoJson };
