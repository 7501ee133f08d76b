import '@google/model-viewer/dist/model-viewer.min.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { frames } from './three_scene.js';

const symbolOf = (element, name) => {
  for (let each = element; each; each = Object.getPrototypeOf(each)) {
    const found = Object.getOwnPropertySymbols(each).find(({ description }) => description === name);
    if (found) return element[found];
  }
  throw new Error(`no ${name} in the element`);
};

export async function start(host) {
  window.MeshoptDecoder = MeshoptDecoder;
  customElements.get('model-viewer').meshoptDecoderLocation = 'data:text/javascript,';
  return {
    async open({ url }) {
      const view = document.createElement('model-viewer');
      for (const [name, value] of Object.entries({ 'interaction-prompt': 'none', loading: 'eager', reveal: 'auto', 'min-field-of-view': '5deg', 'min-camera-orbit': 'auto auto 1m', 'max-camera-orbit': 'auto auto 100m', 'interpolation-decay': '1', 'shadow-intensity': '0' })) view.setAttribute(name, value);
      const ready = new Promise((done, failed) => {
        view.addEventListener('load', done);
        view.addEventListener('error', (event) => failed(new Error(String(event.detail?.sourceError?.message ?? event.detail?.type))));
      });
      view.src = url;
      const bar = document.createElement('div');
      bar.slot = 'progress-bar';
      view.append(bar);
      host.append(view);
      await ready;
      return {
        close: () => view.remove(),
        async look({ eye, target, fov_deg: fov }) {
          const distance = Math.hypot(...eye.map((value, i) => value - target[i]));
          const bearing = Math.atan2(eye[0] - target[0], eye[2] - target[2]);
          Object.assign(view, {
            fieldOfView: `${fov}deg`, cameraTarget: target.map((value) => `${value}m`).join(' '),
            cameraOrbit: `${bearing}rad 90deg ${distance}m`,
          });
          await view.updateComplete;
          view.jumpCameraToGoal();
          await new Promise((done) => { setTimeout(done, 1000); });
          await frames(5);
          const scene = symbolOf(view, 'scene');
          const found = [];
          scene.updateMatrixWorld(true);
          const world = scene.target.matrixWorld.clone().invert();
          scene.target.traverse((mesh) => {
            if (!mesh.isMesh || !mesh.geometry.index || !mesh.material?.name) return;
            mesh.geometry.computeBoundingBox();
            const { min, max } = mesh.geometry.boundingBox;
            const matrix = world.clone().multiply(mesh.matrixWorld);
            found.push({ name: mesh.name, matrix: [...matrix.elements], low: min.toArray(), high: max.toArray() });
          });
          return found;
        },
      };
    },
  };
}
