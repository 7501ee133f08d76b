// The figure as a billboard on a globe: drawn anew when the camera goes round it, with nothing loaded from elsewhere.
'use strict';

const STEP = 5; // degrees: views of the figure are this far apart
const LIKE_SCREEN = [128, 192, 256, 384, 512, 768, 1024]; // pixels an edge
const UNIT = 1024; // CesiumJS rounds a billboard's width to whole metres before it is scaled
const MOST_PIXELS = 2 ** 24; // of all views that are kept, before they are given up and begun anew

const find = (id) => document.getElementById(id);

function fail(error) {
  find('message').textContent = error.message;
  find('message').hidden = false;
  console.error(error);
}

async function start() {
  const viewer = offlineViewer('globe', { maximumRenderTimeChange: Infinity });
  const { scene, camera } = viewer;
  const { Cartesian3, Matrix4, Math: Angle } = Cesium;
  const figure = JSON.parse(find('figure').textContent);
  const place = JSON.parse(find('place').textContent);
  const canvas = document.createElement('canvas');
  const view = new FigureView(canvas, figure, await decodeFigure(figure), find('shader').textContent);

  // The square picture shows everything around the figure's centre that any side of it may show; so its middle lies
  // where the centre does, from wherever the camera looks.
  const scale = figure.metres_per_unit;
  const edge = 1.04 * view.diagonal;
  Object.assign(view, { height: edge });
  const feet = Cartesian3.fromDegrees(place.lon_deg, place.lat_deg, place.height_m);
  const ecefFromEnu = Cesium.Transforms.eastNorthUpToFixedFrame(feet);
  const enuFromEcef = Matrix4.inverseTransformation(ecefFromEnu, new Matrix4());
  const [x, y, z] = view.centre.map((c, i) => scale * (c - figure.feet[i]));
  // The nose, +z, points to the heading; the figure's left, +x, a quarter turn before it.
  const bearing = Angle.toRadians(place.heading_deg);
  const [sin, cos] = [Math.sin(bearing), Math.cos(bearing)];
  const local = new Cartesian3(z * sin - x * cos, z * cos + x * sin, y);
  const centre = Matrix4.multiplyByPoint(ecefFromEnu, local, new Cartesian3());

  // A view is loaded into the billboard that is hidden, and they change places when it is there: nothing flickers.
  let billboards = null;
  let [front, back] = [null, null];
  let pictures = new Map();
  const shown = { id: '', yaw: 0, pitch: 0, draws: 0, pending: false };

  function begin() {
    if (billboards) scene.primitives.remove(billboards);
    billboards = scene.primitives.add(new Cesium.BillboardCollection({ scene }));
    [front, back] = [0, 1].map(() => billboards.add({
      position: centre, show: false, sizeInMeters: true, width: UNIT, height: UNIT, scale: (scale * edge) / UNIT,
      horizontalOrigin: Cesium.HorizontalOrigin.CENTER, verticalOrigin: Cesium.VerticalOrigin.CENTER,
    }));
    pictures = new Map();
  }

  function swap() {
    if (!shown.pending) return;
    if (back.ready) {
      [front, back] = [back, front];
      Object.assign(front, { show: true });
      Object.assign(back, { show: false });
      shown.pending = false;
    }
    scene.requestRender();
  }

  function picture(pixels) {
    Object.assign(canvas, { width: pixels, height: pixels });
    view.draw();
    const copy = Object.assign(document.createElement('canvas'), { width: pixels, height: pixels });
    copy.getContext('2d').drawImage(canvas, 0, 0);
    shown.draws++;
    return copy;
  }

  // Which side of the figure the camera sees, and how large.
  function look() {
    const towards = Matrix4.multiplyByPoint(enuFromEcef, camera.positionWC, new Cartesian3());
    Cartesian3.subtract(towards, local, towards);
    const seen = Angle.toDegrees(bearing - Math.atan2(towards.x, towards.y));
    const yaw = (((Math.round(seen / STEP) * STEP) % 360) + 360) % 360;
    const raised = Angle.toDegrees(Math.atan2(towards.z, Math.hypot(towards.x, towards.y)));
    const pitch = Math.round(raised / STEP) * STEP;
    const metre = scene.drawingBufferHeight / (2 * Math.tan(camera.frustum.fovy / 2) * Cartesian3.magnitude(towards));
    const needed = metre * scale * edge;
    const pixels = LIKE_SCREEN.find((n) => n >= needed) ?? LIKE_SCREEN.at(-1);
    const id = [yaw, pitch, pixels].join(' ');
    if (id === shown.id) return;
    if (!pictures.has(id)) {
      if ([...pictures.values()].reduce((sum, { width }) => sum + width ** 2, pixels ** 2) > MOST_PIXELS) begin();
      Object.assign(view.camera, { yaw, pitch });
      pictures.set(id, picture(pixels));
    }
    back.setImage(id, pictures.get(id));
    Object.assign(shown, { id, yaw, pitch, pending: true });
    scene.requestRender();
  }

  function home() {
    camera.cancelFlight();
    const away = 1.5 * scale * edge;
    // From where the nose points to, a little raised.
    const offset = new Cesium.HeadingPitchRange(bearing + Math.PI, Angle.toRadians(-12), away);
    camera.lookAt(centre, offset);
    camera.lookAtTransform(Matrix4.IDENTITY);
    look();
  }

  begin();
  scene.preRender.addEventListener(() => { try { look(); } catch (error) { fail(error); } });
  scene.postRender.addEventListener(swap);
  find('home').addEventListener('click', home);
  home();
  window.fig2mesh = { view, viewer, program: view.program, shown, feet, centre, home };
  document.documentElement.dataset.ready = 'true';
}

start().catch(fail);
