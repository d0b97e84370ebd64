// Plots on canvases, drawn from streams of float32 rows while they come; one cursor in all of them.
const LIGHT = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#56b4e9", "#e69f00"];
const DARK = ["#56b4e9", "#e69f00", "#2fc79b", "#e69bc3", "#d9c54a", "#9db7e8", "#ff8f66"];
const appearance = matchMedia("(prefers-color-scheme: dark)");
const colour = (i) => (appearance.matches ? DARK : LIGHT)[i % LIGHT.length];
const token = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
export const short = (x) => (Number.isFinite(x) ? String(Number(x.toPrecision(4))) : "–");
const EDGE = {left: 52, right: 10, top: 8, bottom: 30};

/** Rows of one probe: row k has the time start + k * step; of events, pairs (row, neuron). */
export class Stream {
  constructor(about) {
    Object.assign(this, about);
    this.rows = 0;
    this.data = new Float32Array(1024 * this.width);
  }
  /** Take rows from number `first` on; what was there from it on is replaced. */
  take(first, numbers) {
    const count = numbers.length / this.width;
    let begin = first;
    if (this.mode === "events") {
      begin = this.rows;
      while (begin > 0 && this.data[2 * (begin - 1)] >= first) begin--;
    }
    const end = begin + count;
    if (end * this.width > this.data.length) {
      const larger = new Float32Array(Math.max(2 * this.data.length, end * this.width));
      larger.set(this.data.subarray(0, this.rows * this.width));
      this.data = larger;
    }
    if (begin > this.rows) this.data.fill(NaN, this.rows * this.width, begin * this.width);
    this.data.set(numbers, begin * this.width);
    this.rows = end;
  }
  time(row) { return this.start + row * this.step; }
  row(time) {
    if (this.mode === "constant") return 0;
    return Math.max(0, Math.min(this.rows - 1, Math.floor((time - this.start) / this.step + 1e-6)));
  }
  value(row, column) { return this.data[row * this.width + column]; }
}

export class Plots {
  /** `on.seek(time)` is called when a plot is clicked. */
  constructor(parent, on) {
    Object.assign(this, {parent, on, streams: {}, ghost: null, plots: [], cursor: null, now: 0, until: 1,
      unit: "s", window: null, showGhost: true});
    new ResizeObserver(() => this.draw()).observe(parent);
    appearance.addEventListener("change", () => this.draw());
  }

  begin(views, keep) {
    if (keep && Object.values(this.streams).some((each) => each.rows > 1)) this.ghost = this.streams;
    else if (views.cause === "opened") this.ghost = null;
    this.streams = {};
    for (const [name, about] of Object.entries(views.streams)) this.streams[name] = new Stream(about);
    this.until = views.ticks * views.dt;
    this.unit = views.unit;
    const layout = JSON.stringify([views.plots, views.left_out]);
    if (layout !== this.layout) this.build(views);
    this.layout = layout;
  }

  build(views) {
    this.window = null;
    this.parent.replaceChildren();
    this.plots = views.plots.flatMap((spec) => {
      if (spec.kind !== "time") return [this.box(spec, spec)];
      return spec.charts.map((chart, i) => this.box(spec, chart, i));
    });
    if (views.left_out.length || !views.plots.length) {
      const note = document.createElement("p");
      note.className = "soft";
      note.textContent = views.left_out.length
        ? `Drawn by runtime run alone, since they need a whole run: ${views.left_out.join(", ")}.`
        : "The graph has no plots; add some under plots: in the text.";
      this.parent.append(note);
    }
  }

  box(spec, chart, number = 0) {
    const box = document.createElement("section");
    box.className = "plot";
    box.innerHTML = "<h2></h2><canvas role=\"img\" tabindex=\"-1\"></canvas><div class=\"legend\"></div>";
    const [head, canvas, legend] = box.children;
    head.textContent = spec.title + (chart.unit && number ? ` [${chart.unit}]` : "");
    canvas.setAttribute("aria-label", spec.title);
    this.parent.append(box);
    const plot = {spec, chart, box, canvas, legend, raster: null, drawn: 0, drawnAs: ""};
    if (spec.kind !== "plane") this.listen(plot);
    const names = spec.kind === "time" ? chart.curves.map((curve) => curve.label)
      : spec.kind === "plane" ? [...spec.pairs, ...spec.clouds].map((each) => each.label) : [];
    plot.values = names.map((name, i) => {
      const item = document.createElement("span"), mark = document.createElement("i"), text = document.createElement("span");
      mark.style.background = colour(i);
      text.textContent = name;
      item.append(mark, text);
      legend.append(item);
      return {name, text, mark, i};
    });
    return plot;
  }

