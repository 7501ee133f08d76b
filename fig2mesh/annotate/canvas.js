// The drawing on the canvas: picture, silhouette and parts over it, joints on top; and where the pointer is on it.
'use strict';

const SHADE = 150;
const TINT = 120;

class DrawingCanvas {
  constructor(canvas, drawing, picture) {
    Object.assign(this, { canvas, drawing, picture, zoom: 1, x: 0, y: 0, selected: 'head', cursor: null, tool: 'joints' });
    this.overlay = new OffscreenCanvas(drawing.width, drawing.height);
    this.ink = this.overlay.getContext('2d', { willReadFrequently: true });
    this.refresh([0, 0, drawing.width, drawing.height]);
    new ResizeObserver(() => this.fit()).observe(canvas);
    this.fit();
  }

  /** Show the whole drawing. */
  fit() {
    const { canvas, drawing } = this;
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.max(Math.round(canvas.clientWidth * ratio), 1);
    canvas.height = Math.max(Math.round(canvas.clientHeight * ratio), 1);
    this.zoom = 0.94 * Math.min(canvas.width / drawing.width, canvas.height / drawing.height);
    this.x = (canvas.width - this.zoom * drawing.width) / 2;
    this.y = (canvas.height - this.zoom * drawing.height) / 2;
    this.draw();
  }

  /** The pixels of a rectangle have changed. */
  refresh([x0, y0, x1, y1]) {
    const { drawing } = this;
    const [width, height] = [x1 - x0, y1 - y0];
    if (width <= 0 || height <= 0) return;
    const image = this.ink.createImageData(width, height);
    for (let y = 0; y < height; y += 1) {
      for (let x = 0; x < width; x += 1) {
        const value = drawing.pixels[(y + y0) * drawing.width + x + x0];
        const label = value & (INSIDE - 1);
        const at = 4 * (y * width + x);
        if (!(value & INSIDE)) image.data.set([40, 40, 60, SHADE], at);
        else if (label) image.data.set([...drawing.head.colours[label], TINT], at);
      }
    }
    this.ink.putImageData(image, x0, y0);
  }

  /** Where on the drawing an event is, in its pixels. */
  at(event) {
    const box = this.canvas.getBoundingClientRect();
    const ratio = this.canvas.width / box.width;
    return [((event.clientX - box.left) * ratio - this.x) / this.zoom, ((event.clientY - box.top) * ratio - this.y) / this.zoom];
  }

  zoomAt([x, y], factor) {
    const next = Math.min(Math.max(this.zoom * factor, 0.01), 64);
    this.x += x * (this.zoom - next);
    this.y += y * (this.zoom - next);
    this.zoom = next;
    this.draw();
  }

  /** The joint next to a place, if it is near on the screen. */
  jointNear([x, y], reach) {
    const { joints, names } = this.drawing;
    const far = (name) => Math.hypot(joints[name][0] - x, joints[name][1] - y) * this.zoom;
    const nearest = names.reduce((best, name) => (far(name) < far(best) ? name : best));
    return far(nearest) < reach ? nearest : null;
  }

  draw() {
    const { canvas, drawing, zoom } = this;
    const pen = canvas.getContext('2d');
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.setTransform(zoom, 0, 0, zoom, this.x, this.y);
    pen.imageSmoothingEnabled = zoom < 3;
    pen.fillStyle = '#fff';
    pen.fillRect(0, 0, drawing.width, drawing.height);
    pen.drawImage(this.picture, 0, 0);
    pen.drawImage(this.overlay, 0, 0);
    pen.setTransform(1, 0, 0, 1, 0, 0);
    const place = (name) => [drawing.joints[name][0] * zoom + this.x, drawing.joints[name][1] * zoom + this.y];
    const ratio = window.devicePixelRatio || 1;
    const colour = (name) => ({ l_: '#0072b2', r_: '#d55e00' })[name.slice(0, 2)] ?? '#222';
    for (const [width, style] of [[5, () => '#fffc'], [2.5, colour]]) {
      pen.lineWidth = width * ratio;
      for (const [start, end] of drawing.head.bones) {
        pen.strokeStyle = style(end);
        pen.beginPath();
        pen.moveTo(...place(start));
        pen.lineTo(...place(end));
        pen.stroke();
      }
    }
    for (const name of drawing.names) {
      const chosen = name === this.selected && this.tool === 'joints';
      pen.beginPath();
      pen.arc(...place(name), (chosen ? 8 : 5) * ratio, 0, 2 * Math.PI);
      pen.fillStyle = drawing.joints[name][2] ? colour(name) : '#fff';
      pen.fill();
      pen.lineWidth = 2 * ratio;
      pen.strokeStyle = chosen ? '#000' : drawing.joints[name][2] ? '#fff' : colour(name);
      pen.stroke();
    }
    if (this.cursor && this.tool !== 'joints') {
      const [x, y, radius] = this.cursor;
      pen.beginPath();
      pen.arc(x * zoom + this.x, y * zoom + this.y, Math.max(radius * zoom, 2), 0, 2 * Math.PI);
      pen.lineWidth = 1.5 * ratio;
      pen.strokeStyle = '#000';
      pen.stroke();
    }
  }
}
