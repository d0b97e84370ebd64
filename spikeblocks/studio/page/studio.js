// The page of the studio: the text is the authority, the session runs in a process of the server.
import {makeEditor, toPoints} from "./editor.js";
import {Plots, short} from "./plots.js";

const byId = (id) => document.getElementById(id);
const make = (tag, text = "", more = {}) => Object.assign(document.createElement(tag), {textContent: text}, more);
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 0];
const KEY_PAUSE = 150;  // ms after a key until the text is sent

const address = new URL(location.href);
const token = address.searchParams.get("token") ?? sessionStorage.getItem("token") ?? "";
sessionStorage.setItem("token", token);
history.replaceState(null, "", address.pathname);

const state = {
  views: null, playing: false, tick: 0, t: 0, cursor: null, writes: true, selected: "", block: null,
  values: {}, base: 1, asked: 0, waiting: new Map(), timer: 0, numbers: [], dragging: false, ends: new Map(),
  dirty: true, frames: 0, valid: true, trust: "",
};
window.studio = state;  // for tests and the curious

let socket;
const send = (what, values = {}) => {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({do: what, ...values}));
};
const ask = (what, values) => new Promise((resolve) => {
  const number = ++state.asked;
  state.waiting.set(number, resolve);
  send(what, {...values, ask: number});
});

function connect() {
  socket = new WebSocket(`ws://${location.host}/socket`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { socket.send(JSON.stringify({token})); send("hello"); };
  socket.onmessage = ({data}) => (typeof data === "string" ? receive(JSON.parse(data)) : frame(data));
  socket.onclose = ({code}) => {
    if (code === 4401 || code === 4403) say("The address needs the token that runtime studio printed.", true);
    else { say("The studio has ended, or cannot be reached; trying again.", true); setTimeout(connect, 1500); }
  };
}

const plots = new Plots(byId("plots"), {seek: (time) => seek(time)});
const editor = makeEditor(byId("editor"), document.body.dataset.nonce, {
  changed: () => { clearTimeout(state.timer); state.timer = setTimeout(sendText, KEY_PAUSE); },
  moved: async (offset) => {
    const name = await ask("block_at", {offset});
    if (name && name !== state.selected.split(".")[0]) select(name, false);
  },
  ask: async (what, offset) => { sendText(); return ask(what, {offset}); },
});

function sendText() {
  clearTimeout(state.timer);
  const text = editor.text();
  // Nothing is sent before the text has come.
  if (text === state.sent || state.sent === undefined || !state.writes) return;
  state.sent = text;
  send("text", {text});
}

function say(text, bad = false, button = null) {
  const place = byId("status");
  place.replaceChildren(text);
  place.classList.toggle("bad", bad);
  if (button) place.append(" ", button);
}

// ---- what comes from the server

function frame(data) {
  const size = new DataView(data).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, size)));
  const numbers = new Float32Array(data, 4 + size);
  for (const [name, first, offset, count] of head.parts) {
    plots.streams[name]?.take(first, numbers.subarray(offset, offset + count));
  }
  Object.assign(state, {tick: head.tick, t: head.t, values: head.values, dirty: true, cameAt: performance.now()});
  state.frames++;
}