  /** A click moves the cursor, dragging zooms in time, a double click shows all. */
  listen(plot) {
    const {canvas} = plot;
    let from = null;
    const time = (event) => {
      const area = canvas.getBoundingClientRect(), [left, right] = this.span();
      const share = (event.clientX - area.left - EDGE.left) / (area.width - EDGE.left - EDGE.right);
      return left + Math.max(0, Math.min(1, share)) * (right - left);
    };
    canvas.addEventListener("pointerdown", (event) => { from = [time(event), event.clientX]; });
    canvas.addEventListener("pointerup", (event) => {
      if (!from) return;
      const to = time(event);
      if (Math.abs(event.clientX - from[1]) > 12) this.window = [Math.min(from[0], to), Math.max(from[0], to)];
      else this.on.seek(to);
      from = null;
      this.draw();
    });
    canvas.addEventListener("dblclick", () => { this.window = null; this.draw(); });
  }

  span() { return this.window ?? [0, Math.max(this.until, 1e-12)]; }
  at() { return this.cursor ?? this.now; }

  draw() {
    for (const plot of this.plots) {
      const wide = plot.box.clientWidth;
      if (!wide || !plot.box.offsetParent) continue;
      const high = plot.spec.kind === "plane" ? this.planeHeight(plot, wide) : 176;
      const ratio = window.devicePixelRatio || 1, {canvas} = plot;
      if (canvas.width !== Math.round(wide * ratio) || canvas.height !== Math.round(high * ratio)) {
        canvas.width = Math.round(wide * ratio);
        canvas.height = Math.round(high * ratio);
        canvas.style.height = `${high}px`;
      }
      const to = canvas.getContext("2d");
      to.setTransform(ratio, 0, 0, ratio, 0, 0);
      to.clearRect(0, 0, wide, high);
      to.font = "11px system-ui, sans-serif";
      if (plot.spec.kind === "time") this.drawTime(to, plot, wide, high);
      else if (plot.spec.kind === "raster") this.drawRaster(to, plot, wide, high, ratio);
      else this.drawPlane(to, plot, wide, high);
    }
  }

  drawTime(to, plot, wide, high) {
    const {curves, unit} = plot.chart, span = this.span();
    const sets = [[this.ghost, true], [this.streams, false]].filter(([set, faint]) => set && (!faint || this.showGhost));
    let low = Infinity, top = -Infinity;
    for (const [set] of sets) for (const curve of curves) {
      const stream = set[curve.probe];
      if (!stream) continue;
      const first = stream.mode === "constant" ? 0 : stream.row(span[0]), last = Math.min(stream.rows, stream.row(span[1]) + 2);
      for (let k = first; k < last; k++) {
        const y = stream.value(k, curve.column);
        if (Number.isFinite(y)) { if (y < low) low = y; if (y > top) top = y; }
      }
    }
    if (low > top) [low, top] = [0, 1];
    const spare = 0.06 * (top - low) || 0.1 * Math.abs(top) || 0.5;
    const frame = axes(to, wide, high, [...span, low - spare, top + spare], `t [${this.unit}]`, unit);
    to.save();
    to.beginPath();
    to.rect(EDGE.left, 0, wide - EDGE.left - EDGE.right, high - EDGE.bottom);
    to.clip();
    for (const [set, faint] of sets) curves.forEach((curve, i) => {
      const stream = set[curve.probe];
      if (!stream || !stream.rows) return;
      to.strokeStyle = colour(i) + (faint ? "66" : "");
      to.lineWidth = faint ? 1 : 1.5;
      to.setLineDash(faint ? [5, 4] : []);
      line(to, stream, curve.column, span, frame);
    });
    to.setLineDash([]);
    this.drawCursor(to, frame, high);
    to.restore();
    const at = this.at();
    plot.values.forEach(({name, text, mark, i}) => {
      const stream = this.streams[curves[i].probe];
      const value = stream && stream.rows ? stream.value(stream.row(at), curves[i].column) : NaN;
      const shown = `${name} ${short(value)}${unit ? ` ${unit}` : ""}`;
      if (text.textContent !== shown) text.textContent = shown;
      mark.style.background = colour(i);
    });
  }

