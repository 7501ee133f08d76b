import * as itowns from 'itowns';
import * as THREE from 'three';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { frames } from './three_scene.js';

export async function start(host) {

  itowns.enableMeshoptDecoder(MeshoptDecoder);
  const element = document.createElement('div');
  host.append(element);
  const view = new itowns.View('EPSG:4978', element, { noControls: true });
  view.scene.background = new THREE.Color('#fff');
  view.scene.add(new THREE.AmbientLight('#fff', Math.PI));
  let count = 0;
  return {
    end: () => view.dispose(),
    async open({ url }) {
      count += 1;
      const source = new itowns.OGC3DTilesSource({ url: new URL(url, location.href).href });
      const layer = new itowns.OGC3DTilesLayer(`tiles${count}`, { source });
      itowns.View.prototype.addLayer.call(view, layer);
      await layer.whenReady;
      return {
        close: () => view.removeLayer(layer.id),
        async look({ eye, target, up, fov_deg: fov }) {
          const camera = view.camera3D;
          Object.assign(camera, { fov, near: 0.1, far: 1000, aspect: innerWidth / innerHeight });
          camera.position.set(...eye);
          camera.up.set(...up);
          camera.lookAt(...target);
          camera.updateProjectionMatrix();
          camera.updateMatrixWorld(true);
          const root = layer.object3d;
          const found = () => {
            const meshes = [];
            root.updateWorldMatrix(true, true);
            root.traverseVisible((mesh) => mesh.isMesh && meshes.push(mesh));
            return meshes;
          };
          for (let still = 0; still < 20;) {
            view.notifyChange(camera);
            await frames(1);
            still = found().length && layer.tilesRenderer.loadProgress === 1 ? still + 1 : 0;
          }
          return found().map((mesh) => {
            mesh.geometry.computeBoundingBox();
            const { min, max } = mesh.geometry.boundingBox;
            return { name: mesh.name, matrix: [...mesh.matrixWorld.elements], low: min.toArray(), high: max.toArray() };
          });
        },
      };
    },
  };
}