const handlers = {
  role({writes}) {
    state.writes = writes;
    byId("take").hidden = writes;
    for (const id of ["save", "keep", "play", "step", "reset"]) byId(id).disabled = !writes;
    if (!writes) say("Another page of this studio writes; this one looks.");
  },
  gallery({graphs}) { showGallery(graphs); },
  picture({name, svg}) {
    const image = document.querySelector(`.card[data-name="${CSS.escape(name)}"] img`);
    if (image && svg) image.src = `data:image/svg+xml;base64,${btoa(String.fromCharCode(...new TextEncoder().encode(svg)))}`;
  },
  text(message) { takeText(message); },
  views(views) {
    const isOther = !state.views || state.views.title !== views.title;
    plots.begin(views, views.cause === "back" || (views.cause === "began" && !isOther));
    state.views = views;
    const length = views.ticks * views.dt;
    // A whole run in about 20 s where seconds are not what it is about.
    state.base = length >= 2 && length <= 300 ? 1 : 10 ** Math.round(Math.log10(length / 20));
    speeds();
    Object.assign(byId("scrub"), {max: views.ticks, step: 1});
    byId("seed").value = views.seed;
    document.title = `${views.title} – studio`;
    if (views.cause !== "edited") state.cursor = null;
    state.dirty = true;
  },
  state({playing, failed, stopped}) {
    state.playing = playing;
    byId("play").textContent = playing ? "Pause" : "Play";
    if (stopped) say("The run has come to its own end, run.stop.");
    if (!failed && !stopped && !playing && byId("status").classList.contains("bad") && state.failed) say("");
    state.failed = failed;
    state.dirty = true;
  },
  failed({text, what}) { say(what === "run" ? `The run failed: ${text}` : text, true); },
  refused({text}) {
    const button = make("button", "Begin anew", {type: "button"});
    button.onclick = () => send("begin", {seed: Number(byId("seed").value)});
    say(`The text is right, but the running session cannot become it: ${text}.`, true, button);
  },
  became({anew, numbers, begun, gone}) {
    if (anew) return;
    const said = [];
    if (numbers.length) said.push(`changed while it runs: ${numbers.join(", ")}`);
    if (begun.length) said.push(`began anew: ${begun.join(", ")}`);
    if (gone.length) said.push(`gone: ${gone.join(", ")}`);
    if (said.length) say(`${said.join("; ")}.`);
  },
  slow() { say("This computer is slower than the chosen speed."); },
  silent({silent}) {
    if (!silent) { say(""); return; }
    const button = make("button", "End it and compute its state again", {type: "button"});
    button.onclick = () => send("revive");
    say("The session has not answered for two seconds.", true, button);
  },
  ended() { say("The session's process has ended; its state is computed again.", true); send("revive"); },
  saved({folder}) { say(`Saved in ${folder}; runtime replay ${folder} computes it again.`); },
  stored({name, folder}) { byId("name").textContent = name; byId("saved").textContent = "saved"; say(`Written to ${name} in ${folder}.`); },
  outside({text}) {
    const button = make("button", "Take the file", {type: "button"});
    button.onclick = () => { editor.set(text); sendText(); say(""); };
    say("The file was changed outside, and the text here has edits that are not saved.", true, button);
  },
  wrong({text}) { say(text, true); },
  block({block}) { state.block = block; showBlock(); },
  replacements({name, types}) { showReplacements(name, types); },
  answer({ask: number, found}) { state.waiting.get(number)?.(found); state.waiting.delete(number); },
};
const receive = (message) => handlers[message.kind]?.(message);

function takeText(message) {
  chooses(false);
  if (message.cause !== "typed" || !state.writes) {
    editor.set(message.text);
    state.sent = message.text;
  } else if (message.text !== editor.text()) return;  // a later one is on its way
  if (byId("name").textContent !== message.name) state.ends.clear();
  byId("name").textContent = message.name;
  byId("saved").textContent = message.shipped ? "shipped" : message.saved ? "saved" : "not saved";
  state.valid = message.valid;
  showProblems(message.problems);
  showPicture(message.picture);
  if (message.valid) { state.numbers = message.numbers; showNumbers(); }
  if (state.selected) send("block", {name: state.selected});
  const files = message.trust.join(", ");
  if (files && files !== state.trust) {
    byId("question").textContent = `This graph names Python files, and running it runs them: ${files}. Run them only if you know where they come from.`;
    byId("ask").returnValue = "no";
    byId("ask").showModal();
  }
  state.trust = files;
}
byId("ask").addEventListener("close", () => {
  if (byId("ask").returnValue === "yes") send("trust");
  else say("The Python files of this graph are not run, so it is only shown.");
});

