"use strict";
// Spreads the frames that come over the sources of the plots. See fleetloop/live/frame.py.
const facts = JSON.parse(document.getElementById("facts").textContent);
const legend = facts.legend;
const R = legend.robots.length, N = legend.now.length, S = legend.series.length;
const K = legend.charted.length, E = legend.edges.length, W = 1 + K * S, H = legend.head.length;
const NOW = Object.fromEntries(legend.now.map((name, at) => [name, at]));
const SERIES = Object.fromEntries(legend.series.map((name, at) => [name, at]));
const PAIRS = legend.edges
  .map(([speaker, hearer]) => [legend.charted.indexOf(speaker), legend.charted.indexOf(hearer)])
  .filter(([speaker, hearer]) => speaker >= 0 && hearer >= 0).slice(0, 24);
const LEAST = 1e-5, POINTS = 480, TRAIL_S = 30, TRAIL_POINTS = 400;
const [OK, ABSENT, DEAD] = [0, 1, 2];
const LEAST_HALF = {theta_e: 0.02, difference: 0.02, tau_right: 0.5, tau_left: 0.5};

const hidden = new Set();
const view = {plane: "all", window: 20, half: {}, top: 1, last: null, every: 1, busy: false};
const models = {};
const store = {rows: 0, data: new Float64Array(4096 * W)};
const field = (data, name) => (data instanceof Map ? data.get(name) : data[name]);
const finite = Number.isFinite;

function connect(doc) {
  for (const name of ["feed", "board", "heard", "orders", "plane", "plane_x", "plane_y", "paths", "trails",
    "edges", "edge_marks", "references", "bodies", "series_0", "series_1", "pairs", "time_0", "time_1", ...Object.keys(LEAST_HALF), "x_e", "y_e",
    ...[...Object.keys(LEAST_HALF), "x_e", "y_e"].map((chart) => `${chart}_y`)])
    models[name] = doc.get_model_by_name(name);
  models.feed.properties.data.change.connect(() => take(field(models.feed.data, "frame")));
  models.board.properties.data.change.connect(() => takeBoard());
  if (matchMedia("(max-width: 700px)").matches) models.plane.toolbar.active_drag = null;
  watchGestures();
  models.heard.data = {frame: [0]};
}

// --- a frame ---------------------------------------------------------------------------------------

function take(array) {
  if (!array || array.length < H) return;
  const frame = new Float64Array(array.buffer, array.byteOffset, array.length); // Bokeh's own type has other rules
  const [number, tick, t_s, whole, rows] = frame;
  const at_now = H, at_edges = at_now + R * N, at_rows = at_edges + 3 * E;
  const now = frame.subarray(at_now, at_edges), edges = frame.subarray(at_edges, at_rows);
  keep(frame.subarray(at_rows, at_rows + rows * W), rows, whole !== 0);
  view.last = {number, tick, t_s, now, edges};
  countFrame();
  drawPlane(now, edges, t_s);
  if (number % view.every === 0) drawCharts(now, t_s, Math.floor(number / view.every) % 2);
  showClock(t_s);
  // The answer goes when the browser has painted: a slow one is sent less. To take an answer costs
  // the viewer more than to send a frame, so one that keeps up answers seldom.
  if (number % (view.every > 1 ? 2 : 6) === 0 || board?.ended) requestAnimationFrame(answer);
}

let answered_to = 0;
function answer() {
  const {number} = view.last;
  if (number > answered_to) models.heard.data = {frame: [answered_to = number]};
}
// The viewer waits for an answer before it sends many more: none may be missing.
setInterval(() => { if (view.last && view.last.number > answered_to) requestAnimationFrame(answer); }, 500);

function keep(rows, count, whole) {
  if (whole) store.rows = 0;
  const need = (store.rows + count) * W;
  if (need > store.data.length) {
    const grown = new Float64Array(2 * need);
    grown.set(store.data.subarray(0, store.rows * W));
    store.data = grown;
  }
  store.data.set(rows, store.rows * W);
  store.rows += count;
}

let frames = 0, since = performance.now();
function countFrame() {
  frames += 1;
  const now = performance.now();
  if (now - since < 1000) return;
  const rate = frames * 1000 / (now - since);
  view.every = rate < 0.8 * 1000 / facts.frame_ms ? Math.min(view.every + 1, 4) : Math.max(view.every - 1, 1);
  document.getElementById("rate").textContent = `${rate.toFixed(0)} Hz`;
  frames = 0; since = now;
}

// --- the plane -------------------------------------------------------------------------------------

