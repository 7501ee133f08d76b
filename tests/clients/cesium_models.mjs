// What CesiumJS makes of glTF models: each alone in a scene without globe or sky, seen from the side it faces.
//
// stdin:  {browser, cesium, models: [file, ...], width, height}: a browser, the folder Build/Cesium, models on disk
// stdout: [{file, radius, outline, png, messages}, ...] or with `error` where CesiumJS refuses one; outline: whether there
//         is a node of that name
import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import { require } from './packages.mjs';

const { chromium } = require('playwright-core');
const job = JSON.parse(fs.readFileSync(0, 'utf8'));
const page = `<!DOCTYPE html><meta charset="utf-8"><link rel="icon" href="data:,">
<style>body { margin: 0 } .cesium-widget, canvas { width: 100%; height: 100%; display: block }</style>
<div id="c"></div><script>window.CESIUM_BASE_URL = '/cesium/';</script><script src="/cesium/Cesium.js"></script>`;
const types = { '.js': 'text/javascript', '.wasm': 'application/wasm', '.json': 'application/json' };

const server = http.createServer((request, response) => {
  const name = decodeURIComponent(new URL(request.url, 'http://localhost').pathname);
  const model = name.match(/^\/model\/(\d+)\/(.+)$/);
  let file;
  if (name === '/') {
    response.setHeader('Content-Type', 'text/html');
    return response.end(page);
  }
  if (model) file = path.join(path.dirname(job.models[+model[1]]), path.basename(model[2]));
  else if (name.startsWith('/cesium/')) file = path.join(job.cesium, path.normalize(name.slice(8)));
  if (!file || !fs.existsSync(file) || fs.statSync(file).isDirectory()) return response.writeHead(404).end();
  response.setHeader('Content-Type', types[path.extname(file)] ?? 'application/octet-stream');
  fs.createReadStream(file).pipe(response);
});
await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
const { port } = server.address();

const flags = ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];
const browser = await chromium.launch({ executablePath: job.browser, headless: true, args: flags });
const tab = await browser.newPage({ viewport: { width: job.width, height: job.height } });
let messages = [];
tab.on('console', (message) => message.type() === 'error' && messages.push(message.text()));
tab.on('pageerror', (error) => messages.push(String(error)));
await tab.goto(`http://127.0.0.1:${port}/`);

async function show({ url, width, height }) {
  const { Cesium } = window;
  window.widget?.destroy();
  const holder = document.getElementById('c');
  Object.assign(holder.style, { width: `${width}px`, height: `${height}px` });
  const widget = new Cesium.CesiumWidget(holder, {
    globe: false, skyBox: false, skyAtmosphere: false, useDefaultRenderLoop: false, shouldAnimate: false,
    contextOptions: { webgl: { preserveDrawingBuffer: true } }, creditContainer: document.createElement('div'),
  });
  window.widget = widget;
  widget.resize();
  const { scene } = widget;
  scene.backgroundColor = Cesium.Color.WHITE;
  scene.highDynamicRange = false;
  const frame = Cesium.Transforms.eastNorthUpToFixedFrame(Cesium.Cartesian3.fromDegrees(8.5, 47.4, 400));
  const axes = { upAxis: Cesium.Axis.Y, forwardAxis: Cesium.Axis.X };
  const model = await Cesium.Model.fromGltfAsync({ url, modelMatrix: frame, incrementallyLoadTextures: false, ...axes });
  scene.primitives.add(model);
  const failed = new Promise((_, reject) => model.errorEvent.addEventListener(reject));
  const ready = (async () => {
    for (let i = 0; i < 600 && !model.ready; i++) {
      scene.render();
      await new Promise((resolve) => setTimeout(resolve, 20));
    }
    if (!model.ready) throw new Error('not ready after 12 s');
  })();
  await Promise.race([ready, failed]);
  const { center, radius } = model.boundingSphere;
  // The figure faces south, so look north.
  scene.camera.lookAt(center, new Cesium.HeadingPitchRange(0, 0, radius * 2.6));
  for (let i = 0; i < 3; i++) scene.render();
  return { radius, outline: Boolean(model.getNode('outline')), png: scene.canvas.toDataURL().split(',')[1] };
}

const found = [];
for (const [index, file] of job.models.entries()) {
  messages = [];
  const url = `/model/${index}/${encodeURIComponent(path.basename(file))}`;
  try {
    found.push({ file, ...(await tab.evaluate(show, { url, width: job.width, height: job.height })), messages });
  } catch (error) {
    found.push({ file, error: String(error), messages });
  }
}
console.log(JSON.stringify(found));
await browser.close();
server.close();