function showProblems(problems) {
  const list = byId("problems");
  editor.mark(problems);
  list.replaceChildren(...problems.map((each) => {
    const item = make("li", "", {className: each.severity});
    const line = make("button", `${each.line}:${each.column} ${each.text}`, {type: "button", className: "plain"});
    line.onclick = () => editor.select(each.from, each.to, true);
    item.append(line);
    for (const fix of each.fixes) {
      const button = make("button", fix.title, {type: "button"});
      button.onclick = () => { editor.edit(fix.edits); sendText(); };
      item.append(button);
    }
    return item;
  }));
  const wrong = problems.filter((each) => each.severity === "error").length;
  byId("count").textContent = wrong ? `${wrong} problem${wrong > 1 ? "s" : ""}` : "no problems";
  byId("count").classList.toggle("bad", wrong > 0);
}
byId("count").onclick = () => { tab("text"); byId("problems").querySelector("button")?.click(); };

// ---- the diagram

function showPicture(svg) {
  const place = byId("picture");
  place.classList.toggle("stale", !svg);
  if (!svg || svg === state.svg) return;
  state.svg = svg;
  const root = new DOMParser().parseFromString(svg, "image/svg+xml").documentElement;
  root.setAttribute("role", "group");
  root.setAttribute("aria-label", "Block diagram");
  for (const block of root.querySelectorAll('[data-kind="block"]')) {
    block.setAttribute("tabindex", "0");
    block.setAttribute("role", "button");
    block.setAttribute("aria-label", block.querySelector("title")?.textContent ?? block.dataset.name);
  }
  const focused = document.activeElement?.closest?.('[data-kind="block"]')?.dataset.name;
  place.replaceChildren(document.importNode(root, true));
  fit();
  ring();
  if (focused) place.querySelector(`[data-kind="block"][data-name="${CSS.escape(focused)}"]`)?.focus();
}
/** A diagram that would become too small to be read is scrolled instead. */
function fit() {
  const place = byId("picture"), shown = place.querySelector("svg");
  if (!shown || !place.clientWidth) return;
  const share = Math.min(place.clientWidth / shown.width.baseVal.value, place.clientHeight / shown.height.baseVal.value);
  place.classList.toggle("wide", share < 0.6);
}
new ResizeObserver(() => { fit(); ring(); }).observe(byId("picture"));
function ring() {
  for (const block of byId("picture").querySelectorAll('[data-kind="block"]')) {
    const isOne = block.dataset.name === state.selected;
    block.classList.toggle("selected", isOne);
    block.setAttribute("aria-pressed", isOne);
    if (isOne) block.scrollIntoView({block: "nearest", inline: "nearest"});
  }
}
const blockOf = (event) => event.target.closest?.('[data-kind="block"]')?.dataset.name;
byId("picture").addEventListener("click", (event) => { const name = blockOf(event); if (name) select(name, true); });
byId("picture").addEventListener("keydown", (event) => {
  const name = blockOf(event);
  if (name && (event.key === "Enter" || event.key === " ")) { event.preventDefault(); event.stopPropagation(); select(name, true); }
});

function select(name, isClick) {
  state.selected = name;
  state.select = isClick;
  ring();
  send("block", {name});
  showNumbers();
}

const ACTIONS = {
  bypass: ["Bypass", "What it takes in passes straight through"],
  without: ["Leave out", "Remove it with its wires; the entry stays in the text"],
  restore: ["Put back", "Neither left out nor bypassed any more"],
  delete: ["Delete", "Delete its entry and all that mentions it"],
};

