// Editing on a page of `fig2mesh annotate`, with mouse and keys as a person would.
//
// stdin:  {browser, url, actions: [{...}, ...]}; an action is one of
//         {drag: [[x, y], [x, y], ...]}  from place to place, in pixels of the drawing
//         {key: name}  {press: [selector, key]}  {click: selector}  {choose: [selector, value]}  {fill: [selector, value]}
//         {preview: true}  wait until one more preview is shown, and return a picture of it
//         {screenshot: true}
// stdout: {results: [{joints, selected, order, status, inside, present, png?}, ...], messages: [...]}: after each action; `inside` counts
//         the pixels of the silhouette, `present` lists the parts
import fs from 'node:fs';
import { require } from './packages.mjs';

const { chromium } = require('playwright-core');
const { browser: executablePath, url, actions } = JSON.parse(fs.readFileSync(0, 'utf8'));
const flags = ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];
const browser = await chromium.launch({ executablePath, headless: true, args: flags });
const page = await browser.newPage({ viewport: { width: 1100, height: 700 } });
page.setDefaultTimeout(120_000);
const messages = [];
page.on('pageerror', (error) => messages.push(String(error)));

const onPage = ([x, y]) => page.evaluate(([px, py]) => {
  const { shown } = window.fig2mesh;
  const box = shown.canvas.getBoundingClientRect();
  const ratio = shown.canvas.width / box.width;
  return [box.left + (px * shown.zoom + shown.x) / ratio, box.top + (py * shown.zoom + shown.y) / ratio];
}, [x, y]);

const acts = {
  drag: async (places) => {
    await page.mouse.move(...(await onPage(places[0])));
    await page.mouse.down();
    for (const place of places.slice(1)) await page.mouse.move(...(await onPage(place)), { steps: 3 });
    await page.mouse.up();
  },
  key: async (name) => {
    await page.locator('#canvas').focus();
    await page.keyboard.press(name);
  },
  press: async ([selector, name]) => {
    await page.locator(selector).focus();
    await page.keyboard.press(name);
  },
  click: (selector) => page.locator(selector).click(),
  choose: ([selector, value]) => page.locator(selector).selectOption(value),
  fill: ([selector, value]) => page.locator(selector).fill(value),
  saved: () => page.waitForFunction(() => /^saved/.test(document.getElementById('status').textContent)),
  preview: async () => {
    const before = await page.evaluate(() => Number(document.documentElement.dataset.previews ?? 0));
    await page.locator('#solid').click();
    await page.waitForFunction((n) => Number(document.documentElement.dataset.previews ?? 0) > n, before);
    await page.frameLocator('#preview').locator('html[data-ready]').waitFor({ state: 'attached' });
    return { png: (await page.screenshot()).toString('base64') };
  },
  screenshot: async () => ({ png: (await page.screenshot()).toString('base64') }),
};

const state = () => {
  const { drawing, shown } = window.fig2mesh;
  const inside = drawing.pixels.reduce((count, value) => count + (value >> 7), 0);
  const [status, present] = ['status', 'present'].map((id) => document.getElementById(id).textContent);
  return { joints: drawing.joints, selected: shown.selected, order: drawing.order, inside, status, present };
};

const results = [];
try {
  await page.goto(url);
  await page.waitForSelector('html[data-ready]', { state: 'attached' });
  for (const action of actions) {
    const [[name, argument]] = Object.entries(action);
    const found = await acts[name](argument);
    results.push({ ...(await page.evaluate(state)), ...(found?.png ? found : {}) });
  }
} catch (error) {
  messages.push(String(error));
}
await browser.close();
console.log(JSON.stringify({ results, messages }));