function firstRow(t_s) { // of the stored rows, the first at or after a time
  let low = 0, high = store.rows;
  while (low < high) {
    const mid = (low + high) >> 1;
    if (store.data[mid * W] < t_s) low = mid + 1; else high = mid;
  }
  return low;
}

function drawPlane(now, edges, t_s) {
  const scale = fitPlane(now), places = [];
  for (let r = 0; r < R; r++) places.push([now[r * N + NOW.x], now[r * N + NOW.y], now[r * N + NOW.theta]]);
  drawTrails(now, t_s);
  const colours = facts.styles.map((style) => style.colour);
  const pick = (name) => Array.from({length: R}, (_, r) => now[r * N + NOW[name]]);
  models.references.data = {x: pick("x_d"), y: pick("y_d"), colour: colours};
  drawEdges(places, edges, scale);
  const xs = [], ys = [], label_x = [], label_y = [], least = leastSize(places, scale);
  places.forEach(([x, y, theta], r) => {
    const size = Math.max(facts.lengths_m[r], least), c = Math.cos(theta), s = Math.sin(theta);
    const shape = [[0.62, 0], [0.2, 0.42], [-0.5, 0.42], [-0.5, -0.42], [0.2, -0.42]];
    xs.push(shape.map(([a, l]) => x + size * (a * c - l * s)));
    ys.push(shape.map(([a, l]) => y + size * (a * s + l * c)));
    const angle = R <= 24 ? labelAngle(places, r, 3.5 * size) : 0;
    label_x.push(x + (0.6 * size + 13 * scale) * Math.cos(angle)); label_y.push(y + (0.6 * size + 10 * scale) * Math.sin(angle));
  });
  const names = R <= 24 ? legend.robots : legend.robots.map(() => "");
  const ink = getComputedStyle(document.documentElement).getPropertyValue("--text").trim();
  models.bodies.data = {xs, ys, colour: colours, name: names, x: pick("x"), y: pick("y"), label_x, label_y,
    label_colour: names.map(() => ink)};
}

function leastSize(places, scale) { // in metres: robots are seen from afar, and don't hide each other
  const gaps = places.map(([x, y], r) => Math.min(...places.map(([u, v], other) => (other === r ? Infinity : Math.hypot(u - x, v - y)))));
  const gap = gaps.filter(finite).sort((a, b) => a - b)[gaps.length >> 1] ?? Infinity;
  return scale * Math.min(20, Math.max(8, (0.8 * gap) / scale));
}

const label_at = new Map();
function labelAngle(places, r, near) { // away from edges, from robots that are near, and from the path
  const [x, y, theta] = places[r], taken = [theta, theta + Math.PI];
  places.forEach(([u, v], other) => {
    const linked = legend.edges.some(([a, b]) => (a === legend.robots[r] && b === legend.robots[other]) || (b === legend.robots[r] && a === legend.robots[other]));
    if (other !== r && (linked || Math.hypot(u - x, v - y) < near)) taken.push(Math.atan2(v - y, u - x));
  });
  const room = (angle) => Math.min(...taken.map((one) => Math.abs(Math.atan2(Math.sin(angle - one), Math.cos(angle - one)))));
  let best = label_at.get(r) ?? Math.PI / 2;
  for (let n = 0; n < 16; n++) { const angle = (n * Math.PI) / 8; if (room(angle) > room(best) + 0.35) best = angle; }
  label_at.set(r, best);
  return best;
}

function drawTrails(now, t_s) {
  const first = firstRow(t_s - TRAIL_S), step = Math.max(1, Math.ceil((store.rows - first) / TRAIL_POINTS));
  const xs = [], ys = [];
  for (let k = 0; k < K; k++) {
    const x = [], y = [];
    for (let row = first; row < store.rows; row += step) {
      x.push(store.data[row * W + 1 + k * S + SERIES.x]); y.push(store.data[row * W + 1 + k * S + SERIES.y]);
    }
    x.push(now[k * N + NOW.x]); y.push(now[k * N + NOW.y]);
    xs.push(x); ys.push(y);
  }
  for (let r = K; r < R; r++) { xs.push([]); ys.push([]); }
  models.trails.data = {xs, ys, colour: facts.styles.map((style) => style.colour)};
}