function showBlock() {
  const place = byId("block"), {block} = state;
  place.hidden = !block;
  if (!block) return;
  const head = make("div"), close = make("button", "×", {type: "button", className: "plain", title: "Close"});
  close.onclick = () => { state.block = null; state.selected = ""; ring(); showBlock(); send("watch", {addresses: []}); };
  head.append(close, make("h2", block.name));
  close.style.float = "right";
  const acts = make("div", "", {className: "acts"});
  const why = make("p", "", {className: "why"});
  for (const [action, [label, doc]] of Object.entries(ACTIONS)) {
    const isBack = action === "restore";
    if (isBack !== (block.removed || block.bypassed) && (isBack || action !== "delete")) continue;
    const reason = block.actions[action], button = make("button", label, {type: "button", title: reason || doc});
    button.disabled = !!reason || !state.writes;
    if (reason) why.append(make("span", `${label}: ${reason}`), document.createElement("br"));
    button.onclick = () => act(action);
    acts.append(button);
  }
  const replace = make("button", "Replace …", {type: "button", title: "Another type in its place"});
  replace.disabled = !state.writes || block.name.includes(".");
  replace.onclick = () => { replace.disabled = true; send("replacements", {name: block.name}); };
  acts.append(replace, make("span", "", {id: "others"}));
  const values = make("table"), form = make("table");
  for (const {address, type} of block.outputs) {
    const row = values.insertRow();
    row.append(make("th", address.slice(block.name.length + 1), {title: type}));
    row.insertCell().dataset.address = address;
  }
  for (const each of block.parameters) {
    const row = form.insertRow();
    row.append(make("th", each.key, {title: `${each.doc}\n${each.expected}`}));
    const cell = row.insertCell();
    if (!each.number) { cell.textContent = each.value; continue; }
    const input = make("input", "", {type: "text", value: each.value, inputMode: "decimal", title: each.doc});
    input.setAttribute("aria-label", `${each.key}${each.unit ? `, ${each.unit}` : ""}`);
    input.disabled = !state.writes;
    input.onchange = () => { if (input.value.trim() && Number.isFinite(Number(input.value))) send("number", {path: each.path, value: Number(input.value)}); else { input.value = each.value; say("Expected a number.", true); } };
    cell.append(input);
  }
  place.replaceChildren(head, make("p", `${block.type}${block.removed ? ", left out" : block.bypassed ? ", bypassed" : ""}`, {className: "soft"}),
    make("p", block.doc), acts, why, values, form);
  send("watch", {addresses: block.outputs.map((each) => each.address)});
  if (state.select && block.span) editor.select(...block.span);
  state.select = false;
}
function act(action, value = "") { send("act", {action, block: state.block.name, value}); }
function showReplacements(name, types) {
  const place = byId("others");
  if (!place || state.block?.name !== name) return;
  if (!types.length) { place.textContent = "no type with its wired ports"; return; }
  const list = make("select");
  list.setAttribute("aria-label", "Type in its place");
  list.append(make("option", "by …", {value: ""}), ...types.map((type) => make("option", type, {value: type})));
  list.onchange = () => { if (list.value) act("replace", list.value); };
  place.replaceChildren(list);
  list.focus();
}
function showValues() {
  for (const cell of byId("block").querySelectorAll("[data-address]")) {
    const numbers = state.values[cell.dataset.address];
    const text = numbers ? numbers.map((x) => (typeof x === "number" ? short(x) : x)).join(", ") : "";
    if (cell.textContent !== text) cell.textContent = text;
  }
}

// ---- numbers

function showNumbers() {
  if (state.dragging) return;
  const place = byId("sliders"), wanted = byId("find").value.trim().toLowerCase();
  const open = new Set([...place.querySelectorAll("details[open]")].map((each) => each.dataset.group));
  const focused = document.activeElement?.dataset?.key;
  const groups = new Map();
  for (const number of state.numbers) {
    if (wanted && !`${number.group}.${number.label}`.toLowerCase().includes(wanted)) continue;
    if (!groups.has(number.group)) groups.set(number.group, []);
    groups.get(number.group).push(number);
  }
  const own = state.selected;
  const order = [...groups.keys()].sort((a, b) => (b === own) - (a === own));
  place.replaceChildren(...order.map((group) => {
    const box = make("details");
    box.dataset.group = group;
    box.open = open.has(group) || group === own || group === "inputs" || group === "params" || !!wanted || groups.size < 4;
    box.append(make("summary", group), ...groups.get(group).map(slider));
    return box;
  }));
  if (!order.length) place.append(make("p", wanted ? "No number of that name." : "This graph has no numbers that can change while it runs.", {className: "soft"}));
  if (focused) place.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
}
byId("find").oninput = showNumbers;

