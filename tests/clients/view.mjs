// What a browser makes of a page of `fig2mesh view` or `fig2mesh globe`.
//
// stdin:  {browser, url, width, height, actions: [{...}, ...]}; an action is one of
//         {picture: {yaw, pitch, effects}}   draw the figure on a canvas of width x height; effects as a list
//         {drag: [dx, dy]}  {touch: [dx, dy]}  {pinch: [from, to]}  {wheel: dy}  {key: name}  {toggle: effect}
//         {evaluate: expression}  {screenshot: true}
// stdout: {results: [...], messages: [...], requests: [...]}: for each action the page's state after it, with `png`
//         (base64) or `value`; what the page wrote to its console; addresses asked for that are not in the page itself
import fs from 'node:fs';
import { require } from './packages.mjs';

const { chromium } = require('playwright-core');
const { browser: executablePath, url, width, height, actions } = JSON.parse(fs.readFileSync(0, 'utf8'));
const flags = ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];

const browser = await chromium.launch({ executablePath, headless: true, args: flags });
const page = await browser.newPage({ viewport: { width, height }, hasTouch: true });
page.setDefaultTimeout(180_000);
const messages = [];
const requests = [];
// The driver's remarks on how fast something is are no fault of the page.
const remark = (text) => text.includes('GL Driver Message (OpenGL, Performance');
const worse = (message) => ['error', 'warning'].includes(message.type()) && !remark(message.text());
page.on('console', (message) => worse(message) && messages.push(message.text()));
page.on('pageerror', (error) => messages.push(String(error)));
page.on('request', (request) => !/^(data|blob):/.test(request.url()) && requests.push(request.url()));

const fingers = await page.context().newCDPSession(page);
const [x, y] = [width / 2, height / 2];

async function touches(frames) {
  const points = (frame) => frame.map(([px, py], id) => ({ x: px, y: py, id }));
  await fingers.send('Input.dispatchTouchEvent', { type: 'touchStart', touchPoints: points(frames[0]) });
  for (const frame of frames.slice(1)) {
    await fingers.send('Input.dispatchTouchEvent', { type: 'touchMove', touchPoints: points(frame) });
  }
  await fingers.send('Input.dispatchTouchEvent', { type: 'touchEnd', touchPoints: [] });
}

function picture({ yaw, pitch, effects, width, height }) {
  const { view } = window.fig2mesh;
  for (const effect of window.fig2mesh.effects) view.set(effect, effects.includes(effect));
  Object.assign(view.camera, { yaw, pitch, zoom: 1 });
  Object.assign(view.canvas, { width, height });
  view.draw();
  return view.canvas.toDataURL().split(',')[1];
}

const acts = {
  picture: async (view) => ({ png: await page.evaluate(picture, { width, height, ...view }) }),
  drag: async ([dx, dy]) => {
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + dx, y + dy);
    await page.mouse.up();
  },
  touch: ([dx, dy]) => touches([[[x, y]], [[x + dx / 2, y + dy / 2]], [[x + dx, y + dy]]]),
  pinch: ([from, to]) => touches([from, to].map((apart) => [[x - apart / 2, y], [x + apart / 2, y]])),
  wheel: async (dy) => {
    await page.mouse.move(x, y);
    await page.mouse.wheel(0, dy);
    await page.waitForTimeout(100);
  },
  key: (name) => page.keyboard.press(name),
  toggle: (effect) => page.locator(`#${effect}`).click(),
  evaluate: async (expression) => ({ value: await page.evaluate(expression) }),
  screenshot: async () => ({ png: (await page.screenshot()).toString('base64') }),
};

const state = () => {
  if (!window.fig2mesh.view) return {}; // a globe with models
  const { view, program } = window.fig2mesh;
  const { compiles, defines, source } = program;
  return { ...view.camera, compiles, defines, lines: source.split('\n').length, height: view.height, centre: view.centre };
};
// A frame later, so that what an action asked for has been drawn.
const settled = () => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));

const results = [];
try {
  await page.goto(url);
  await page.waitForSelector('html[data-ready]', { state: 'attached', timeout: 60_000 });
  for (const action of actions) {
    const [[name, argument]] = Object.entries(action);
    const found = await acts[name](argument);
    await settled();
    results.push({ ...(await page.evaluate(state)), ...found });
  }
} catch (error) {
  messages.push(String(error));
}
await browser.close();
console.log(JSON.stringify({ results, messages, requests }));
