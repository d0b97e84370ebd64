"use strict";
// Charts of a run's time series: drag to zoom, double-click to go back, point to read values.
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#56b4e9", "#e69f00"];
const DASHES = [[], [6, 3], [2, 3]];
const token = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const read = (_, x) => (x === null || x === undefined ? "–" : String(Number(x.toPrecision(5))));

function chart(box, spec) {
  const axis = {stroke: token("--ink"), grid: {stroke: token("--line"), width: 1},
    ticks: {stroke: token("--line"), width: 1}, font: "12px " + token("--text"),
    labelFont: "12px " + token("--text"), labelSize: 20};
  const series = spec.names.map((label, i) => ({label, value: read, width: 1.5,
    points: {show: false}, stroke: COLOURS[i % COLOURS.length],
    dash: DASHES[Math.floor(i / COLOURS.length) % DASHES.length]}));
  const made = new uPlot({
    width: box.clientWidth, height: 240, scales: {x: {time: false}},
    series: [{label: spec.time, value: read}, ...series],
    axes: [{...axis, label: spec.time}, {...axis, size: 64, label: spec.unit}],
    cursor: {sync: {key: "time"}},
  }, spec.data, box);
  addEventListener("resize", () => made.setSize({width: box.clientWidth, height: 240}));
}

function show(box) {
  for (const spec of JSON.parse(box.dataset.charts)) chart(box, spec);
}

for (const box of document.querySelectorAll("details.zoom")) {
  if (box.open) show(box);
  else box.addEventListener("toggle", () => show(box), {once: true});
}