function slider(number) {
  const box = make("div", "", {className: "slider"}), key = `${number.path}[${number.index}]`;
  const label = make("label", number.label, {htmlFor: key, title: number.doc}), output = make("output");
  // The ends stay while the value is between them, so that a slider is found where it was left.
  const ends = state.ends.get(key);
  const [low, high] = ends && ends[0] <= number.value && number.value < ends[1] ? ends : [number.low, number.high];
  state.ends.set(key, [low, high]);
  const step = 10 ** Math.floor(Math.log10((high - low) / 100 || 1));
  const input = make("input", "", {id: key, type: "range", min: low, max: high, step});
  input.dataset.key = key;
  input.value = number.value;
  input.disabled = !state.writes;
  const show = (value) => {
    const text = `${short(value)}${number.unit ? ` ${number.unit}` : ""}`;
    output.textContent = text;
    input.setAttribute("aria-valuetext", text);
  };
  show(number.value);
  const whole = (value) => {
    number.all[number.index] = value;
    for (const other of state.numbers) if (other.path === number.path) other.all[number.index] = value;
    return number.list || number.all.length > 1 ? number.all : value;
  };
  let waits = false;
  input.addEventListener("input", () => {
    state.dragging = true;
    show(Number(input.value));
    if (waits) return;
    waits = true;
    requestAnimationFrame(() => {
      waits = false;
      const value = whole(Number(Number(input.value).toPrecision(6)));
      state.slidAt = performance.now();
      if (number.port) send("write", {port: number.port, value});
      else send("set", {path: number.path, value});
    });
  });
  input.addEventListener("change", () => {
    state.dragging = false;
    number.value = Number(Number(input.value).toPrecision(6));
    const value = whole(number.value);
    if (!number.port) send("number", {path: number.path, value});
    else send("write", {port: number.port, value});
  });
  box.append(label, output, input);
  return box;
}

// ---- time

function speeds() {
  const list = byId("speed"), chosen = list.value, unit = state.views?.unit ?? "s";
  list.replaceChildren(...SPEEDS.map((speed) => make("option",
    speed ? (state.base === 1 && unit === "s" ? `${speed}x` : `${short(speed * state.base)} ${unit}/s`) : "as fast as it goes", {value: speed})));
  list.value = chosen || 1;
}
const speed = () => Number(byId("speed").value) * state.base;
const dt = () => state.views?.dt ?? 1;

/** Come to where the scrubber is, if it was moved back: what follows is another branch. */
function land() {
  if (state.cursor === null) return;
  send("goto", {tick: Math.round(state.cursor / dt())});
  state.cursor = null;
}
function play() {
  if (!state.writes) return;
  if (state.playing) { send("pause"); return; }
  sendText();
  if (state.cursor === null && state.views && state.tick >= state.views.ticks) send("begin", {seed: Number(byId("seed").value)});
  land();
  send("play", {speed: speed()});
}
byId("play").onclick = play;
byId("step").onclick = () => { land(); send("step", {ticks: Math.max(1, Math.round((state.views?.ticks ?? 1) / 1000))}); };
byId("reset").onclick = () => { state.cursor = null; send("begin", {seed: Number(byId("seed").value)}); };
byId("speed").onchange = () => { if (state.playing) send("play", {speed: speed()}); };
byId("ghost").onchange = () => { plots.showGhost = byId("ghost").checked; state.dirty = true; };
byId("take").onclick = () => send("take_over");
byId("save").onclick = save;
byId("keep").onclick = () => send("save_session");
function save() { sendText(); send("save"); }