function drawEdges(places, edges, scale) {
  const style = getComputedStyle(document.documentElement), tone = (name) => style.getPropertyValue(name).trim();
  const x0 = [], y0 = [], x1 = [], y1 = [], colour = [], width = [], dash = [];
  const x = [], y = [], angle = [], marker = [], mark_colour = [];
  legend.edges.forEach(([speaker, hearer], e) => {
    const [age, lost, state] = edges.subarray(3 * e, 3 * e + 3);
    const [ax, ay] = places[legend.robots.indexOf(speaker)], [bx, by] = places[legend.robots.indexOf(hearer)];
    const long = Math.hypot(bx - ax, by - ay);
    if (!(long > 0) || state === ABSENT) return;
    const ux = (bx - ax) / long, uy = (by - ay) / long, gap = Math.min(16 * scale, 0.3 * long);
    // Beside the line between both, so that the edges of both directions are apart.
    const ox = -uy * 3 * scale, oy = ux * 3 * scale;
    x0.push(ax + ux * gap + ox); y0.push(ay + uy * gap + oy); x1.push(bx - ux * gap + ox); y1.push(by - uy * gap + oy);
    const ink = state === DEAD ? tone("--failed") : lost > 0.05 ? tone("--open") : tone("--muted");
    colour.push(ink); mark_colour.push(ink);
    width.push((R <= 24 ? 1 : 0.5) * (state === DEAD ? 1.5 : 1 + 2 / (1 + 5 * (finite(age) ? age : 0))));
    dash.push(state === DEAD ? [2, 5] : lost > 0.05 ? [8, 4] : []);
    const at = state === DEAD ? 0.5 : 0.62;
    x.push(ax + (bx - ax) * at + ox); y.push(ay + (by - ay) * at + oy);
    angle.push(Math.atan2(uy, ux) - Math.PI / 2); marker.push(state === DEAD ? "x" : "triangle");
  });
  models.edges.data = {x0, y0, x1, y1, colour, width, dash};
  models.edge_marks.data = {x, y, angle, marker, colour: mark_colour};
}

function fitPlane(now) { // sets the ranges as the view wants them; returns metres per pixel
  const {plane, plane_x: X, plane_y: Y} = models, wide = plane.inner_width || 600, high = plane.inner_height || 400;
  if (view.plane !== "free") {
    let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
    const include = (x, y) => {
      if (!finite(x) || !finite(y)) return;
      x0 = Math.min(x0, x); x1 = Math.max(x1, x); y0 = Math.min(y0, y); y1 = Math.max(y1, y);
    };
    for (let r = 0; r < R; r++) {
      include(now[r * N + NOW.x], now[r * N + NOW.y]); include(now[r * N + NOW.x_d], now[r * N + NOW.y_d]);
    }
    if (view.plane === "all") for (const [x, y] of corners()) include(x, y);
    if (finite(x0)) {
      const scale = Math.max((x1 - x0) / Math.max(wide - 70, 50), (y1 - y0) / Math.max(high - 70, 50), 0.002);
      const cx = (x0 + x1) / 2, cy = (y0 + y1) / 2;
      const near = (range, low, high) => Math.abs(range.start - low) + Math.abs(range.end - high) < 0.01 * (high - low);
      const [l, r, b, t] = [cx - scale * wide / 2, cx + scale * wide / 2, cy - scale * high / 2, cy + scale * high / 2];
      if (view.plane === "fleet" || !near(X, l, r) || !near(Y, b, t)) { X.setv({start: l, end: r}); Y.setv({start: b, end: t}); }
    }
  }
  return Math.abs(X.end - X.start) / wide;
}

let course_corners = null;
function corners() { // of the box around all courses
  if (course_corners) return course_corners;
  const span = (name) => {
    let low = Infinity, high = -Infinity;
    for (const line of field(models.paths.data, name)) for (const value of line)
      if (finite(value)) { low = Math.min(low, value); high = Math.max(high, value); }
    return [low, high];
  };
  const [x0, x1] = span("xs"), [y0, y1] = span("ys");
  course_corners = [[x0, y0], [x1, y1], ...facts.starts];
  return course_corners;
}

// --- over time -------------------------------------------------------------------------------------

// The charts come in two rows; each frame draws one of them, so that a frame costs half.
const CHARTS = [["x_e", "y_e", "theta_e"], ["tau_right", "tau_left"]];

