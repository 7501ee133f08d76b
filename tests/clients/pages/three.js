import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MTLLoader } from 'three/addons/loaders/MTLLoader.js';
import { OBJLoader } from 'three/addons/loaders/OBJLoader.js';
import { PLYLoader } from 'three/addons/loaders/PLYLoader.js';
import { USDLoader } from 'three/addons/loaders/USDLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { figuresIn, frames, newRenderer, newScene, placeCamera } from './three_scene.js';

const loaders = {
  async gltf(url) {
    const loader = new GLTFLoader();
    loader.setMeshoptDecoder(MeshoptDecoder);
    return (await loader.loadAsync(url)).scene;
  },
  async obj(url) {
    const folder = url.slice(0, url.lastIndexOf('/') + 1);
    const materials = await new MTLLoader().setPath(folder).loadAsync(url.slice(folder.length).replace('.obj', '.mtl'));
    materials.preload();
    await Promise.all(Object.values(materials.materials).map((material) => material.map && loaded(material.map)));
    return new OBJLoader().setMaterials(materials).loadAsync(url);
  },
  async ply(url) {
    const geometry = await new PLYLoader().loadAsync(url);
    return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ vertexColors: true }));
  },
  async usd(url) {
    const root = await new USDLoader().loadAsync(url);
    return root;
  },
};

async function loaded(texture) {
  while (!texture.image?.width) await frames(1);
}

export async function start(host) {
  const renderer = newRenderer(host);
  const camera = new THREE.PerspectiveCamera();
  return {
    end: () => { renderer.dispose(); renderer.forceContextLoss(); },
    async open({ kind, url }) {
      const scene = newScene();
      const root = await loaders[kind](url);
      scene.add(root);
      return {
        close: () => scene.clear(),
        async look(view) {
          placeCamera(camera, view);
          for (let i = 0; i < 3; i += 1) {
            renderer.render(scene, camera);
            await frames(1);
          }
          return figuresIn(root);
        },
      };
    },
  };
}
