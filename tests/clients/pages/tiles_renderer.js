import * as THREE from 'three';
import { TilesRenderer } from '3d-tiles-renderer';
import { GLTFExtensionsPlugin } from '3d-tiles-renderer/plugins';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { figuresIn, frames, newRenderer, newScene, placeCamera } from './three_scene.js';

export async function start(host) {
  const renderer = newRenderer(host);
  const camera = new THREE.PerspectiveCamera();
  return {
    end: () => { renderer.dispose(); renderer.forceContextLoss(); },
    async open({ url }) {
      const scene = newScene();
      const tiles = new TilesRenderer(new URL(url, location.href).href);
      tiles.registerPlugin(new GLTFExtensionsPlugin({ metadata: true, meshoptDecoder: MeshoptDecoder }));
      const failed = [];
      tiles.addEventListener('load-error', (event) => failed.push(String(event.error?.message ?? event.error)));
      tiles.setCamera(camera);
      tiles.setResolutionFromRenderer(camera, renderer);
      scene.add(tiles.group);
      return {
        close: () => tiles.dispose(),
        async look(view) {
          placeCamera(camera, view);
          for (let still = 0; still < 10 || !tiles.visibleTiles.size;) {
            tiles.update();
            renderer.render(scene, camera);
            await frames(1);
            if (failed.length) throw new Error(failed[0]);
            still = tiles.loadProgress === 1 ? still + 1 : 0;
          }
          return figuresIn(tiles.group);
        },
      };
    },
  };
}