  drawCursor(to, frame, high) {
    const x = frame.x(this.at());
    to.strokeStyle = token("--soft");
    to.lineWidth = 1;
    to.beginPath();
    to.moveTo(x, 0);
    to.lineTo(x, high - EDGE.bottom);
    to.stroke();
  }

  /** Spikes are drawn once each, on a canvas that is kept; another view draws all of them again. */
  drawRaster(to, plot, wide, high, ratio) {
    const stream = this.streams[plot.spec.probe], {neurons} = plot.spec, span = this.span();
    const frame = axes(to, wide, high, [...span, -0.5, neurons - 0.5], `t [${this.unit}]`, "neuron");
    if (!stream) return;
    const view = [wide, high, ratio, ...span, appearance.matches].join();
    plot.raster ??= document.createElement("canvas");
    const kept = plot.raster;
    if (view !== plot.drawnAs || stream !== plot.drawnOf || stream.rows < plot.drawn) {
      [kept.width, kept.height] = [plot.canvas.width, plot.canvas.height];
      Object.assign(plot, {drawnAs: view, drawnOf: stream, drawn: 0});
    }
    const on = kept.getContext("2d");
    on.setTransform(ratio, 0, 0, ratio, 0, 0);
    on.fillStyle = token("--ink");
    const tall = Math.max(1, (high - EDGE.bottom - EDGE.top) / neurons);
    for (let k = plot.drawn; k < stream.rows; k++) {
      const x = frame.x(stream.time(stream.data[2 * k]));
      if (x < EDGE.left || x > wide - EDGE.right) continue;
      on.fillRect(x, frame.y(stream.data[2 * k + 1]) - tall / 2, 1, tall);
    }
    plot.drawn = stream.rows;
    to.drawImage(kept, 0, 0, wide, high);
    this.drawCursor(to, frame, high);
  }

  planeHeight(plot, wide) {
    if (!plot.spec.equal) return 230;
    const [left, right, low, top] = this.limits(plot);
    const share = (top - low) / Math.max(right - left, 1e-9);
    return Math.round(Math.max(176, Math.min(60 + (wide - 62) * share, 270)));
  }

  limits(plot) {
    const {spec} = plot;
    if (spec.view) return spec.view;
    let [left, right, low, top] = [Infinity, -Infinity, Infinity, -Infinity];
    const see = (x, y) => {
      if (!Number.isFinite(x) || !Number.isFinite(y)) return;
      if (x < left) left = x; if (x > right) right = x;
      if (y < low) low = y; if (y > top) top = y;
    };
    for (const set of [this.streams, this.showGhost ? this.ghost : null]) {
      if (!set) continue;
      for (const pair of spec.pairs) {
        const xs = set[pair.x.probe], ys = set[pair.y.probe];
        if (!xs || !ys) continue;
        for (let k = 0; k < xs.rows; k++) see(xs.value(k, pair.x.column), ys.value(ys === xs ? k : ys.row(xs.time(k)), pair.y.column));
      }
    }
    for (const cloud of spec.clouds) {
      const stream = this.streams[cloud.probe];
      if (!stream || cloud.kind === "Scan" || stream.mode !== "constant" || !stream.rows) continue;
      const size = stream.shape[1];
      for (let i = 0; i < stream.shape[0]; i++) see(stream.data[i * size], stream.data[i * size + 1]);
    }
    if (!(left < Infinity)) return [0, 1, 0, 1];
    const spare = 0.06 * Math.max(right - left, top - low) || 0.5;
    return [left - spare, right + spare, low - spare, top + spare];
  }