function seek(time) {
  if (!state.views) return;
  if (state.playing) send("pause");
  const tick = Math.max(0, Math.min(state.tick, Math.round(time / dt())));
  state.cursor = tick >= state.tick ? null : tick * dt();
  state.dirty = true;
}
byId("scrub").addEventListener("input", () => seek(Number(byId("scrub").value) * dt()));

document.addEventListener("keydown", (event) => {
  if ((event.ctrlKey || event.metaKey) && event.key === "s") { event.preventDefault(); save(); return; }
  if (event.ctrlKey || event.metaKey || event.altKey || !state.views) return;
  if (event.target.closest?.(".cm-editor, input:not(#scrub), select, button, dialog, summary, #gallery")) return;
  const reach = state.tick * dt(), jump = (event.shiftKey ? 0.1 : 0.01) * state.views.ticks * dt();
  const at = state.cursor ?? reach;
  const steps = {ArrowLeft: at - jump, ArrowRight: at + jump, Home: 0, End: reach};
  if (event.key === " ") { event.preventDefault(); play(); }
  else if (event.key === ".") byId("step").click();
  else if (event.key in steps) { event.preventDefault(); seek(steps[event.key]); }
  else if (event.key === "[" || event.key === "]") {
    const list = byId("speed");
    list.selectedIndex = Math.max(0, Math.min(list.options.length - 1, list.selectedIndex + (event.key === "]" ? 1 : -1)));
    list.onchange();
  }
});

function showClock() {
  const {views} = state;
  if (!views) return;
  const at = state.cursor ?? state.t, end = views.ticks * views.dt;
  const text = `${at.toFixed(end < 1 ? 4 : 2)} of ${short(end)} ${views.unit}${state.cursor === null ? "" : ", back"}`;
  if (byId("clock").textContent !== text) byId("clock").textContent = text;
  const scrub = byId("scrub");
  scrub.value = Math.round(at / views.dt);
  scrub.setAttribute("aria-valuetext", text);
}

function paint() {
  if (state.dirty) {
    state.dirty = false;
    plots.now = state.t;
    plots.cursor = state.cursor;
    plots.draw();
    showClock();
    showValues();
    state.painted = (state.painted ?? 0) + 1;
    if (state.slidAt && state.cameAt > state.slidAt) { (state.latencies ??= []).push(performance.now() - state.slidAt); state.slidAt = 0; }
  }
  requestAnimationFrame(paint);
}

// ---- tabs of a narrow page, and the choice of a graph

function tab(name) {
  byId("main").dataset.tab = name;
  for (const each of document.querySelectorAll(".tabs button")) each.setAttribute("aria-selected", each.dataset.tab === name);
  state.dirty = true;
}
for (const each of document.querySelectorAll(".tabs button")) each.onclick = () => tab(each.dataset.tab);

function chooses(yes) {
  byId("gallery").hidden = !yes;
  for (const id of ["main", "foot", "tabs", "save", "keep"]) byId(id).hidden = yes;
}
function showGallery(graphs) {
  chooses(true);
  const seen = new IntersectionObserver((entries) => {
    for (const {isIntersecting, target} of entries) {
      if (isIntersecting) { seen.unobserve(target); send("picture", {name: target.dataset.name}); }
    }
  });
  const cards = graphs.map(({name, about}) => {
    const card = make("button", "", {type: "button", className: "card"});
    card.dataset.name = name;
    card.append(make("img", "", {alt: ""}), make("b", name), make("span", about, {className: "soft"}));
    card.onclick = () => send("open", {name});
    seen.observe(card);
    return card;
  });
  byId("cards").replaceChildren(...cards);
  byId("search").oninput = () => {
    const wanted = byId("search").value.toLowerCase();
    for (const card of cards) card.hidden = !card.textContent.toLowerCase().includes(wanted);
  };
}

speeds();
connect();
paint();
