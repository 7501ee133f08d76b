// Where CesiumJS puts the models of a CZML document, by its own arithmetic; no browser needed.
//
// stdin:  path of the document
// stdout: [{id, name, model, height_reference, lon_deg, lat_deg, height_m, bearing_deg, tilt_deg, description}, ...]
import fs from 'node:fs';
import path from 'node:path';
import { pathToFileURL } from 'node:url';
import { require } from './packages.mjs';

const {
  Axis, Cartesian3, Cartographic, CzmlDataSource, HeightReference, JulianDate, Math: CesiumMath, Matrix3, Matrix4,
  Quaternion, Transforms,
} = require('cesium');

const file = path.resolve(JSON.parse(fs.readFileSync(0, 'utf8')));
const degrees = CesiumMath.toDegrees;
// CesiumJS asks the page for the base of relative addresses; while it was loaded, no page had to be there.
for (const name of ['Image', 'HTMLImageElement', 'HTMLCanvasElement', 'HTMLVideoElement']) {
  globalThis[name] ??= class {};
}
globalThis.document = { baseURI: pathToFileURL(file).href, location: { href: pathToFileURL(file).href } };

const source = await CzmlDataSource.load(JSON.parse(fs.readFileSync(file, 'utf8')), {
  sourceUri: pathToFileURL(file).href,
});
const time = JulianDate.now();
// What Model does to glTF: y-up to z-up, then z-forward to x-forward.
const correction = Matrix4.multiplyTransformation(Axis.Y_UP_TO_Z_UP, Axis.Z_UP_TO_X_UP, new Matrix4());
const found = source.entities.values.map((entity) => {
  const position = entity.position.getValue(time);
  const rotation = Matrix3.fromQuaternion(entity.orientation.getValue(time, new Quaternion()));
  const matrix = Matrix4.multiply(Matrix4.fromRotationTranslation(rotation, position), correction, new Matrix4());
  const nose = Matrix4.multiplyByPointAsVector(matrix, new Cartesian3(0, 0, 1), new Cartesian3());
  const head = Matrix4.multiplyByPointAsVector(matrix, new Cartesian3(0, 1, 0), new Cartesian3());
  const enuFromEcef = Matrix4.inverseTransformation(Transforms.eastNorthUpToFixedFrame(position), new Matrix4());
  const { x: east, y: north, z: up } = Matrix4.multiplyByPointAsVector(enuFromEcef, nose, new Cartesian3());
  const upright = Matrix4.multiplyByPointAsVector(enuFromEcef, head, new Cartesian3()).z;
  const { longitude, latitude, height } = Cartographic.fromCartesian(position);
  const reference = entity.model.heightReference.getValue(time);
  return {
    id: entity.id,
    name: entity.name,
    model: entity.model.uri.getValue(time).getUrlComponent?.() ?? String(entity.model.uri.getValue(time)),
    height_reference: Object.keys(HeightReference).find((key) => HeightReference[key] === reference),
    position: [position.x, position.y, position.z],
    lon_deg: degrees(longitude),
    lat_deg: degrees(latitude),
    height_m: height,
    bearing_deg: degrees(CesiumMath.zeroToTwoPi(Math.atan2(east, north))),
    tilt_deg: degrees(Math.atan2(up, Math.hypot(east, north))),
    upright,
    description: entity.description.getValue(time),
  };
});
console.log(JSON.stringify(found));
