// The page: a list of figures, what is known of the one looked at, and switches.
'use strict';

const MOST_LISTED = 300;
const PITCH = -8; // degrees; a little from above
const AWAY = 3.2; // radii of a figure between it and the camera
const HOME_AWAY = [2.2, 1.7, 1.3]; // radii of all figures between their middle and the camera
const CLEAR = 1.2; // radii at which the camera is still outside of it
const DRAWN_PX = 16; // CesiumJS draws a figure while the geometric error above it covers more

const find = (id) => document.getElementById(id);
const make = (tag, text, more = {}) => Object.assign(document.createElement(tag), { textContent: text, ...more });

function fail(error) {
  find('message').textContent = error?.message ?? String(error);
  find('message').hidden = false;
  console.error(error);
}

async function start() {
  const viewer = offlineViewer('globe');
  const { scene, camera } = viewer;
  const { BoundingSphere, Cartesian3, HeadingPitchRange, Matrix4, Math: Angle, Transforms } = Cesium;
  const given = JSON.parse(find('given').textContent);
  const lines = scene.primitives.add(new Cesium.PolylineCollection());
  const labels = scene.primitives.add(new Cesium.LabelCollection());
  const state = { current: null, part: null, mode: 'drawn', forced: null, ground: 0, locked: false, grid: true };
  const figures = [];

  await Promise.all(given.overlays.map((overlay) => layOverlay(viewer, overlay)));
  const groups = await Promise.all(given.assets.map((asset) => LOADERS[asset.kind](viewer, asset)));
  for (const group of groups) {
    figures.push(...group);
    group.late = (figure, listed) => {
      if (listed) figures[figures.indexOf(listed)] = figure;
      else { figures.push(figure); label(figure); }
      if (state.current === listed) state.current = figure;
      list();
    };
    group.painted = (tile) => { for (const figure of group) if (figure.owns({ content: tile.content })) paintFigure(figure); };
  }

  function label(figure) {
    const { radius, center } = figure.sphere();
    labels.add({
      position: center, text: String(figure.name), font: '14px sans-serif', id: { figure }, scale: 1,
      style: Cesium.LabelStyle.FILL_AND_OUTLINE, outlineWidth: 3, outlineColor: Cesium.Color.BLACK,
      horizontalOrigin: Cesium.HorizontalOrigin.CENTER, pixelOffset: new Cesium.Cartesian2(0, -8),
      // Where the figure itself is too small to be seen.
      distanceDisplayCondition: new Cesium.DistanceDisplayCondition(60 * radius, Number.MAX_VALUE),
    });
  }

  function list() {
    const wanted = find('filter').value.trim().toLowerCase();
    const matching = figures.filter((figure) => String(figure.name).toLowerCase().includes(wanted));
    find('figures').replaceChildren(...matching.slice(0, MOST_LISTED).map((figure) => {
      const button = make('button', figure.name, { type: 'button', onclick: () => look(figure) });
      button.setAttribute('aria-current', String(figure === state.current));
      button.classList.toggle('far', tooFar(figure));
      const item = make('li', '');
      item.append(button);
      return item;
    }));
    const far = figures.filter(tooFar);
    find('undrawn').hidden = far.length === 0;
    find('undrawn').textContent = far.length === figures.length && far.length > 1
      ? `none of ${far.length} figures is drawn from here; click a name to fly there`
      : `not drawn from here: ${far.slice(0, 5).map((figure) => figure.name).join(', ')}${far.length > 5 ? ` and ${far.length - 5} more` : ''}; click a name to fly there`;
    find('filter').hidden = figures.length <= 12;
    find('more').hidden = matching.length <= MOST_LISTED;
    find('more').textContent = `and ${matching.length - MOST_LISTED} more; search by name`;
  }

  function unlock() {
    camera.cancelFlight();
    camera.lookAtTransform(Matrix4.IDENTITY);
    state.locked = false;
  }

  // The camera goes round the figure until something else is chosen.
  function lock(figure, offset) {
    camera.lookAtTransform(Transforms.eastNorthUpToFixedFrame(figure.sphere().center), offset);
    state.locked = true;
    scene.requestRender();
  }

  // Figures of a centimetre are looked at from a few: the camera must come that near, and see what is that near.
  function setNear(distance) {
    camera.frustum.near = Math.min(0.1, distance / 20);
    scene.screenSpaceCameraController.minimumZoomDistance = Math.min(1, distance / 10);
  }

  function setGround(height) {
    if (Math.abs(height - state.ground) < 0.5 && (height !== 0 || state.ground === 0)) return;
    state.ground = height;
    viewer.terrainProvider = groundAt(height);
  }

  // From how far away CesiumJS draws a figure, metres; without limit for what is no tileset.
  function range(figure) {
    if (figure.errorAbove === undefined) return Infinity;
    return (figure.errorAbove * scene.drawingBufferHeight) / (DRAWN_PX * camera.frustum.sseDenominator);
  }

  function tooFar(figure) {
    return figure.errorAbove !== undefined && figure.away(camera) >= range(figure);
  }

  // As far as shows all of a figure, nearer where it is drawn from less far only.
  function awayFor(figure, radius) {
    const nearer = 0.9 * range(figure);
    return nearer > CLEAR * radius ? Math.min(AWAY * radius, nearer) : AWAY * radius;
  }

  async function look(figure, seconds = matchMedia('(prefers-reduced-motion: reduce)').matches ? 0 : 2.5) {
    if (state.current && state.part !== null) choosePart(null);
    state.current = figure;
    unlock();
    setGround(figure.ground);
    const place = figure.place();
    const sphere = figure.sphere();
    const towards = Angle.toRadians((place?.heading_deg ?? 180) + 180);
    const offset = new HeadingPitchRange(towards, Angle.toRadians(PITCH), awayFor(figure, sphere.radius));
    setNear(offset.range);
    find('scale').textContent = '';
    if (place) {
      const step = drawGrid(lines, place.feet, figure.size);
      find('scale').textContent = `${step >= 1000 ? `${step / 1000} km` : `${step} m`}, ${step >= 100 ? `${step / 100} km` : `${10 * step} m`}`;
    }
    describe(figure);
    list();
    if (seconds > 0) {
      await new Promise((done) => camera.flyToBoundingSphere(sphere, { offset, duration: seconds, complete: done, cancel: done }));
    }
    if (state.current === (figure.real ?? figure)) lock(figure, offset);
    await drawn(figure);
    if (state.current !== (figure.real ?? figure)) return;
    describe(state.current);
    list();
    paintFigure(state.current);
  }

  // Until what the figure consists of is loaded.
  function drawn(asked) {
    return new Promise((done) => {
      let frames = 0;
      const wait = () => {
        const figure = asked.real ?? asked;
        const waiting = !tooFar(figure) && (figure.distant || figure.pending?.() || (figure.kind === 'tiles' && (!figure.drawn.tilesLoaded || figure.shownLevel() < 0)));
        if ((!waiting && frames > 1) || ++frames > 600) { remove(); done(); } else scene.requestRender();
      };
      const remove = scene.postRender.addEventListener(wait);
      scene.requestRender();
    });
  }

  function home() {
    unlock();
    const all = BoundingSphere.fromBoundingSpheres(figures.map((figure) => figure.sphere()));
    if (figures.length === 1) { look(figures[0]); return; }
    const alike = figures[0].place()?.heading_deg ?? 180;
    const same = figures.every((figure) => Math.abs(((figure.place()?.heading_deg ?? 180) - alike + 540) % 360 - 180) < 45);
    const pitch = all.radius > 1e6 ? -90 : -25;
    if (all.radius < 1e6) setGround(Math.min(...figures.map((figure) => figure.ground)));
    // From nearer where that shows more of the figures.
    const views = HOME_AWAY.map((radii) => {
      const offset = new HeadingPitchRange(Angle.toRadians(same ? alike + 180 : 0), Angle.toRadians(pitch), radii * all.radius);
      camera.viewBoundingSphere(all, offset);
      camera.lookAtTransform(Matrix4.IDENTITY);
      return { offset, far: figures.filter(tooFar).length };
    });
    const { offset } = views.reduce((best, view) => (view.far < best.far ? view : best));
    setNear(offset.range);
    camera.viewBoundingSphere(all, offset);
    camera.lookAtTransform(Matrix4.IDENTITY);
    list();
    scene.requestRender();
  }

  const row = (term, value) => (value === undefined || value === null || value === '' ? [] : [make('dt', term), make('dd', String(value))]);
  // Said above in other words.
  const SHOWN = /^(heading|heading_deg|longitude|latitude|height|height_m|parts|partsObservedShare)$/;
  const plain = (value) => {
    if (typeof value === 'number') return Number(value.toPrecision(7));
    if (Array.isArray(value)) return value.map(plain).join(', ');
    if (typeof value !== 'object' || value === null) return value;
    return Object.entries(value).filter(([, each]) => each !== null && each !== '').map(([key, each]) => `${key.replaceAll('_', ' ')} ${plain(each)}`).join('; ');
  };
  const fixed = (value) => (Math.abs(value) < 0.005 ? 0 : value).toFixed(2); // not -0.00

  function describe(figure) {
    const place = figure.place();
    const angle = (value, positive, negative) => `${Math.abs(value).toFixed(6)}° ${value < 0 ? negative : positive}`;
    find('name').textContent = figure.name;
    const { source, ...rest } = figure.metadata ?? {};
    find('facts').replaceChildren(
      ...row('source', plain(source)), ...row('credit', figure.credit),
      ...(place ? [
        ...row('place', `${angle(place.lat_deg, 'N', 'S')}, ${angle(place.lon_deg, 'E', 'W')}`),
        ...row('ground', `${fixed(place.height_m)} m`), ...row('facing', `${fixed(place.heading_deg)}°`),
      ] : []),
      ...row('height', figure.size >= 1000 ? `${(figure.size / 1000).toFixed(2)} km` : figure.size < 0.1 ? `${Number((1000 * figure.size).toPrecision(3))} mm` : `${figure.size.toFixed(2)} m`),
      ...Object.entries(rest).filter(([key]) => !SHOWN.test(key)).slice(0, 12).flatMap(([key, value]) => row(key, String(plain(value)).slice(0, 120))),
    );
    const names = [...new Set(figure.features().map((feature) => feature.getProperty('name')).filter((name) => name !== undefined))];
    find('parts').replaceChildren(...names.map((name) => {
      const button = make('button', name, { type: 'button', onclick: () => choosePart(state.part === name ? null : name) });
      button.setAttribute('aria-pressed', String(name === state.part));
      const item = make('li', '');
      item.append(button);
      return item;
    }));
    const levels = figure.levels.length > 1 ? ['auto', ...figure.levels.keys()] : [];
    find('levels').replaceChildren(...levels.map((level) => {
      const text = level === 'auto' ? 'auto' : `LOD ${level}`;
      const button = make('button', text, { type: 'button', onclick: () => setLevel(level === 'auto' ? null : level) });
      button.setAttribute('aria-pressed', String((level === 'auto' ? null : level) === state.forced));
      return button;
    }));
    showLevel();
  }

  function showLevel() {
    const figure = state.current;
    const level = figure?.shownLevel() ?? -1;
    const found = figure?.levels[level];
    const triangles = found?.triangles === undefined ? '' : `, ${found.triangles.toLocaleString('en')} triangles`;
    const error = found?.error ? `for pixels of ${((1000 * found.error) / DRAWN_PX).toPrecision(3)} mm and more` : 'the finest mesh';
    const text = found ? `shown: LOD ${level}, ${error}${triangles}` : '';
    if (find('level').textContent !== text) find('level').textContent = text;
  }

  function showRange() {
    const figure = state.current;
    const note = find('range');
    note.hidden = !figure || !tooFar(figure);
    if (note.hidden) return;
    const metres = range(figure);
    const text = `not drawn from here: closer than ${metres >= 1000 ? `${Number((metres / 1000).toPrecision(2))} km` : `${Number(metres.toPrecision(2))} m`}`;
    if (note.textContent !== text) note.textContent = text;
  }

  function setLevel(level) {
    state.forced = level;
    for (const group of groups) group.force?.(level === null ? null : level);
    if (state.current) { describe(state.current); drawn(state.current).then(() => describe(state.current)); }
    scene.requestRender();
  }

  function paintFigure(figure) {
    const grain = paint(figure, state.mode, figure === state.current ? state.part : null);
    if (figure !== state.current) return;
    find('grain').textContent = { texel: 'per point of the surface', part: 'by the share of each part', none: 'not in the file' }[grain];
    scene.requestRender();
  }

  function setMode(observed) {
    state.mode = observed ? 'observed' : 'drawn';
    find('observed').checked = observed;
    find('legend').hidden = !observed;
    figures.forEach(paintFigure);
    scene.requestRender();
  }

  function setGrid(on) {
    Object.assign(state, { grid: on });
    Object.assign(lines, { show: on });
    find('grid').checked = on;
    scene.requestRender();
  }

  function choosePart(name) {
    const figure = state.current;
    state.part = name;
    const feature = name === null ? undefined : figure.features().find((each) => each.getProperty('name') === name);
    const share = feature?.getProperty('observedShare');
    find('part').hidden = name === null;
    find('part').textContent = name === null ? '' : `part: ${name}${share === undefined ? '' : `, ${Math.round(100 * share)} % observed in the drawing`}`;
    for (const button of find('parts').querySelectorAll('button')) button.setAttribute('aria-pressed', String(button.textContent === name));
    if (figure) paintFigure(figure);
  }

  // What is at a pixel: {figure, part}.
  function at(position) {
    const picked = scene.pick(position);
    const named = picked?.id?.figure;
    const figure = picked && (named?.real ?? named ?? figures.find((each) => each.owns(picked)));
    return { figure, part: figure ? picked.getProperty?.('name') ?? null : null };
  }

  async function click({ position }) {
    const { figure, part } = at(position);
    if (!figure) { choosePart(null); return; }
    if (figure !== state.current) {
      if (figure.sphere().radius * 60 < Cartesian3.distance(camera.positionWC, figure.sphere().center)) { await look(figure); return; }
      choosePart(null);
      state.current = figure;
      describe(figure);
      list();
    }
    choosePart(part);
  }

  function step(by) {
    const next = state.current === null ? 0 : (figures.indexOf(state.current) + by + figures.length) % figures.length;
    look(figures[next]);
  }

  function stepPart(by) {
    const names = [...find('parts').querySelectorAll('button')].map((button) => button.textContent);
    if (names.length) choosePart(names[state.part === null ? (by > 0 ? 0 : names.length - 1) : (names.indexOf(state.part) + by + names.length) % names.length]);
  }

  const nearer = (factor) => {
    const distance = Cartesian3.magnitude(state.locked ? camera.position : camera.positionWC) - (state.locked ? 0 : 6.37e6);
    camera.zoomIn(distance * (1 - factor));
  };
  const round = { ArrowLeft: 'rotateLeft', ArrowRight: 'rotateRight', ArrowUp: 'rotateUp', ArrowDown: 'rotateDown' };
  const keys = {
    n: () => step(1), p: () => step(-1), f: () => state.current && look(state.current), h: home, a: () => setLevel(null),
    o: () => setMode(state.mode !== 'observed'), g: () => setGrid(!state.grid), '[': () => stepPart(-1), ']': () => stepPart(1),
    '+': () => nearer(0.8), '=': () => nearer(0.8), '-': () => nearer(1.25), Escape: () => { choosePart(null); unlock(); },
  };

  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches('input[type="search"]')) return;
    const level = /^[1-5]$/.test(event.key) ? Number(event.key) - 1 : null;
    if (level !== null && state.current && level < state.current.levels.length) setLevel(level);
    else if (round[event.key]) camera[round[event.key]](Angle.toRadians(5));
    else if (keys[event.key]) keys[event.key]();
    else return;
    event.preventDefault();
    scene.requestRender();
  });
  viewer.screenSpaceEventHandler.removeInputAction(Cesium.ScreenSpaceEventType.LEFT_DOUBLE_CLICK);
  viewer.screenSpaceEventHandler.setInputAction((event) => { click(event).catch(fail); }, Cesium.ScreenSpaceEventType.LEFT_CLICK);
  find('observed').addEventListener('change', (event) => setMode(event.target.checked));
  find('grid').addEventListener('change', (event) => setGrid(event.target.checked));
  find('filter').addEventListener('input', list);
  scene.postRender.addEventListener(showLevel);
  scene.postRender.addEventListener(showRange);
  scene.renderError.addEventListener((_, error) => fail(error));

  figures.forEach(label);
  list();
  // CesiumJS shows the credits of models and tiles itself.
  const credits = figures.filter((figure) => !figure.drawn).map((figure) => figure.credit).filter(Boolean);
  for (const credit of new Set(credits)) viewer.creditDisplay.addStaticCredit(new Cesium.Credit(make('b', credit).innerHTML, true));
  window.fig2mesh = { viewer, figures, state, look, home, drawn, setLevel, setMode, setGrid, choosePart, at, ecefFromMesh, placeOf };
  if (figures.length === 1) await look(figures[0], 0);
  else if (figures.length) {
    home();
    state.current = figures[0];
    describe(figures[0]);
    // Nothing to be seen of figures far apart: better one of them.
    if (figures.every(tooFar)) await look(figures[0], 0);
  }
  camera.moveEnd.addEventListener(list);
  list();
  document.documentElement.dataset.ready = 'true';
}

start().catch(fail);
