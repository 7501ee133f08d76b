// CesiumJS; `folder` in the options is where the build for pages of a version is served.
import { frames } from './three_scene.js';
import { script } from './scripts.js';

export async function start(host, { folder }) {
  window.CESIUM_BASE_URL = `/${folder}/`;
  await script(`/${folder}/Cesium.js`);
  const { Cesium } = window;
  const { Cartesian3, CesiumWidget, Color, HeadingPitchRoll, Matrix4, Transforms, Math: Angle } = Cesium;
  const element = document.createElement('div');
  host.append(element);
  const widget = new CesiumWidget(element, {
    useDefaultRenderLoop: false, globe: false, baseLayer: false, skyBox: false, skyAtmosphere: false, shadows: false,
    msaaSamples: 1, orderIndependentTranslucency: false, contextOptions: { webgl: { preserveDrawingBuffer: true } },
    creditContainer: document.createElement('div'),
  });
  const { scene } = widget;
  for (const name of ['sun', 'moon']) if (scene[name]) scene[name].show = false;
  scene.backgroundColor = Color.WHITE;

  // Light of the sky round a model fills cubes of textures over many frames: up to ten seconds a tileset without a GPU.
  const environmentMapOptions = { enabled: false };

  const figureOf = (model) => model.sceneGraph._runtimeNodes.flatMap((node) => (node?.runtimePrimitives ?? []).map(({ primitive }) => {
    const { min, max } = primitive.attributes.find(({ semantic }) => semantic === 'POSITION');
    const matrix = Matrix4.multiply(model.sceneGraph.computedModelMatrix, node.computedTransform, new Matrix4());
    return { name: node._node?.name ?? node._name ?? '', matrix: Matrix4.pack(matrix, []), low: Cartesian3.pack(min, []), high: Cartesian3.pack(max, []) };
  }));
  const modelsIn = (collection) => Array.from({ length: collection.length }, (_, i) => collection.get(i)).flatMap((each) => {
    if (each instanceof Cesium.Model) return each.ready && each._texturesLoaded ? [each] : [];
    return each instanceof Cesium.PrimitiveCollection ? modelsIn(each) : [];
  });

  const kinds = {
    async gltf({ url, place }) {
      const position = Cartesian3.fromDegrees(place.lon_deg, place.lat_deg, place.height_m);
      const turn = new HeadingPitchRoll(Angle.toRadians(place.bearing_deg - 90), 0, 0);
      const modelMatrix = Transforms.headingPitchRollToFixedFrame(position, turn);
      const model = scene.primitives.add(await Cesium.Model.fromGltfAsync({ url, modelMatrix, scene, environmentMapOptions, incrementallyLoadTextures: false }));
      return { close: () => scene.primitives.remove(model), ready: () => model.ready, figures: () => figureOf(model) };
    },
    async tiles({ url }) {
      const tileset = scene.primitives.add(await Cesium.Cesium3DTileset.fromUrl(url, { environmentMapOptions }));
      const failed = [];
      tileset.tileFailed.addEventListener(({ message }) => failed.push(message));
      const selected = () => tileset._selectedTiles;
      return {
        close: () => scene.primitives.remove(tileset),
        ready: () => {
          if (failed.length) throw new Error(failed[0]);
          return tileset.tilesLoaded && selected().length > 0;
        },
        figures: () => selected().flatMap((tile) => figureOf(tile.content._model).map((each) => ({ ...each, tile: tile.content.url }))),
        rows: (count) => { tileset.maximumScreenSpaceError = 16 * (scene.drawingBufferHeight / count); },
      };
    },
    async czml({ url }) {
      const sources = new Cesium.DataSourceCollection();
      const display = new Cesium.DataSourceDisplay({ scene, dataSourceCollection: sources });
      await sources.add(await Cesium.CzmlDataSource.load(url));
      const tick = () => display.update(widget.clock.currentTime);
      scene.preRender.addEventListener(tick);
      return {
        close: () => { scene.preRender.removeEventListener(tick); display.destroy(); },
        ready: () => display.ready && modelsIn(scene.primitives).length > 0,
        figures: () => modelsIn(scene.primitives).flatMap((model) => figureOf(model)),
      };
    },
    // A pin; what has no size has its position alone.
    async geojson({ url }) {
      const source = await Cesium.GeoJsonDataSource.load(url);
      const [entity] = source.entities.values;
      const position = entity.position.getValue(widget.clock.currentTime);
      const matrix = Matrix4.pack(Matrix4.fromTranslation(position), []);
      return { ready: () => true, figures: () => [{ name: entity.name, matrix, low: [0, 0, 0], high: [0, 0, 0] }] };
    },
  };

  return {
    version: Cesium.VERSION,
    end: () => { widget.destroy(); },
    async open(job) {
      const output = await kinds[job.kind](job);
      return {
        close: output.close,
        async look({ eye, target, up, fov_deg: fov, rows }) {
          const direction = Cartesian3.subtract(Cartesian3.unpack(target), Cartesian3.unpack(eye), new Cartesian3());
          Cartesian3.normalize(direction, direction);
          const right = Cartesian3.cross(direction, Cartesian3.unpack(up), new Cartesian3());
          Cartesian3.normalize(right, right);
          const { camera } = scene;
          // CesiumJS takes the angle of the longer side.
          const aspect = innerWidth / innerHeight;
          const half = Math.tan(Angle.toRadians(fov / 2)) * Math.max(1, aspect);
          Object.assign(camera.frustum, { fov: 2 * Math.atan(half), aspectRatio: aspect, near: 0.1 });
          camera.setView({ destination: Cartesian3.unpack(eye), orientation: { direction, up: Cartesian3.cross(right, direction, new Cartesian3()) } });
          if (rows) output.rows(rows);
          for (let still = 0; still < 3;) {
            widget.resize();
            widget.clock.tick();
            scene.render();
            await frames(1);
            still = output.ready() ? still + 1 : 0;
          }
          return output.figures();
        },
      };
    },
  };
}
