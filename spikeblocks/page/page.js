"use strict";
// The simulation is a WebAssembly module; this script steps it, and draws what it returns.
const LIGHT = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#56b4e9", "#e69f00"];
const DARK = ["#56b4e9", "#e69f00", "#2fc79b", "#e69bc3", "#d9c54a", "#9db7e8", "#ff8f66"];
const appearance = matchMedia("(prefers-color-scheme: dark)");
let COLOURS = LIGHT;  // in a frame, the appearance is known after this script has begun
const BUDGET = 12;  // ms of computation between two frames
const byId = (id) => document.getElementById(id);
const token = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const short = (x) => String(Number(x.toPrecision(4)));

const page = {
  columns: DATA.columns.map(() => []),  // of the present run, the time first
  ghost: null,                          // those of the run before
  playing: false, running: false, target: DATA.ticks, owed: 0, dirty: true, last: 0,
};
let core, memory, width;

async function start() {
  const packed = Uint8Array.from(atob(MODULE), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = await new Response(stream).arrayBuffer();
  const none = () => 0;  // it imports nothing that it calls
  const modules = new Proxy({}, {get: () => new Proxy({}, {get: () => none})});
  const made = await WebAssembly.instantiate(bytes, modules);
  core = made.instance.exports;
  if (core._initialize) core._initialize();
  memory = core.memory;
  width = DATA.columns.length;
  sliders();
  plots();
  begin();
  finish();
  requestAnimationFrame(frame);
}

// ---- the run

function begin() {
  core.init();
  new Float64Array(memory.buffer, core.inputs(), DATA.inputs.length).set(DATA.inputs);
  DATA.sliders.forEach(apply);
  page.columns = DATA.columns.map(() => []);
  page.owed = 0;
  page.dirty = true;
  say("");
}

function keepGhost() {
  if (page.columns[0].length > 1) page.ghost = page.columns;
}

/** Run to the end, as fast as the browser can, without blocking it. */
function finish() {
  page.running = true;
  page.playing = false;
}

function advance(ticks) {
  let left = Math.min(ticks, DATA.ticks - core.tick());
  const until = performance.now() + BUDGET;
  let chunk = 64;
  while (left > 0 && !core.failure() && performance.now() < until) {
    const now = Math.min(left, chunk);
    const before = core.tick(), count = core.advance(now, DATA.every);
    const rows = new Float64Array(memory.buffer, core.rows(), count * width);
    for (let i = 0; i < count; i++) {
      for (let j = 0; j < width; j++) page.columns[j].push(rows[i * width + j]);
    }
    left -= Math.max(1, core.tick() - before);
    chunk = Math.min(4096, 2 * chunk);
  }
  page.dirty = true;
  if (core.failure() || core.tick() >= DATA.ticks) ended();
  return left;
}

function ended() {
  page.playing = page.running = false;
  if (core.failure() === DATA.stopped) say("The run ended by its own condition.");
  else if (core.failure()) say(`The run failed: ${message()}`, true);
  else say("");
}

function message() {
  const bytes = new Uint8Array(memory.buffer, core.message());
  return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
}

function frame(now) {
  const seconds = Math.min(0.1, (now - page.last) / 1000);
  page.last = now;
  if (page.running) advance(DATA.ticks);
  else if (page.playing) {
    const speed = Number(byId("speed").value);
    page.owed = speed ? page.owed + seconds * speed / DATA.dt : DATA.ticks;
    const ticks = Math.floor(page.owed);
    page.owed -= ticks;
    if (ticks) {
      const left = advance(ticks);
      if (speed && left > ticks / 2) say("This computer is slower than the chosen speed.");
    }
  }
  if (page.dirty) draw();
  requestAnimationFrame(frame);
}

const isOver = () => core.failure() !== 0 || core.tick() >= DATA.ticks;

function say(text, failed = false) {
  const place = byId("status");
  if (place.textContent !== text) place.textContent = text;
  place.classList.toggle("failed", failed);
}

// ---- controls

function apply(slider) {
  const numbers = slider.input
    ? new Float64Array(memory.buffer, core.inputs(), DATA.inputs.length)
    : new Float64Array(memory.buffer, core.parameters(), DATA.parameters);
  slider.places.forEach((place, i) => {
    numbers[place] = slider.tables ? slider.tables[i][slider.position] : slider.value;
  });
}

function sliders() {
  DATA.sliders.forEach((slider, i) => {
    const box = document.createElement("div"), id = `slider-${i}`;
    box.className = "slider";
    box.innerHTML = `<label for="${id}"></label><output for="${id}"></output>
      <input id="${id}" type="range" min="0" max="${slider.steps}" step="1">`;
    const [label, output, input] = box.children;
    label.textContent = slider.label;
    label.title = slider.doc;
    slider.show = () => {
      slider.value = slider.numbers[slider.position];
      const text = `${short(slider.value)}${slider.unit ? " " + slider.unit : ""}`;
      input.value = slider.position;
      input.setAttribute("aria-valuetext", text);
      output.textContent = text;
    };
    slider.position = slider.first;
    slider.show();
    slider.value = slider.exact;  // what the graph has, which may lie between two positions
    input.addEventListener("input", () => {
      slider.position = Number(input.value);
      slider.show();
      changed();
    });
    byId("sliders").append(box);
  });
}

/** A value has changed: it acts from now on while the run plays, otherwise it runs again. */
function changed() {
  if (page.playing) { DATA.sliders.forEach(apply); return; }
  if (!page.running) keepGhost();
  begin();
  finish();
}

byId("play").addEventListener("click", () => {
  if (!page.playing && isOver()) { keepGhost(); begin(); }
  page.playing = !page.playing;
  page.running = false;
  page.dirty = true;
});
byId("reset").addEventListener("click", () => {
  keepGhost();
  begin();
  page.playing = page.running = false;
});
byId("defaults").addEventListener("click", () => {
  DATA.sliders.forEach((slider) => {
    slider.position = slider.first;
    slider.show();
    slider.value = slider.exact;
  });
  changed();
});
byId("save").addEventListener("click", () => {
  core.save();
  page.saved = page.columns.map((column) => column.slice());
  byId("restore").disabled = false;
  say(`Saved at ${short(core.tick() * DATA.dt)} ${DATA.unit}.`);
});
byId("restore").addEventListener("click", () => {
  keepGhost();
  core.restore();
  DATA.sliders.forEach(apply);
  page.columns = page.saved.map((column) => column.slice());
  page.running = false;
  page.dirty = true;
  say("");
});
document.addEventListener("keydown", (event) => {
  if (event.target.closest("button, select, input, summary")) return;
  if (event.key === " ") { event.preventDefault(); byId("play").click(); }
  if (event.key === "r") byId("reset").click();
});

// ---- plots

function plots() {
  COLOURS = appearance.matches ? DARK : LIGHT;
  for (const spec of DATA.plots) {
    const box = document.createElement("section");
    box.className = "plot";
    const head = document.createElement("h2");
    head.textContent = spec.title;
    box.append(head);
    byId("plots").append(box);
    const drawn = spec.kind === "plane" ? [plane(box, spec)]
      : spec.charts.map((chart) => curves(box, chart));
    spec.draw = () => drawn.forEach((one) => one());
  }
  appearance.addEventListener("change", () => location.reload());
  new ResizeObserver(() => { page.dirty = true; }).observe(byId("plots"));
}

function curves(box, spec) {
  const ink = token("--ink"), line = token("--line");
  const values = (chart, numbers) => numbers.map((x) => (x == null ? "" : short(x)));
  const axis = {stroke: ink, values, grid: {stroke: line, width: 1}, ticks: {stroke: line, width: 1}};
  const unit = spec.unit ? ` [${spec.unit}]` : "";
  const series = [{label: `t [${DATA.unit}]`, value: (u, v) => (v == null ? "" : short(v))}];
  spec.columns.forEach((column, i) => {
    const colour = COLOURS[i % COLOURS.length], value = (u, v) => (v == null ? "" : short(v));
    series.push({label: spec.labels[i], stroke: colour, width: 1.5, points: {show: false}, value});
  });
  spec.columns.forEach((column, i) => {
    const colour = COLOURS[i % COLOURS.length] + "66";
    series.push({stroke: colour, width: 1.25, dash: [5, 4], points: {show: false},
      label: `${spec.labels[i]}, run before`, value: () => ""});
  });
  const chart = new uPlot({
    width: box.clientWidth, height: 240, series,
    scales: {x: {time: false, range: [0, DATA.until]}},
    axes: [{...axis, label: `t [${DATA.unit}]`, labelSize: 18, size: 34},
           {...axis, label: unit.trim() || undefined, labelSize: unit ? 18 : 0, size: 56}],
    legend: {live: true},
  }, [[], ...spec.columns.map(() => []), ...spec.columns.map(() => [])], box);
  chart.root.querySelectorAll(".u-legend .u-series").forEach((row, i) => {
    if (i > spec.columns.length) row.style.display = "none";
  });
  return () => {
    if (chart.width !== box.clientWidth) chart.setSize({width: box.clientWidth, height: 240});
    const now = page.columns[0], before = page.ghost ? page.ghost[0] : [];
    const longer = before.length > now.length ? before : now;
    const padded = (columns, j) => {
      const values = columns ? columns[j] : [];
      return values.length < longer.length
        ? values.concat(new Array(longer.length - values.length).fill(null)) : values;
    };
    chart.setData([longer, ...spec.columns.map((j) => padded(page.columns, j)),
      ...spec.columns.map((j) => padded(page.ghost, j))]);
  };
}

function plane(box, spec) {
  const canvas = document.createElement("canvas");
  canvas.className = "plane";
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", spec.title);
  box.append(canvas);
  let view = null;
  return () => {
    const ratio = window.devicePixelRatio || 1, wide = box.clientWidth;
    view = limits(spec, view);
    const share = spec.equal ? (view[3] - view[2]) / Math.max(view[1] - view[0], 1e-9) : 0.75;
    const high = Math.round(Math.max(200, Math.min(84 + (wide - 84) * share, 460)));
    if (canvas.width !== Math.round(wide * ratio) || canvas.height !== Math.round(high * ratio)) {
      canvas.width = Math.round(wide * ratio);
      canvas.height = Math.round(high * ratio);
      canvas.style.height = `${high}px`;
    }
    const to = canvas.getContext("2d");
    to.setTransform(ratio, 0, 0, ratio, 0, 0);
    to.clearRect(0, 0, wide, high);
    const place = mapped(spec, view, wide, high);
    axesOf(to, spec, place, wide, high);
    const ink = token("--ink");
    for (const line of spec.walls) stroke(to, line.map(place), ink, 2);
    for (const [x, y, r] of spec.circles) {
      const [a, b] = place([x, y]), [c] = place([x + r, y]);
      to.beginPath(); to.arc(a, b, c - a, 0, 2 * Math.PI); to.strokeStyle = ink; to.stroke();
    }
    spec.fixed.forEach((line) => stroke(to, line.points.map(place), token("--soft"), 1.25, [6, 4]));
    for (const [columns, faint] of [[page.ghost, true], [page.columns, false]]) {
      if (!columns) continue;
      spec.pairs.forEach((pair, i) => {
        const points = columns[pair.x].map((x, k) => [x, columns[pair.y][k]]).filter(finite);
        const colour = COLOURS[i % COLOURS.length];
        stroke(to, points.map(place), faint ? colour + "55" : colour, faint ? 1.25 : 1.75,
          faint ? [5, 4] : []);
        if (faint || !points.length) return;
        const [x, y] = place(points[points.length - 1]);
        to.fillStyle = colour;
        to.beginPath();
        if (pair.theta === null) to.arc(x, y, 4, 0, 2 * Math.PI);
        else arrow(to, x, y, columns[pair.theta][columns[pair.theta].length - 1]);
        to.fill();
      });
    }
    legend(to, spec);
  };
}

const finite = ([x, y]) => Number.isFinite(x) && Number.isFinite(y);

function limits(spec, view) {
  let [left, right, low, high] = spec.view ?? view ?? [Infinity, -Infinity, Infinity, -Infinity];
  for (const columns of [page.columns, page.ghost]) {
    if (!columns) continue;
    for (const pair of spec.pairs) {
      for (const x of columns[pair.x]) { if (x < left) left = x; if (x > right) right = x; }
      for (const y of columns[pair.y]) { if (y < low) low = y; if (y > high) high = y; }
    }
  }
  if (!(left < Infinity)) return [0, 1, 0, 1];
  return [left, right, low, high];
}

function mapped(spec, view, wide, high) {
  const [left, right, low, top] = view, edge = 42;
  let sx = (wide - 2 * edge) / Math.max(right - left, 1e-9);
  let sy = (high - 2 * edge) / Math.max(top - low, 1e-9);
  if (spec.equal) sx = sy = Math.min(sx, sy, (wide - 2 * edge) / 0.5);
  const cx = (left + right) / 2, cy = (low + top) / 2;
  const place = ([x, y]) => [wide / 2 + (x - cx) * sx, high / 2 - (y - cy) * sy];
  place.across = (a) => cx + (a - wide / 2) / sx;
  place.up = (b) => cy - (b - high / 2) / sy;
  return place;
}

function axesOf(to, spec, place, wide, high) {
  to.fillStyle = token("--soft");
  to.strokeStyle = token("--line");
  to.lineWidth = 1;
  to.font = "12px system-ui, sans-serif";
  const left = place.across(44), right = place.across(wide - 10);
  const low = place.up(high - 36), top = place.up(10);
  for (const x of steps(left, right)) {
    const [a] = place([x, low]);
    to.beginPath(); to.moveTo(a, 8); to.lineTo(a, high - 34); to.stroke();
    to.textAlign = "center"; to.fillText(short(x), a, high - 20);
  }
  for (const y of steps(low, top)) {
    const [, b] = place([left, y]);
    to.beginPath(); to.moveTo(38, b); to.lineTo(wide - 8, b); to.stroke();
    to.textAlign = "right"; to.fillText(short(y), 34, b + 4);
  }
  to.textAlign = "center";
  to.fillText(spec.across, wide / 2, high - 5);
  to.save(); to.translate(10, high / 2); to.rotate(-Math.PI / 2); to.fillText(spec.up, 0, 0);
  to.restore();
}

function steps(low, high) {
  const raw = Math.max(high - low, 1e-9) / 5, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw), found = [];
  for (let x = Math.ceil(low / step); x * step <= high + 1e-12; x++) found.push(x * step);
  return found;
}

