// The stand-alone page: controls by mouse, touch and keyboard, and the address's fragment as the state to start with.
'use strict';

const LABELS = {
  texture: ['Colours of the drawing', 't'], blend: ['Blended borders', 'b'], creases: ['Ink in creases', 'c'],
  light: ['Lighting', 'l'], ao: ['Ambient occlusion', 'a'], outline: ['Outline', 'o'],
  'smooth-union': ['Smooth union', 'u'], perspective: ['Perspective', 'p'], antialias: ['Smooth edges', 's'],
};
const TURN = 0.4; // degrees a pixel
const STEP = 5; // degrees a key
const START = 200; // milliseconds the first picture may take
const SLOW = 60; // milliseconds a frame, above which pictures in motion get coarser

const find = (id) => document.getElementById(id);
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

function fail(error) {
  find('message').textContent = error.message;
  find('message').hidden = false;
  console.error(error);
}

async function start() {
  const figure = JSON.parse(find('figure').textContent);
  const canvas = find('canvas');
  const view = new FigureView(canvas, figure, await decodeFigure(figure), find('shader').textContent);
  const { camera } = view;
  const still = { pending: false, moving: false, scale: 1, timer: 0 };

  // Whether the canvas has changed its number of pixels.
  function resize() {
    const factor = window.devicePixelRatio * Math.min(1, (still.moving ? 1 : 2) * still.scale);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((n) => Math.max(1, Math.round(n * factor)));
    const changed = canvas.width !== width || canvas.height !== height;
    if (changed) Object.assign(canvas, { width, height });
    return changed;
  }
  function draw() {
    resize();
    try { view.draw(); } catch (error) { fail(error); }
  }
  // Devices without a graphics processor get few pixels from the start. Two sizes, so that what a picture costs anyway
  // does not count.
  function calibrate() {
    const [small, large] = [48, 144];
    const taken = [small, small, large].map((edge) => {
      Object.assign(canvas, { width: edge, height: edge });
      return view.milliseconds();
    });
    const each = Math.max(taken[2] - taken[1], 0) / (large ** 2 - small ** 2);
    const all = canvas.clientWidth * canvas.clientHeight * window.devicePixelRatio ** 2;
    still.scale = clamp(Math.sqrt(START / Math.max(each * all, 1)), 0.25, 1);
  }
  function request() {
    if (still.pending) return;
    still.pending = true;
    requestAnimationFrame((begun) => {
      still.pending = false;
      draw();
      if (still.moving) requestAnimationFrame((now) => pace(now - begun));
    });
  }
  // Devices that cannot keep up with a moving figure draw fewer pixels of it, and at rest twice as many an edge.
  function pace(took) {
    if (took > SLOW) still.scale = Math.max(0.8 * still.scale, 0.25);
    if (took < SLOW / 3) still.scale = Math.min(1.1 * still.scale, 1);
  }
  function moved() {
    still.moving = true;
    clearTimeout(still.timer);
    still.timer = setTimeout(() => { still.moving = false; request(); }, 150);
    request();
  }
  function turn(yaw, pitch) {
    camera.yaw = (((camera.yaw + yaw) % 360) + 360) % 360;
    camera.pitch = clamp(camera.pitch + pitch, -90, 90);
    moved();
  }
  function zoom(factor) {
    camera.zoom = clamp(camera.zoom * factor, 0.3, 20);
    moved();
  }
  function toggle(effect, on) {
    view.set(effect, on);
    find(effect).checked = view.effects.has(effect);
    request();
  }

  for (const [effect, [label, key]] of Object.entries(LABELS)) {
    const row = document.createElement('label');
    const box = Object.assign(document.createElement('input'), { type: 'checkbox', id: effect });
    box.addEventListener('change', () => toggle(effect, box.checked));
    row.append(box, ` ${label} `, Object.assign(document.createElement('kbd'), { textContent: key }));
    find('effects').append(row);
  }

  // Mouse, pen and fingers alike: one turns the figure, two zoom.
  const held = new Map();
  const spread = () => { const [a, b] = [...held.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  canvas.addEventListener('pointermove', (event) => {
    const from = held.get(event.pointerId);
    if (!from) return;
    const before = held.size === 2 ? spread() : 0;
    held.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (held.size === 1) turn((from.x - event.clientX) * TURN, (event.clientY - from.y) * TURN);
    else if (held.size === 2 && before) zoom(spread() / before);
  });
  for (const name of ['pointerup', 'pointercancel']) canvas.addEventListener(name, (event) => held.delete(event.pointerId));
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)));
  }, { passive: false });

  const keys = {
    ArrowLeft: () => turn(STEP, 0), ArrowRight: () => turn(-STEP, 0),
    ArrowUp: () => turn(0, STEP), ArrowDown: () => turn(0, -STEP),
    '+': () => zoom(1.15), '=': () => zoom(1.15), '-': () => zoom(1 / 1.15),
    0: () => { Object.assign(camera, { yaw: 0, pitch: 0, zoom: 1 }); request(); },
  };
  for (const [effect, [, key]] of Object.entries(LABELS)) keys[key] = () => toggle(effect, !view.effects.has(effect));
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  });

  // #yaw=30&pitch=10&zoom=2&effects=texture,light
  function readAddress() {
    const asked = new URLSearchParams(location.hash.slice(1));
    for (const name of ['yaw', 'pitch', 'zoom']) {
      if (Number.isFinite(parseFloat(asked.get(name)))) camera[name] = parseFloat(asked.get(name));
    }
    camera.pitch = clamp(camera.pitch, -90, 90);
    camera.zoom = clamp(camera.zoom, 0.3, 20);
    if (asked.has('effects')) {
      const wanted = asked.get('effects').split(',');
      for (const effect of EFFECTS) view.set(effect, wanted.includes(effect));
    }
    for (const effect of EFFECTS) find(effect).checked = view.effects.has(effect);
  }

  window.addEventListener('hashchange', () => { readAddress(); request(); });
  find('controls').open = window.innerWidth >= 640;
  readAddress();
  calibrate();
  draw();
  new ResizeObserver(() => { if (resize()) draw(); }).observe(canvas);
  window.fig2mesh = { view, camera, program: view.program, effects: EFFECTS, set: toggle, draw };
  document.documentElement.dataset.ready = 'true';
}

start().catch(fail);
