// What is edited: joints, limbs, and a byte for each pixel; every change can be undone.
'use strict';

const INSIDE = 128;
const MOST_STEPS = 200;

class AnnotatedDrawing {
  /** @param {ArrayBuffer} message as fig2mesh.annotate.editing packs it */
  constructor(message) {
    const length = new DataView(message).getUint32(0, true);
    this.head = JSON.parse(new TextDecoder().decode(new Uint8Array(message, 4, length)));
    const { width, height, joints, depth_order } = this.head;
    [this.width, this.height] = [width, height];
    this.pixels = new Uint8Array(message.slice(4 + length));
    this.joints = structuredClone(joints);
    this.order = { ...depth_order };
    this.names = Object.keys(joints);
    [this.past, this.future] = [[], []];
    this.revision = 0;
  }

  packed() {
    const { joints, order, pixels } = this;
    const head = new TextEncoder().encode(JSON.stringify({ joints, depth_order: order }));
    const message = new Uint8Array(4 + head.length + pixels.length);
    new DataView(message.buffer).setUint32(0, head.length, true);
    message.set(head, 4);
    message.set(pixels, 4 + head.length);
    return message;
  }

  /** Change joints or limbs; changes of one `kind` that follow each other are undone at once. */
  change(kind, edit) {
    const before = { joints: structuredClone(this.joints), order: { ...this.order } };
    edit(this);
    const last = this.past.at(-1);
    if (!(kind && last?.kind === kind)) this.remember({ kind, ...before });
    this.revision += 1;
  }

  moveJoint(name, x, y) {
    const joint = this.joints[name];
    joint[0] = Math.min(Math.max(x, 0), this.width);
    joint[1] = Math.min(Math.max(y, 0), this.height);
  }

  swapSides() {
    for (const name of this.names.filter((each) => each.startsWith('l_'))) {
      const twin = `r_${name.slice(2)}`;
      [this.joints[name], this.joints[twin]] = [this.joints[twin], this.joints[name]];
    }
    for (const limb of ['arm', 'leg']) {
      const [left, right] = [this.order[`l_${limb}`], this.order[`r_${limb}`]];
      for (const [side, value] of [['l', right], ['r', left]]) {
        if (value) this.order[`${side}_${limb}`] = value;
        else delete this.order[`${side}_${limb}`];
      }
    }
    const { parts } = this.head;
    const twin = parts.map((part) => {
      const other = { l_: 'r_', r_: 'l_' }[part.slice(0, 2)];
      return other ? parts.indexOf(other + part.slice(2)) : parts.indexOf(part);
    });
    for (let i = 0; i < this.pixels.length; i += 1) {
      const value = this.pixels[i];
      this.pixels[i] = (value & INSIDE) | twin[value & (INSIDE - 1)];
    }
  }

  beginStroke() {
    this.before = this.pixels.slice();
    this.touched = [this.width, this.height, 0, 0];
  }

  /** Set the pixels of a round brush along a line; returns the rectangle [x0, y0, x1, y1) that it lies in. */
  paint([ax, ay], [bx, by], radius, set) {
    const { width, height, pixels } = this;
    const reach = Math.max(radius, 0.5);
    const x0 = Math.max(Math.floor(Math.min(ax, bx) - reach), 0);
    const x1 = Math.min(Math.ceil(Math.max(ax, bx) + reach), width);
    const y0 = Math.max(Math.floor(Math.min(ay, by) - reach), 0);
    const y1 = Math.min(Math.ceil(Math.max(ay, by) + reach), height);
    const [dx, dy] = [bx - ax, by - ay];
    const length = dx * dx + dy * dy;
    for (let y = y0; y < y1; y += 1) {
      for (let x = x0; x < x1; x += 1) {
        const [px, py] = [x + 0.5 - ax, y + 0.5 - ay];
        const along = length > 0 ? Math.min(Math.max((px * dx + py * dy) / length, 0), 1) : 0;
        if ((px - along * dx) ** 2 + (py - along * dy) ** 2 <= reach * reach) {
          const i = y * width + x;
          pixels[i] = set(pixels[i]);
        }
      }
    }
    const [l, t, r, b] = this.touched;
    this.touched = [Math.min(l, x0), Math.min(t, y0), Math.max(r, x1), Math.max(b, y1)];
    return [x0, y0, x1, y1];
  }

  endStroke() {
    const [x0, y0, x1, y1] = this.touched;
    if (x1 > x0 && y1 > y0) {
      this.remember({ box: this.touched, patch: this.cut(this.before, this.touched) });
      this.revision += 1;
    }
    this.before = null;
  }

  cut(source, [x0, y0, x1, y1]) {
    const patch = new Uint8Array((x1 - x0) * (y1 - y0));
    for (let y = y0; y < y1; y += 1) {
      patch.set(source.subarray(y * this.width + x0, y * this.width + x1), (y - y0) * (x1 - x0));
    }
    return patch;
  }

  remember(step) {
    this.past.push(step);
    if (this.past.length > MOST_STEPS) this.past.shift();
    this.future = [];
  }

  undo() { return this.replace(this.past, this.future); }

  redo() { return this.replace(this.future, this.past); }

  replace(from, to) {
    const step = from.pop();
    if (!step) return false;
    if (step.box) {
      const [x0, y0, x1, y1] = step.box;
      to.push({ box: step.box, patch: this.cut(this.pixels, step.box) });
      for (let y = y0; y < y1; y += 1) {
        this.pixels.set(step.patch.subarray((y - y0) * (x1 - x0), (y - y0 + 1) * (x1 - x0)), y * this.width + x0);
      }
    } else {
      // Swapping sides changes pixels too; it is its own opposite.
      to.push({ kind: step.kind, joints: structuredClone(this.joints), order: { ...this.order } });
      if (step.kind === 'swap') this.swapSides();
      else Object.assign(this, { joints: step.joints, order: step.order });
    }
    this.revision += 1;
    return true;
  }
}
