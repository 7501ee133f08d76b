import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { frames } from './three_scene.js';
import { script } from './scripts.js';

export async function start(host, { rightHanded }) {
  if (!window.BABYLON) {
    await script('/modules/babylonjs/babylon.js');
    await script('/modules/babylonjs-loaders/babylonjs.loaders.min.js');
  }
  const { BABYLON } = window;

  // Otherwise it is fetched from another site.
  window.MeshoptDecoder = MeshoptDecoder;
  BABYLON.MeshoptCompression.Configuration.decoder.url = 'data:text/javascript,';
  const canvas = document.createElement('canvas');
  host.append(canvas);
  const engine = new BABYLON.Engine(canvas, true, { preserveDrawingBuffer: true });
  engine.setSize(innerWidth, innerHeight);
  const side = rightHanded ? 1 : -1; // a left-handed world has the figure's left at -x
  return {
    end: () => engine.dispose(),
    async open({ url }) {
      const scene = new BABYLON.Scene(engine);
      scene.useRightHandedSystem = Boolean(rightHanded);
      scene.clearColor = new BABYLON.Color4(1, 1, 1, 1);
      new BABYLON.HemisphericLight('light', new BABYLON.Vector3(0, 1, 0), scene).groundColor = BABYLON.Color3.White();
      const camera = new BABYLON.FreeCamera('camera', BABYLON.Vector3.Zero(), scene);
      const { meshes } = await BABYLON.ImportMeshAsync(new URL(url, location.href).href, scene);
      return {
        close: () => scene.dispose(),
        async look({ eye: [x, y, z], target: [u, v, w], fov_deg: fov }) {
          camera.minZ = 0.1;
          camera.fov = (fov * Math.PI) / 180;
          camera.position.set(side * x, y, z);
          camera.setTarget(new BABYLON.Vector3(side * u, v, w));
          await scene.whenReadyAsync();
          for (let i = 0; i < 3; i += 1) {
            scene.render();
            await frames(1);
          }
          const drawn = meshes.filter((mesh) => mesh.getTotalVertices());
          return drawn.map((mesh) => {
            const { minimum, maximum } = mesh.getBoundingInfo();
            const matrix = [...mesh.computeWorldMatrix(true).asArray()].map((value, i) => (i % 4 === 0 ? side * value : value));
            return { name: mesh.name, matrix, low: minimum.asArray(), high: maximum.asArray() };
          });
        },
      };
    },
  };
}