function drawCharts(now, t_s, row) {
  const time = models[`time_${row}`], span = view.window;
  if (span === 0) time.setv({start: 0, end: Math.max(t_s, 1)});
  else time.setv({start: Math.max(0, t_s - span), end: Math.max(span, t_s)});
  const first = Math.max(0, firstRow(time.start) - 1), end = store.rows, shown = [...Array(K).keys()].filter((k) => !hidden.has(k));
  const step = Math.max(1, Math.ceil((end - first) / POINTS)), starts = [];
  for (let at = first; at < end; at += step) starts.push(at);
  const t = starts.map((at) => store.data[Math.min(at + step, end) * W - W]);
  t.push(t_s);
  const peak = (k, name) => starts.map((begin) => {
    let kept = NaN;
    for (let i = begin; i < Math.min(begin + step, end); i++) {
      const value = store.data[i * W + 1 + k * S + SERIES[name]];
      if (finite(value) && !(Math.abs(kept) >= Math.abs(value))) kept = value;
    }
    return kept;
  });
  const line = (k, name) => { const made = peak(k, name); made.push(now[k * N + NOW[name]]); return made; };
  const style = (k) => facts.styles[k];
  const data = {t: shown.map(() => t), robot: shown.map((k) => legend.charted[k]),
    colour: shown.map((k) => style(k).colour), dash: shown.map((k) => style(k).dash)};
  for (const name of CHARTS[row]) {
    const lines = shown.map((k) => line(k, name)), decades = name === "x_e" || name === "y_e";
    data[name] = decades ? lines.map((one) => one.map((value) => (finite(value) ? Math.max(Math.abs(value), LEAST) : NaN))) : lines;
    (decades ? fitDecades : fitHalf)(name, data[name]);
  }
  models[`series_${row}`].data = data;
  if (row === 1) drawPairs(t, starts, step, end, now);
}

function drawPairs(t, starts, step, end, now) {
  const s = (row, k) => store.data[row * W + 1 + k * S + SERIES.s];
  const still = board !== null && board.run.state === "paused";
  const pairs = PAIRS.filter(([speaker, hearer]) => !hidden.has(speaker) && !hidden.has(hearer));
  const difference = pairs.map(([j, i]) => {
    const made = starts.map((row) => { const at = Math.min(row + step, end) - 1; return s(at, i) - s(at, j); });
    // While the run goes on, the newest rows of two robots are of different ticks.
    made.push(still ? now[i * N + NOW.s] - now[j * N + NOW.s] : NaN);
    return made;
  });
  models.pairs.data = {t: pairs.map(() => t), difference,
    robot: pairs.map(([j, i]) => `${legend.charted[i]} − ${legend.charted[j]}`),
    colour: pairs.map(([, i]) => facts.styles[i].colour), dash: pairs.map(([, i]) => facts.styles[i].dash)};
  fitHalf("difference", difference);
}

function fitHalf(name, lines) { // a symmetric range that all but rare peaks are in
  const sizes = lines.flat().filter(finite).map(Math.abs).sort((a, b) => a - b);
  const torque = name.startsWith("tau");
  const most = sizes.length ? sizes[Math.floor((sizes.length - 1) * (torque ? 0.97 : 1))] : 0;
  let wanted = Math.max(1.15 * most, LEAST_HALF[name]);
  const limits = torque ? Object.values(facts.torque_limits).filter((limit) => limit !== null) : [];
  const limit = Math.max(0, ...limits);
  if (limit && limit < 5 * wanted) wanted = 1.2 * limit;
  const half = view.half[name] || 0;
  if (wanted > half || wanted < 0.35 * half) {
    const power = 10 ** Math.floor(Math.log10(wanted));
    view.half[name] = [1, 1.5, 2, 3, 5, 7.5, 10].find((m) => m * power >= wanted * 0.9999) * power;
    models[`${name}_y`].setv({start: -view.half[name], end: view.half[name]});
  }
}

function fitDecades(name, lines) {
  const most = Math.max(1, ...lines.flat().filter(finite));
  const top = 10 ** Math.ceil(Math.log10(most * 1.01));
  if (top !== view.half[name]) { view.half[name] = top; models[`${name}_y`].setv({start: LEAST, end: top}); }
}

// --- the view --------------------------------------------------------------------------------------

function press(group, attribute, value) {
  for (const button of document.getElementById(group).children)
    button.setAttribute("aria-pressed", String(button.dataset[attribute] === String(value)));
}

function watchGestures() { // a plot that is moved by hand is left as it is
  const plane = document.getElementById("plane_box");
  const free = () => { view.plane = "free"; press("view", "view", "free"); };
  plane.addEventListener("wheel", free, {passive: true});
  plane.addEventListener("pointermove", (event) => { if (event.buttons && models.plane.toolbar.active_drag !== null) free(); });
}

function redraw() {
  if (!view.last) return;
  drawPlane(view.last.now, view.last.edges, view.last.t_s);
  for (const row of [0, 1]) drawCharts(view.last.now, view.last.t_s, row);
}

document.getElementById("view").addEventListener("click", (event) => {
  if (!event.target.dataset.view) return;
  view.plane = event.target.dataset.view; press("view", "view", view.plane); redraw();
});
document.getElementById("window").addEventListener("click", (event) => {
  if (!event.target.dataset.window) return;
  view.window = Number(event.target.dataset.window); press("window", "window", view.window); redraw();
});
addEventListener("resize", () => setTimeout(redraw, 200));
