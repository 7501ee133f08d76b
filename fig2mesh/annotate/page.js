// The page: tools, keys, saving, preview.
'use strict';

const find = (id) => document.getElementById(id);
const canvas = find('canvas');
const status = find('status');
const LIVE_AFTER_MS = 800;

function tell(text, wrong = false) {
  status.textContent = text;
  status.classList.toggle('wrong', wrong);
}

async function start() {
  const [message, picture] = await Promise.all([
    fetch('annotation').then((answer) => answer.arrayBuffer()),
    fetch('picture.png').then((answer) => answer.blob()).then(createImageBitmap),
  ]);
  const drawing = new AnnotatedDrawing(message);
  const shown = new DrawingCanvas(canvas, drawing, picture);
  let saved = drawing.revision;
  let pending = null;

  drawing.head.parts.forEach((part, label) => find('part').append(new Option(part === 'none' ? 'from the outline' : part.replaceAll('_', ' '), label)));
  drawing.names.forEach((name) => find('joint').append(new Option(name.replaceAll('_', ' '), name)));
  for (const limb of drawing.head.limbs) {
    const choice = document.createElement('select');
    choice.id = limb;
    for (const [text, value] of [['from the pose', ''], ['in front', 'front'], ['behind', 'behind']]) choice.append(new Option(text, value));
    choice.addEventListener('change', () => edit('', () => {
      if (choice.value) drawing.order[limb] = choice.value;
      else delete drawing.order[limb];
    }));
    const label = document.createElement('label');
    label.append(`${limb.replace('l_', 'left ').replace('r_', 'right ')} `, choice);
    find('limbs').append(label);
  }

  function update() {
    find('joint').value = shown.selected;
    find('visible').checked = drawing.joints[shown.selected][2] > 0;
    for (const limb of drawing.head.limbs) find(limb).value = drawing.order[limb] ?? '';
    if (shown.tool === 'parts') present();
    find('undo').disabled = !drawing.past.length;
    find('redo').disabled = !drawing.future.length;
    shown.draw();
  }

  /** List the labels that the drawing has, with their colours and shares. */
  function present() {
    const counts = new Map();
    let inside = 0;
    for (const value of drawing.pixels) {
      if (!(value & INSIDE)) continue;
      inside += 1;
      counts.set(value & (INSIDE - 1), 1 + (counts.get(value & (INSIDE - 1)) ?? 0));
    }
    const rows = [...counts].sort((one, other) => other[1] - one[1]).map(([label, count]) => {
      const row = document.createElement('li');
      const swatch = document.createElement('i');
      swatch.style.background = label ? `rgb(${drawing.head.colours[label].join(' ')})` : 'none';
      const name = label ? drawing.head.parts[label].replaceAll('_', ' ') : 'from the outline';
      row.append(swatch, ` ${name} ${Math.max(Math.round((100 * count) / inside), 1)} %`);
      return row;
    });
    find('present').replaceChildren(...rows);
  }

  function changed() {
    update();
    tell(drawing.revision === saved ? '' : 'unsaved changes');
    clearTimeout(pending);
    if (find('live').checked) pending = setTimeout(solid, LIVE_AFTER_MS);
  }

  function edit(kind, act) {
    drawing.change(kind, act);
    changed();
  }

  function all() {
    shown.refresh([0, 0, drawing.width, drawing.height]);
    changed();
  }

  async function send(address) {
    const answer = await fetch(address, { method: 'POST', body: drawing.packed(), headers: { 'X-Fig2mesh': '1' } });
    const { message: text } = await answer.json();
    if (!answer.ok) throw new Error(text);
    return text;
  }

  async function save() {
    const revision = drawing.revision;
    try {
      tell(await send('save'));
      saved = revision;
    } catch (error) {
      tell(error.message, true);
    }
  }

  async function solid() {
    tell('making the preview …');
    try {
      await send('preview');
      find('preview').hidden = false;
      find('preview').src = `preview?${Date.now()}`;
      tell('');
      document.documentElement.dataset.previews = 1 + Number(document.documentElement.dataset.previews ?? 0);
    } catch (error) {
      tell(error.message, true);
    }
  }

  const radius = () => Number(find('width').value) / 2;
  const brush = () => {
    const erase = find('erase').checked;
    if (shown.tool === 'mask') return erase ? () => 0 : (value) => value | INSIDE;
    const label = erase ? 0 : Number(find('part').value);
    return (value) => (value & INSIDE ? INSIDE | label : value); // parts lie inside of the silhouette
  };

  function choose(tool) {
    shown.tool = tool;
    document.querySelector(`input[name=tool][value=${tool}]`).checked = true;
    find('present').hidden = tool !== 'parts';
    shown.cursor ??= [drawing.width / 2, drawing.height / 2, radius()];
    update();
  }

  let held = null;
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    const place = shown.at(event);
    if (event.button === 2 || event.altKey) held = { pan: [event.clientX, event.clientY] };
    else if (shown.tool === 'joints') {
      const name = shown.jointNear(place, 16 * (window.devicePixelRatio || 1));
      if (name) {
        shown.selected = name;
        held = { joint: name, kind: `drag ${drawing.revision}` };
        update();
      }
    } else {
      drawing.beginStroke();
      held = { from: place };
      shown.refresh(drawing.paint(place, place, radius(), brush()));
      shown.draw();
    }
  });
  canvas.addEventListener('pointermove', (event) => {
    const place = shown.at(event);
    shown.cursor = [...place, radius()];
    if (held?.pan) {
      const ratio = window.devicePixelRatio || 1;
      shown.x += (event.clientX - held.pan[0]) * ratio;
      shown.y += (event.clientY - held.pan[1]) * ratio;
      held.pan = [event.clientX, event.clientY];
    } else if (held?.joint) edit(held.kind, () => drawing.moveJoint(held.joint, ...place));
    else if (held?.from) {
      shown.refresh(drawing.paint(held.from, place, radius(), brush()));
      held.from = place;
    }
    shown.draw();
  });
  const release = () => {
    if (held?.from) {
      drawing.endStroke();
      changed();
    }
    held = null;
  };
  canvas.addEventListener('pointerup', release);
  canvas.addEventListener('pointercancel', release);
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    shown.zoomAt(shown.at(event), Math.exp(-event.deltaY / 400));
  }, { passive: false });

  const visible = () => edit('', () => { drawing.joints[shown.selected][2] = drawing.joints[shown.selected][2] ? 0 : 1; });
  const swap = () => {
    edit('', () => drawing.swapSides());
    drawing.past.at(-1).kind = 'swap';
    all();
  };
  const undo = () => drawing.undo() && all();
  const redo = () => drawing.redo() && all();
  const width = (factor) => { find('width').value = Math.round(Math.max(Number(find('width').value) * factor, 1) + (factor > 1)); };

  document.querySelectorAll('input[name=tool]').forEach((input) => input.addEventListener('change', () => choose(input.value)));
  find('joint').addEventListener('change', () => { shown.selected = find('joint').value; update(); });
  find('visible').addEventListener('change', visible);
  find('part').addEventListener('change', () => choose('parts'));
  for (const [id, act] of Object.entries({ swap, undo, redo, save, solid })) find(id).addEventListener('click', act);

  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  document.addEventListener('keydown', (event) => {
    // Wherever the focus is, arrows move the chosen joint; only of the other controls they are the control's own.
    const own = event.target.matches('select:not(#joint), input[type=range], input[type=radio]');
    const step = own || event.ctrlKey || event.metaKey || event.altKey ? undefined : steps[event.key];
    if (event.key === ' ' && event.target !== canvas) return;
    if (step && shown.tool === 'joints') {
      const [x, y] = drawing.joints[shown.selected];
      const far = event.shiftKey ? 10 : 1;
      edit(`key ${shown.selected}`, () => drawing.moveJoint(shown.selected, x + far * step[0], y + far * step[1]));
    } else if (step) {
      const [x, y] = shown.cursor;
      const far = event.shiftKey ? 10 * radius() : Math.max(radius(), 1);
      shown.cursor = [x + far * step[0], y + far * step[1], radius()];
      shown.draw();
    } else if (event.key === ' ' && shown.tool !== 'joints') {
      const place = shown.cursor.slice(0, 2);
      drawing.beginStroke();
      shown.refresh(drawing.paint(place, place, radius(), brush()));
      drawing.endStroke();
      changed();
    } else return;
    event.preventDefault();
  });
  const keys = {
    1: () => choose('joints'), 2: () => choose('mask'), 3: () => choose('parts'),
    e: () => find('erase').click(), '[': () => width(0.8), ']': () => width(1.25), v: visible, s: swap, p: solid,
    n: (event) => {
      const { names } = drawing;
      shown.selected = names[(names.indexOf(shown.selected) + (event.shiftKey ? names.length - 1 : 1)) % names.length];
      update();
    },
    '+': () => shown.zoomAt([drawing.width / 2, drawing.height / 2], 1.25),
    '-': () => shown.zoomAt([drawing.width / 2, drawing.height / 2], 0.8),
    0: () => shown.fit(),
  };
  document.addEventListener('keydown', (event) => {
    if (event.target.matches('select:not(#joint), input[type=range]')) return;
    if (event.target.matches('#joint') && !event.ctrlKey && !event.metaKey) return; // letters choose from the list
    const key = event.key.toLowerCase();
    if (event.ctrlKey || event.metaKey) {
      const act = { s: save, z: event.shiftKey ? redo : undo, y: redo }[key];
      if (!act) return;
      event.preventDefault();
      act();
    } else if (!event.altKey) keys[key]?.(event);
  });
  window.addEventListener('beforeunload', (event) => { if (drawing.revision !== saved) event.preventDefault(); });

  Object.assign(window, { fig2mesh: { drawing, shown } });
  update();
  document.documentElement.dataset.ready = '1';
}

start().catch((error) => tell(String(error.message ?? error), true));
