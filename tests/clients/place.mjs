// Where CesiumJS puts a figure, by its own arithmetic; no browser needed.
//
// stdin:  [{tileset, lon_deg, lat_deg, height_m}, ...]
// stdout: [{feet_error_m, bearing_deg, tilt_deg}, ...]: the distance from the feet to the place asked for, the compass
//         bearing of the nose, and how far the nose points above the horizon
import fs from 'node:fs';
import { require } from './packages.mjs';

const { Axis, Cartesian3, Math: CesiumMath, Matrix4, Transforms } = require('cesium');

function place({ tileset, lon_deg, lat_deg, height_m }) {
  const { root } = JSON.parse(fs.readFileSync(tileset, 'utf8'));
  // What Cesium3DTile does to glTF content: y-up to z-up, then the transforms of the tiles.
  const ecefFromAsset = Matrix4.multiply(Matrix4.unpack(root.transform), Axis.Y_UP_TO_Z_UP, new Matrix4());
  const feet = Matrix4.multiplyByPoint(ecefFromAsset, Cartesian3.ZERO, new Cartesian3());
  const nose = Matrix4.multiplyByPoint(ecefFromAsset, new Cartesian3(0, 0, 1), new Cartesian3());

  const asked = Cartesian3.fromDegrees(lon_deg, lat_deg, height_m);
  const enuFromEcef = Matrix4.inverseTransformation(Transforms.eastNorthUpToFixedFrame(asked), new Matrix4());
  const direction = Cartesian3.subtract(nose, feet, new Cartesian3());
  const { x: east, y: north, z: up } = Matrix4.multiplyByPointAsVector(enuFromEcef, direction, new Cartesian3());
  return {
    feet_error_m: Cartesian3.distance(feet, asked),
    bearing_deg: CesiumMath.toDegrees(CesiumMath.zeroToTwoPi(Math.atan2(east, north))),
    tilt_deg: CesiumMath.toDegrees(Math.atan2(up, Math.hypot(east, north))),
  };
}

console.log(JSON.stringify(JSON.parse(fs.readFileSync(0, 'utf8')).map(place)));
