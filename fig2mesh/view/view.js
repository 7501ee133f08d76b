// One figure on one canvas: textures, programs specialised by effect, and a camera. No controls; see page.js.
'use strict';

const EFFECTS = [
  'texture', 'blend', 'creases', 'light', 'ao', 'outline', 'smooth-union', 'perspective', 'antialias',
];
const OF_TEXTURE = ['blend', 'creases']; // nothing without it
const VERTEX = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0, 1); }`;

const bytes = (base64) => Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));

async function inflate(packed) {
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// 16-bit numbers from a stream that has all low bytes before all high bytes.
async function halves(base64) {
  const planes = await inflate(bytes(base64));
  const count = planes.length / 2;
  const values = new Uint16Array(count);
  for (let i = 0; i < count; i++) values[i] = planes[i] | (planes[count + i] << 8);
  return values;
}

async function decodeFigure(figure) {
  const blob = new Blob([bytes(figure.paint)], { type: figure.paint_type });
  const [field, depth, paint] = await Promise.all([
    halves(figure.field),
    halves(figure.depth.z),
    createImageBitmap(blob, { premultiplyAlpha: 'none', colorSpaceConversion: 'none' }),
  ]);
  return { field, depth, paint };
}

class FigureView {
  constructor(canvas, figure, decoded, shader) {
    Object.assign(this, { canvas, figure, decoded, shader });
    this.effects = new Set(figure.effects);
    this.camera = { yaw: 0, pitch: 0, zoom: 1 };
    // What a page shows from top to bottom at zoom 1: the whole figure from whatever side.
    const [low, high] = figure.bounds;
    this.centre = low.map((a, i) => (a + high[i]) / 2);
    this.diagonal = Math.hypot(...low.map((a, i) => high[i] - a));
    this.height = 1.1 * Math.max(high[1] - low[1], 0.8 * this.diagonal);
    this.program = { defines: [], compiles: 0, source: '', handle: null };
    this.frames = 0;
    canvas.addEventListener('webglcontextlost', (event) => event.preventDefault());
    canvas.addEventListener('webglcontextrestored', () => { this.load(); this.draw(); });
    this.load();
  }

  load() {
    const gl = this.canvas.getContext('webgl2', { antialias: false, depth: false, powerPreference: 'high-performance' });
    if (!gl) throw new Error('This browser has no WebGL 2, which the figure is drawn with.');
    this.gl = gl;
    this.program.handle = null;
    const { figure, decoded } = this;
    if (Math.max(...figure.size) > gl.getParameter(gl.MAX_3D_TEXTURE_SIZE)) {
      throw new Error(`This device's 3D textures are too small for a field of ${figure.size.join(' x ')}.`);
    }
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    this.fieldTexture(decoded.field);
    this.texture(1, gl.LINEAR_MIPMAP_LINEAR, gl.LINEAR);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, decoded.paint);
    gl.generateMipmap(gl.TEXTURE_2D);
    this.texture(2, gl.NEAREST, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R16F, ...figure.depth.size, 0, gl.RED, gl.HALF_FLOAT, decoded.depth);
    this.buffer(0, figure.bricks.flatMap((b) => [
      ...b.box[0], b.spacing, ...b.box[1], 1 / b.slope, ...b.origin, 0, ...b.place, b.slot,
      ...b.nodes.map((n) => n - 1), 0, ...b.owners, 0, 0,
    ]));
    this.buffer(1, figure.slots.flatMap((s) => [...s.place, ...s.window]));
  }

  texture(unit, small, large, target = this.gl.TEXTURE_2D) {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(target, gl.createTexture());
    gl.texParameteri(target, gl.TEXTURE_MIN_FILTER, small);
    gl.texParameteri(target, gl.TEXTURE_MAG_FILTER, large);
    for (const axis of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R]) {
      gl.texParameteri(target, axis, gl.CLAMP_TO_EDGE);
    }
  }

  fieldTexture(values) {
    const { gl, figure } = this;
    this.texture(0, gl.LINEAR, gl.LINEAR, gl.TEXTURE_3D);
    gl.texStorage3D(gl.TEXTURE_3D, 1, gl.R16F, ...figure.size);
    let first = 0;
    for (const { place, nodes } of figure.bricks) {
      const count = nodes[0] * nodes[1] * nodes[2];
      const brick = values.subarray(first, first + count);
      gl.texSubImage3D(gl.TEXTURE_3D, 0, ...place, ...nodes, gl.RED, gl.HALF_FLOAT, brick);
      first += count;
    }
  }

  buffer(point, numbers) {
    const { gl } = this;
    gl.bindBufferBase(gl.UNIFORM_BUFFER, point, gl.createBuffer());
    gl.bufferData(gl.UNIFORM_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
  }

  // Grids that the program traces: without smooth union fillets are not looked at.
  get traced() {
    return this.effects.has('smooth-union') ? this.figure.bricks.length : this.figure.parts;
  }

  get defines() {
    const there = (effect) => this.effects.has(effect) && (this.effects.has('texture') || !OF_TEXTURE.includes(effect));
    return EFFECTS.filter(there).map((effect) => effect.toUpperCase().replace('-', '_'));
  }

  set(effect, on) {
    if (!EFFECTS.includes(effect)) throw new Error(`no effect ${effect}; there are ${EFFECTS.join(', ')}`);
    if (on) this.effects.add(effect); else this.effects.delete(effect);
  }

  compile() {
    const { gl, program } = this;
    const defines = this.defines;
    if (program.handle && program.defines.join() === defines.join()) return;
    const numbers = {
      GRIDS: this.figure.bricks.length, TRACED: this.traced, SLOTS: this.figure.slots.length,
      CLAY: 'vec3(0.808, 0.745, 0.682)',
      ...(defines.includes('TEXTURE') ? { AMBIENT: '0.5', DIFFUSE: '0.55' } : { AMBIENT: '0.3', DIFFUSE: '0.75' }),
    };
    const head = [...defines.map((d) => `#define ${d}`), ...Object.entries(numbers).map(([k, v]) => `#define ${k} ${v}`)];
    const source = `#version 300 es\n${head.join('\n')}\n${this.shader}`;
    const handle = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, source]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(handle, shader);
      gl.deleteShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new Error(gl.getShaderInfoLog(shader));
      }
    }
    gl.linkProgram(handle);
    if (!gl.getProgramParameter(handle, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(gl.getProgramInfoLog(handle));
    }
    if (program.handle) gl.deleteProgram(program.handle);
    Object.assign(program, { handle, defines, source, compiles: program.compiles + 1 });
    gl.useProgram(handle);
    gl.uniformBlockBinding(handle, gl.getUniformBlockIndex(handle, 'Grids'), 0);
    const slots = gl.getUniformBlockIndex(handle, 'Slots');
    if (slots !== gl.INVALID_INDEX) gl.uniformBlockBinding(handle, slots, 1);
    const { figure } = this;
    this.uniform('field', '1i', 0);
    this.uniform('paint', '1i', 1);
    this.uniform('depth', '1i', 2);
    this.uniform('depth_place', '4fv', figure.depth.place);
    this.uniform('grazing', '1f', figure.grazing);
    this.uniform('pen', '4fv', figure.pen);
    this.uniform('line', '4fv', figure.line);
  }

  // Uniforms that a specialised program does not have are passed over.
  uniform(name, kind, ...values) {
    const where = this.gl.getUniformLocation(this.program.handle, name);
    if (where) this.gl[`uniform${kind}`](where, ...values);
  }

  // Rows: right, up, back, as fig2mesh.field.camera.axes.
  get axes() {
    const [yaw, pitch] = [this.camera.yaw, this.camera.pitch].map((degrees) => (degrees * Math.PI) / 180);
    const [s, c, rise, run] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
    return [[c, 0, -s], [-s * rise, run, -c * rise], [s * run, rise, c * run]];
  }

  draw() {
    const { gl, canvas, centre, figure } = this;
    this.compile();
    const axes = this.axes;
    const reach = ({ box: [a, b] }) => axes[2].reduce((sum, x, i) => sum + Math.max(x * a[i], x * b[i]), 0);
    const nearness = figure.bricks.map(reach);
    const order = figure.bricks.map((_, g) => g).slice(0, this.traced).sort((a, b) => nearness[b] - nearness[a]);
    gl.viewport(0, 0, canvas.width, canvas.height);
    this.uniform('order', '1iv', [...order, ...Array(figure.bricks.length - order.length).fill(0)]);
    this.uniform('camera', 'Matrix3fv', false, axes.flat());
    this.uniform('centre', '3fv', centre);
    this.uniform('size', '2f', canvas.width, canvas.height);
    // Landscape pictures show the whole height, narrow ones the whole width of what a square would.
    const shown = (this.height / this.camera.zoom) * Math.max(1, (0.75 * canvas.height) / canvas.width);
    this.uniform('pixel', '1f', shown / canvas.height);
    this.uniform('far', '1f', this.effects.has('perspective') ? 2.2 * this.height : 4 * this.diagonal);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    this.frames++;
  }

  // How long a picture takes, its pixels read back so that it is finished.
  milliseconds() {
    const start = performance.now();
    this.draw();
    this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, new Uint8Array(4));
    return performance.now() - start;
  }
}