  drawPlane(to, plot, wide, high) {
    const {spec} = plot, at = this.at();
    let [left, right, low, top] = this.limits(plot);
    if (spec.equal) {
      const scale = Math.min((wide - EDGE.left - EDGE.right) / (right - left), (high - EDGE.bottom - EDGE.top) / (top - low));
      const across = (wide - EDGE.left - EDGE.right) / scale, up = (high - EDGE.bottom - EDGE.top) / scale;
      [left, right] = [(left + right - across) / 2, (left + right + across) / 2];
      [low, top] = [(low + top - up) / 2, (low + top + up) / 2];
    }
    const frame = axes(to, wide, high, [left, right, low, top], spec.across, spec.up);
    to.save();
    to.beginPath();
    to.rect(EDGE.left, 0, wide - EDGE.left - EDGE.right, high - EDGE.bottom);
    to.clip();
    const path = (points, style, width = 1.5, dash = []) => {
      to.beginPath();
      points.forEach(([x, y], i) => (i ? to.lineTo(frame.x(x), frame.y(y)) : to.moveTo(frame.x(x), frame.y(y))));
      Object.assign(to, {strokeStyle: style, lineWidth: width});
      to.setLineDash(dash);
      to.stroke();
      to.setLineDash([]);
    };
    const ink = token("--ink");
    spec.walls.forEach((wall) => path(wall, ink, 2));
    for (const [x, y, r] of spec.circles) {
      to.beginPath();
      to.arc(frame.x(x), frame.y(y), Math.abs(frame.x(x + r) - frame.x(x)), 0, 2 * Math.PI);
      to.strokeStyle = ink;
      to.stroke();
    }
    const pose = this.pose(spec, at);
    spec.clouds.forEach((cloud, i) => this.drawCloud(to, frame, spec, cloud, colour(spec.pairs.length + i), pose, at, path));
    for (const [set, faint] of [[this.showGhost ? this.ghost : null, true], [this.streams, false]]) {
      if (set) spec.pairs.forEach((pair, i) => this.drawPair(to, frame, set, pair, colour(i), faint, at));
    }
    if (pose) robot(to, frame, pose, spec.radius, colour(0));
    to.restore();
  }

  pose(spec, at) {
    const pair = spec.pairs.find((each) => each.theta);
    const stream = pair && this.streams[pair.x.probe];
    if (!stream || !stream.rows) return null;
    const row = stream.row(at);
    return [pair.x, pair.y, pair.theta].map((each) => stream.value(row, each.column));
  }

  drawPair(to, frame, set, pair, style, faint, at) {
    const xs = set[pair.x.probe], ys = set[pair.y.probe];
    if (!xs || !ys || !xs.rows || !ys.rows) return;
    to.strokeStyle = style + (faint ? "55" : "");
    to.lineWidth = faint ? 1.25 : 1.75;
    to.setLineDash(faint ? [5, 4] : []);
    to.beginPath();
    let pen = false;
    const last = faint ? xs.rows - 1 : xs.row(at);
    for (let k = 0; k <= last; k++) {
      const x = xs.value(k, pair.x.column), y = ys.value(ys === xs ? k : ys.row(xs.time(k)), pair.y.column);
      if (!Number.isFinite(x) || !Number.isFinite(y)) { pen = false; continue; }
      if (pen) to.lineTo(frame.x(x), frame.y(y)); else to.moveTo(frame.x(x), frame.y(y));
      pen = true;
    }
    to.stroke();
    to.setLineDash([]);
    if (faint || pair.theta) return;
    const x = xs.value(last, pair.x.column), y = ys.value(ys.row(xs.time(last)), pair.y.column);
    to.fillStyle = style;
    to.beginPath();
    to.arc(frame.x(x), frame.y(y), 4, 0, 2 * Math.PI);
    to.fill();
  }

  drawCloud(to, frame, spec, cloud, style, pose, at, path) {
    const stream = this.streams[cloud.probe];
    if (!stream || !stream.rows) return;
    const row = stream.row(at), points = [];
    if (cloud.kind === "Scan") {
      if (!pose) return;
      const [x, y, theta] = pose, [low, high] = spec.angles, count = stream.width;
      for (let i = 0; i < count; i++) {
        const range = stream.value(row, i), angle = theta + low + (high - low) * i / count;
        if (Number.isFinite(range)) points.push([x + range * Math.cos(angle), y + range * Math.sin(angle)]);
      }
    } else {
      const size = stream.shape[1] ?? 2;
      for (let i = 0; i < stream.shape[0]; i++) {
        const x = stream.value(row, i * size), y = stream.value(row, i * size + 1);
        if (Number.isFinite(x) && Number.isFinite(y)) points.push([x, y]);
      }
    }
    if (cloud.kind === "Path") { path(points, style, 1.5, [6, 4]); return; }
    to.fillStyle = style;
    for (const [x, y] of points) to.fillRect(frame.x(x) - 1, frame.y(y) - 1, 2, 2);
  }
}

