// The ground: level with a figure's feet, a grid to see sizes by, pictures that lie on it.
'use strict';

// As smooth as the ellipsoid, but so high that feet stand on it.
function groundAt(height) {
  if (height === 0) return new Cesium.EllipsoidTerrainProvider();
  const [width, rows] = [16, 16];
  return new Cesium.CustomHeightmapTerrainProvider({
    width, height: rows, callback: () => new Float32Array(width * rows).fill(height),
  });
}

// Lines round a place, 10 steps to each side, with longer ones at every tenth. Returns the step in metres.
function drawGrid(lines, feet, size) {
  const { Cartesian3, Color, Material, Matrix4, Transforms } = Cesium;
  const step = 10 ** Math.round(Math.log10(size / 1.8));
  const ecefFromEnu = Transforms.eastNorthUpToFixedFrame(feet);
  const at = (x, y) => Matrix4.multiplyByPoint(ecefFromEnu, new Cartesian3(x, y, 0), new Cartesian3());
  lines.removeAll();
  // In pieces: along a line that passes beside the camera, depth is not interpolated well enough, and what stands in
  // front of it is painted over.
  const PIECES = 100;
  const add = (offset, reach, width, colour) => {
    const along = Array.from({ length: PIECES + 1 }, (_, i) => reach * ((2 * i) / PIECES - 1));
    for (const positions of [along.map((value) => at(offset, value)), along.map((value) => at(value, offset))]) {
      lines.add({ positions, width, material: Material.fromType('Color', { color: colour }) });
    }
  };
  for (let i = -10; i <= 10; i++) if (i % 10) add(i * step, 10 * step, 1, Color.BLACK.withAlpha(0.25));
  for (let i = -5; i <= 5; i++) add(10 * i * step, 50 * step, 1.5, Color.BLACK.withAlpha(0.4));
  return step;
}

async function layOverlay(viewer, { url, rectangle }) {
  const provider = await Cesium.SingleTileImageryProvider.fromUrl(url, { rectangle: Cesium.Rectangle.fromDegrees(...rectangle) });
  return viewer.imageryLayers.addImageryProvider(provider);
}
