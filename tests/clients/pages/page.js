// One page for all clients: a module for each is loaded when its first job comes.
//
// start({client, options})        begin with a client; its version
// open({kind, url, ...}, seconds) load an output: {error} or {seconds, reads: {calls, texels}}
// look(camera, seconds)           draw from a camera: {error} or {figures: [{name, matrix, low, high}], ...}; matrix is
//                                 column-major, from the coordinates of the file's vertices to those of the client's
//                                 world: ECEF for placed outputs, the model's own (y up, front +z) for the others
// A camera is {eye, target, up, fov_deg, bearing_deg, rows_per_m, seen: {lon_deg, lat_deg, height_m}}, with `eye` and
// `target` in world coordinates, `seen` the target on the earth; with `rows`, CesiumJS selects tiles as in a view of so
// many rows, and figures have the `tile` that they come from.
const host = document.getElementById('host');
const reads = { calls: 0, texels: 0, budget: Infinity };

// Readbacks of pixels are counted: some clients read property textures in this way, once for each vertex.
for (const Context of [CanvasRenderingContext2D, OffscreenCanvasRenderingContext2D]) {
  const read = Context.prototype.getImageData;
  Context.prototype.getImageData = function getImageData(x, y, width, height, ...rest) {
    reads.calls += 1;
    reads.texels += width * height;
    if (reads.texels > reads.budget) throw new Error(`more than ${reads.budget} texels read back`);
    return read.call(this, x, y, width, height, ...rest);
  };
}

let client = null;
let opened = null;

const within = async (seconds, promise) => {
  let clock;
  window.fig2mesh.late = false; // ends the loops that wait for something, see `frames`
  const late = new Promise((_, failed) => {
    clock = setTimeout(() => { window.fig2mesh.late = true; failed(new Error(`nothing within ${seconds} s`)); }, 1000 * seconds);
  });
  try {
    return await Promise.race([promise, late]);
  } finally {
    clearTimeout(clock);
    // Or a loop that is late goes on beside what comes next, which resets the flag.
    if (window.fig2mesh.late) await Promise.race([promise.catch(() => {}), new Promise((done) => { setTimeout(done, 5000); })]);
  }
};
const guarded = async (act) => {
  try {
    return await act();
  } catch (error) {
    return { error: String(error?.message ?? error) };
  }
};

window.fig2mesh = {};
window.matrix = {
  start: ({ client: name, options = {} }) => guarded(async () => {
    opened?.close?.();
    client?.end?.();
    host.replaceChildren();
    opened = client = null;
    const module = await import(`./${name}.js`);
    client = await module.start(host, options);
    return { version: client.version ?? null };
  }),
  open: (job, seconds = 60) => guarded(async () => {
    opened?.close?.();
    opened = null;
    Object.assign(reads, { calls: 0, texels: 0, budget: job.texels ?? Infinity });
    const begin = performance.now();
    opened = await within(seconds, client.open(job));
    return { seconds: (performance.now() - begin) / 1000, reads: { calls: reads.calls, texels: reads.texels } };
  }),
  look: (camera, seconds = 60) => guarded(async () => {
    const begin = performance.now();
    const figures = await within(seconds, opened.look(camera));
    const count = { calls: reads.calls, texels: reads.texels };
    return { figures, seconds: (performance.now() - begin) / 1000, reads: count };
  }),
};
document.documentElement.dataset.ready = '';