function stroke(to, points, colour, lineWidth, dash = []) {
  if (!points.length) return;
  to.beginPath();
  points.forEach(([x, y], i) => (i ? to.lineTo(x, y) : to.moveTo(x, y)));
  to.strokeStyle = colour;
  to.lineWidth = lineWidth;
  to.setLineDash(dash);
  to.stroke();
  to.setLineDash([]);
}

function arrow(to, x, y, theta) {
  const [c, s] = [Math.cos(theta), -Math.sin(theta)];
  to.moveTo(x + 11 * c, y + 11 * s);
  to.lineTo(x - 6 * c - 6 * s, y - 6 * s + 6 * c);
  to.lineTo(x - 6 * c + 6 * s, y - 6 * s - 6 * c);
}

function legend(to, spec) {
  to.font = "12px system-ui, sans-serif";
  to.textAlign = "left";
  const names = [...spec.pairs.map((p, i) => [p.label, COLOURS[i % COLOURS.length]]),
    ...spec.fixed.map((f) => [f.label, token("--soft")])];
  names.forEach(([text, colour], i) => {
    to.fillStyle = colour;
    to.fillRect(48, 13 + 16 * i, 12, 3);
    to.fillStyle = token("--ink");
    to.fillText(text, 64, 18 + 16 * i);
  });
}

function draw() {
  page.dirty = false;
  for (const spec of DATA.plots) spec.draw();
  const t = core.tick() * DATA.dt;
  byId("time").textContent = `${t.toFixed(2)} of ${short(DATA.until)} ${DATA.unit}`;
  byId("progress").value = t / DATA.until;
  byId("play").textContent = page.playing ? "Pause" : "Play";
}

start().catch((error) => say(`This browser cannot run the simulation: ${error.message}`, true));
