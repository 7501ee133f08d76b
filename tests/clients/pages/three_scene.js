// What the clients that draw with three.js share.
import * as THREE from 'three';

export const frames = (count) => new Promise((done, failed) => {
  if (window.fig2mesh.late) return failed(new Error('too late'));
  const next = (left) => (left ? requestAnimationFrame(() => next(left - 1)) : done());
  return next(count);
});

export function placeCamera(camera, { eye, target, up, fov_deg: fov }) {
  camera.fov = fov;
  camera.aspect = innerWidth / innerHeight;
  camera.near = 0.1;
  camera.far = 1000;
  camera.position.set(...eye);
  camera.up.set(...up);
  camera.lookAt(...target);
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld();
}

export function figuresIn(root) {
  const found = [];
  root.updateWorldMatrix(true, true);
  root.traverseVisible((mesh) => {
    if (!mesh.isMesh) return;
    mesh.geometry.computeBoundingBox();
    const { min, max } = mesh.geometry.boundingBox;
    const { index, attributes } = mesh.geometry;
    found.push({
      name: mesh.name, matrix: [...mesh.matrixWorld.elements], low: min.toArray(), high: max.toArray(),
      material: mesh.material.type, triangles: (index ?? attributes.position).count / 3,
    });
  });
  return found;
}

export function newScene() {
  const scene = new THREE.Scene();
  scene.background = new THREE.Color('#fff');
  scene.add(new THREE.AmbientLight('#fff', Math.PI)); // shows a lit material in the colour of its texture
  return scene;
}

export function newRenderer(host) {
  const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  renderer.setPixelRatio(1);
  renderer.setSize(innerWidth, innerHeight);
  host.append(renderer.domElement);
  return renderer;
}