function robot(to, frame, [x, y, theta], radius, style) {
  if (!Number.isFinite(x) || !Number.isFinite(y)) return;
  const [a, b] = [frame.x(x), frame.y(y)], [c, s] = [Math.cos(theta), -Math.sin(theta)];
  if (radius) {
    to.strokeStyle = style;
    to.beginPath();
    to.arc(a, b, Math.abs(frame.x(x + radius) - a), 0, 2 * Math.PI);
    to.stroke();
  }
  to.fillStyle = style;
  to.beginPath();
  for (const [u, v] of [[9, 0], [-5, 5], [-5, -5]]) to.lineTo(a + u * c - v * s, b + u * s + v * c);
  to.fill();
}

/** A curve over time; where many rows share a pixel, their least and largest value. */
function line(to, stream, column, span, frame) {
  to.beginPath();
  if (stream.mode === "constant") {
    const y = frame.y(stream.value(0, column));
    to.moveTo(frame.x(span[0]), y);
    to.lineTo(frame.x(span[1]), y);
    to.stroke();
    return;
  }
  const first = Math.max(0, stream.row(span[0]) - 1), last = Math.min(stream.rows - 1, stream.row(span[1]) + 1);
  const pixels = Math.max(1, frame.x(span[1]) - frame.x(span[0])), per = Math.floor((last - first) / pixels / 2);
  let pen = false;
  const point = (row, y) => {
    if (!Number.isFinite(y)) { pen = false; return; }
    const x = frame.x(stream.time(row));
    if (pen) to.lineTo(x, frame.y(y)); else to.moveTo(x, frame.y(y));
    pen = true;
  };
  if (per < 2) {
    for (let k = first; k <= last; k++) point(k, stream.value(k, column));
  } else {
    for (let k = first - (first % per); k <= last; k += per) {
      let low = Infinity, top = -Infinity;
      for (let i = Math.max(first, k); i < k + per && i <= last; i++) {
        const y = stream.value(i, column);
        if (y < low) low = y;
        if (y > top) top = y;
      }
      if (low <= top) { point(k, low); point(k, top); }
    }
  }
  to.stroke();
}

/** Grid, numbers and labels; returns the places of numbers. */
function axes(to, wide, high, [left, right, low, top], across, up) {
  const w = wide - EDGE.left - EDGE.right, h = high - EDGE.top - EDGE.bottom;
  const frame = {
    x: (value) => EDGE.left + (value - left) / (right - left) * w,
    y: (value) => EDGE.top + (top - value) / (top - low) * h,
  };
  to.strokeStyle = token("--line");
  to.fillStyle = token("--soft");
  to.lineWidth = 1;
  for (const x of steps(left, right, w / 80)) {
    const a = Math.round(frame.x(x)) + 0.5;
    to.beginPath(); to.moveTo(a, EDGE.top); to.lineTo(a, high - EDGE.bottom); to.stroke();
    to.textAlign = "center";
    to.fillText(short(x), a, high - EDGE.bottom + 12);
  }
  for (const y of steps(low, top, h / 36)) {
    const b = Math.round(frame.y(y)) + 0.5;
    to.beginPath(); to.moveTo(EDGE.left, b); to.lineTo(wide - EDGE.right, b); to.stroke();
    to.textAlign = "right";
    to.fillText(short(y), EDGE.left - 4, b + 4);
  }
  to.textAlign = "center";
  to.fillText(across, EDGE.left + w / 2, high - 5);
  if (up) {
    to.save(); to.translate(10, EDGE.top + h / 2); to.rotate(-Math.PI / 2);
    to.fillText(up, 0, 0);
    to.restore();
  }
  return frame;
}

function steps(low, high, count) {
  const raw = Math.max(high - low, 1e-12) / Math.max(2, Math.min(8, count)), power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw), found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) found.push(i * step);
  return found;
}
