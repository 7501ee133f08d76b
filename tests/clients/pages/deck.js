import { Deck, MapView } from '@deck.gl/core';
import { Tile3DLayer } from '@deck.gl/geo-layers';
import { ScenegraphLayer } from '@deck.gl/mesh-layers';
import { load } from '@loaders.gl/core';
import { GLTFLoader, postProcessGLTF } from '@loaders.gl/gltf';
import { Tiles3DLoader } from '@loaders.gl/3d-tiles';
import { Matrix4 } from '@math.gl/core';
import { frames } from './three_scene.js';

// Bounds of an accessor; those of normalized integers are the integers.
function boundsOf({ min, max, normalized, componentType }) {
  const one = normalized ? { 5120: 127, 5121: 255, 5122: 32767, 5123: 65535 }[componentType] : 1;
  return { low: min.map((value) => value / one), high: max.map((value) => value / one) };
}

// What the nodes of a scene hold, in the frame that `matrix` leads from.
function figuresIn(gltf, matrix) {
  const visit = (node, above) => {
    const own = new Matrix4(above);
    if (node.matrix) own.multiplyRight(node.matrix);
    else {
      if (node.translation) own.translate(node.translation);
      if (node.rotation) own.multiplyRight(new Matrix4().fromQuaternion(node.rotation));
      if (node.scale) own.scale(node.scale);
    }
    const mine = (node.mesh?.primitives ?? []).map(({ attributes: { POSITION } }) => ({ name: node.name, matrix: [...own], ...boundsOf(POSITION) }));
    return [...mine, ...(node.children ?? []).flatMap((child) => visit(child, own))];
  };
  return (gltf.scene ?? gltf.scenes[0]).nodes.flatMap((node) => visit(node, matrix));
}

export async function start(host) {
  const element = document.createElement('div');
  host.append(element);
  let failed = null;
  const deck = await new Promise((done) => {
    const made = new Deck({
      parent: element, useDevicePixels: false, controller: false, views: [new MapView({ id: 'view' })],
      initialViewState: { longitude: 0, latitude: 0, zoom: 1 }, onError: (error) => { failed = error; }, layers: [],
      onLoad: () => done(made),
    });
  });

  const kinds = {
    async gltf({ url: path, place }) {
      const url = new URL(path, location.href).href;
      const gltf = postProcessGLTF(await load(url, GLTFLoader));
      // By its address, the layer does not load the buffer beside a .gltf.
      const scenegraph = url.endsWith('.gltf') ? postProcessGLTF(await load(url, GLTFLoader)) : url;
      const layer = new ScenegraphLayer({
        id: url, data: [place], scenegraph, _lighting: 'flat', getPosition: (d) => [d.lon_deg, d.lat_deg, d.height_m],
        getOrientation: (d) => [0, 180 - d.bearing_deg, 90], sizeScale: 1,
      });
      return { layer, ready: () => Boolean(layer.isLoaded), figures: () => figuresIn(gltf, new Matrix4()) };
    },
    async tiles({ url }) {
      const loaded = new Map();
      let error = null;
      const layer = new Tile3DLayer({
        id: url, data: new URL(url, location.href).href, loader: Tiles3DLoader, onTileLoad: (tile) => loaded.set(tile.id, tile), onTileUnload: (tile) => loaded.delete(tile.id),
        onTileError: (tile, message) => { error = message; },
      });
      const shown = () => [...loaded.values()].filter((tile) => tile.selected && tile.content?.gltf);
      return {
        layer,
        ready: () => {
          if (error) throw new Error(String(error));
          return layer.state?.tileset3d?.isLoaded() && shown().length > 0;
        },
        figures: () => shown().flatMap((tile) => figuresIn(tile.content.gltf, tile.content.cartesianModelMatrix)),
      };
    },
  };

  return {
    end: () => deck.finalize(),
    async open(job) {
      failed = null;
      const output = await kinds[job.kind](job);
      deck.setProps({ layers: [output.layer] });
      return {
        close: () => deck.setProps({ layers: [] }),
        // A map seen from above at 60 degrees, with the figure in its middle.
        async look({ seen: { lon_deg: longitude, lat_deg: latitude, height_m: height }, bearing_deg: bearing, rows_per_m: rows }) {
          const zoom = Math.log2((rows * 40075016.7 * Math.cos((latitude * Math.PI) / 180)) / 512);
          const position = [0, 0, height];
          deck.setProps({ initialViewState: { longitude, latitude, position, zoom, bearing, pitch: 60, maxZoom: 30, id: `${bearing}` } });
          for (let still = 0; still < 10;) {
            await frames(1);
            if (failed) throw failed;
            still = output.ready() ? still + 1 : 0;
          }
          return output.figures();
        },
      };
    },
  };
}
