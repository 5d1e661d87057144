"use strict";
const WIDTH = 470, HEIGHT = 390, LEFT = 62, RIGHT = 14, TOP = 12, BOTTOM = 46;
const { margin: MARGIN, leastMargin: LEAST_MARGIN, mantissas: MANTISSAS, mostTicks: MOST_TICKS } = DATA.axis;
const LEAST_MARGIN_DB = 0.5; // of the PSNR axis, which is linear
const percent = v => `${+(100 * v).toPrecision(3)} %`, plain = v => `${+v.toPrecision(4)}`;
// `of` returns null if a run has no such figure, or one that the axis cannot show. `up`: more is better.
// `why` returns the reason why the figure is missing.
const METRICS = {
  rel_rmse: { name: DATA.names.error, of: e => e.rel_rmse > 0 ? e.rel_rmse : null, log: true, form: percent },
  flip: {
    name: "FLIP of the picture", of: e => e.flip > 0 ? e.flip : null, log: true, form: plain, why: e => e.flip_reason,
  },
  bias: {
    name: "bias of M, deviation from 1", of: e => e.bias === null ? null : Math.abs(e.bias - 1) || null, log: true,
    form: percent,
  },
  psnr: { name: "PSNR, dB", of: e => e.psnr, log: false, up: true, form: plain },
};
const hidden = new Set();
let metric = METRICS.rel_rmse;
const get = id => document.getElementById(id);

function svg(parent, tag, attributes, text) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  return parent.appendChild(element);
}

function html(parent, tag, text, attributes = {}) {
  const element = Object.assign(document.createElement(tag), attributes);
  if (text !== undefined) element.textContent = text;
  return parent.appendChild(element);
}

const colour = method => DATA.methods[method].colour === "#000000" ? "var(--ink)" : DATA.methods[method].colour;

// The corners of a method's mark of radius `r`.
function shape(method, x, y, r) {
  const [corners, star, turn] = DATA.methods[method].shape;
  const points = [], steps = star ? 2 * corners : corners;
  for (let i = 0; i < steps; i++) {
    const angle = 2 * Math.PI * i / steps - Math.PI / 2 - turn * Math.PI / 180, reach = star && i % 2 ? 0.5 * r : r;
    points.push(`${(x + reach * Math.cos(angle)).toFixed(2)},${(y + reach * Math.sin(angle)).toFixed(2)}`);
  }
  return points.join(" ");
}

// As `ticks` of scatter.py; for a linear axis, multiples of a round step.
function ticks(low, high, log) {
  let values = [];
  if (!log) {
    const step = [1, 2, 5, 10, 20, 50].find(s => (high - low) / s <= MOST_TICKS) ?? 100;
    for (let v = Math.ceil(low / step) * step; v <= high; v += step) values.push(v);
    return values;
  }
  for (const mantissas of MANTISSAS) {
    values = [];
    for (let d = Math.floor(Math.log10(low)); d <= Math.ceil(Math.log10(high)); d++)
      for (const m of mantissas) if (m * 10 ** d >= low && m * 10 ** d <= high) values.push(m * 10 ** d);
    if (values.length <= MOST_TICKS) break;
  }
  return values;
}

// The map from values to pixels `from` to `to`, with the ends of the axis as `axis_limits` of scatter.py.
function scale(values, from, to, log) {
  const f = log ? Math.log10 : v => v, back = log ? v => 10 ** v : v => v;
  const a = f(Math.min(...values)), b = f(Math.max(...values));
  const margin = Math.max(MARGIN * (b - a), log ? LEAST_MARGIN : LEAST_MARGIN_DB);
  const at = v => from + (f(v) - a + margin) / (b - a + 2 * margin) * (to - from);
  const low = back(a - margin), high = back(b + margin);
  return Object.assign(at, { low, high, ticks: ticks(low, high, log) });
}

// As `pareto_front` of scatter.py: the points {x, y} that no other point beats, by x.
function paretoFront(points) {
  const front = [], order = [...points].sort((p, q) => p.x - q.x || p.y - q.y);
  for (const p of order) {
    const last = front.at(-1);
    if (!last || p.y < last.y || (p.x === last.x && p.y === last.y)) front.push(p);
  }
  return front;
}

function draw() {
  get("tip").hidden = true;
  get("panels").replaceChildren();
  for (const panel of DATA.panels) drawPanel(panel);
}

function drawPanel(panel) {
  const section = html(get("panels"), "section");
  html(section, "h2", panel.title);
  const picture = svg(section, "svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "group", "aria-label": panel.title });
  const shown = panel.runs.filter(run => metric.of(run.error) !== null);
  const runs = shown.filter(run => !hidden.has(run.method));
  const middle = { "text-anchor": "middle" };
  const why = panel.runs.map(run => metric.why?.(run.error)).find(Boolean) ?? "nothing to show";
  if (!runs.length) return void svg(picture, "text", { x: WIDTH / 2, y: HEIGHT / 2, ...middle }, why);
  const floor = metric === METRICS.rel_rmse ? panel.floor : 0;
  const x = scale(shown.flatMap(run => [run.frame_ms, ...run.frame_ms_quartiles]), LEFT, WIDTH - RIGHT, true);
  const errors = shown.map(run => metric.of(run.error)).concat(floor > 0 ? [floor] : []);
  const y = scale(errors, HEIGHT - BOTTOM, TOP, metric.log);
  const bottom = HEIGHT - BOTTOM;
  const band = { class: "floor", x: LEFT, y: y(floor), width: WIDTH - RIGHT - LEFT, height: bottom - y(floor) };
  if (floor > 0) svg(picture, "rect", band);
  for (const v of x.ticks) {
    svg(picture, "line", { class: "grid", x1: x(v), x2: x(v), y1: TOP, y2: bottom });
    svg(picture, "text", { x: x(v), y: bottom + 17, "text-anchor": "middle" }, plain(v));
  }
  for (const v of y.ticks) {
    svg(picture, "line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: y(v), y2: y(v) });
    svg(picture, "text", { x: LEFT - 7, y: y(v) + 4, "text-anchor": "end" }, metric.form(v));
  }
  if (floor > 0) svg(picture, "text", { x: LEFT + 6, y: bottom - 6 }, DATA.names.floor);
  svg(picture, "text", { x: (LEFT + WIDTH - RIGHT) / 2, y: HEIGHT - 8, "text-anchor": "middle" }, DATA.names.time);
  svg(picture, "text", { transform: `translate(13 ${(TOP + bottom) / 2}) rotate(-90)`, ...middle }, metric.name);

  const points = runs.map(run => ({ run, x: run.frame_ms, y: (metric.up ? -1 : 1) * metric.of(run.error) }));
  const best = paretoFront(points), at = point => [x(point.x), y(Math.abs(point.y))];
  const steps = best.map(p => `H${x(p.x)}V${y(metric.of(p.run.error))}`);
  const start = `M${x(best[0].x)} ${metric.up ? bottom : TOP}`;
  svg(picture, "path", { class: "front", d: `${start}${steps.join("")}H${WIDTH - RIGHT}` });
  for (const curve of new Set(runs.map(run => run.curve))) {
    const own = runs.filter(run => run.curve === curve);
    const places = own.map(run => [x(run.frame_ms), y(metric.of(run.error))]);
    svg(picture, "polyline", { class: "sweep", points: places.join(" "), stroke: colour(own[0].method) });
  }
  const taken = points.map(point => around(...at(point)));
  for (const point of points) {
    const [cx, cy] = at(point), isBest = best.includes(point), { run } = point, paint = colour(run.method);
    const [low, high] = run.frame_ms_quartiles;
    svg(picture, "line", { class: "spread", x1: x(low), x2: x(high), y1: cy, y2: cy, stroke: paint });
    const look = isBest ? { fill: paint, stroke: "var(--card)" } : { fill: "var(--card)", stroke: paint };
    const error = `${metric.name} ${metric.form(metric.of(run.error))}`;
    const text = `${run.setting}: ${plain(run.frame_ms)} ms, ${error}`;
    const mark = svg(picture, "polygon", {
      class: isBest ? "run best" : "run", points: shape(run.method, cx, cy, isBest ? 7.5 : 5.5), tabindex: 0,
      role: "img", "aria-label": text, "data-method": run.method, ...look,
    });
    for (const event of ["pointerenter", "focus"]) mark.addEventListener(event, () => showFigures(run, mark));
    for (const event of ["pointerleave", "blur"]) mark.addEventListener(event, () => { get("tip").hidden = true; });
  }
  for (const point of points) label(picture, point.run.label, ...at(point), taken);
}

const around = (cx, cy) => ({ left: cx - 6, right: cx + 6, top: cy - 6, bottom: cy + 6 });

// Write a label beside its mark where it covers no other label and no mark. Leave it out if there is no room.
function label(picture, text, cx, cy, taken) {
  if (!text) return;
  const element = svg(picture, "text", { class: "label" }, text);
  const places = [
    [9, -7, "start"], [9, 16, "start"], [-9, -7, "end"], [-9, 16, "end"], [0, -13, "middle"], [0, 22, "middle"],
    [14, 4, "start"], [-14, 4, "end"], [18, -20, "start"], [-18, 28, "end"], [-18, -20, "end"], [18, 28, "start"],
  ];
  for (const [dx, dy, anchor] of places) {
    for (const [name, value] of [["x", cx + dx], ["y", cy + dy], ["text-anchor", anchor]]) element.setAttribute(name, value);
    const { x, y, width, height } = element.getBBox(), box = { left: x, right: x + width, top: y, bottom: y + height };
    const inside = x >= LEFT && box.right <= WIDTH - RIGHT && y >= TOP && box.bottom <= HEIGHT - BOTTOM;
    const free = !taken.some(t => box.left < t.right && t.left < box.right && box.top < t.bottom && t.top < box.bottom);
    if (inside && free) return void taken.push(box);
  }
  element.remove();
}

// Show all figures of a run beside its mark.
function showFigures(run, mark) {
  const tip = get("tip"), table = document.createElement("table");
  const row = (name, value, kind = "") => {
    const line = html(table, "tr", undefined, { className: kind });
    html(line, "td", name);
    html(line, "td", value);
  };
  const [low, high] = run.frame_ms_quartiles, { rel_rmse, psnr, flip, bias, flip_reason } = run.error;
  const orDash = (value, form) => value === null ? "–" : form(value);
  row("frame", `${plain(run.frame_ms)} ms (${plain(low)} to ${plain(high)}, ${run.frames} frames)`);
  const slowest = Object.entries(run.passes).sort((a, b) => b[1] - a[1]).slice(0, 6);
  for (const [name, ms] of slowest) row(name, `${plain(ms)} ms`, "sub");
  row("bake", `${plain(run.bake_ms)} ms${run.bake_cached ? " from the cache" : ""}`);
  row("memory", `${plain(run.bytes / 2 ** 20)} MiB`);
  row("relative RMSE", orDash(rel_rmse, percent));
  row("of the reference itself", orDash(run.floor, percent), "sub");
  row("PSNR", orDash(psnr, v => `${plain(v)} dB`));
  row("FLIP", flip_reason ?? orDash(flip, plain));
  row("bias", orDash(bias, plain));
  row("measured", `${run.date.slice(0, 10)}, ${run.version}`, "sub");
  tip.replaceChildren();
  html(tip, "b", run.setting);
  tip.append(table);
  tip.hidden = false;
  const place = mark.getBoundingClientRect(), size = tip.getBoundingClientRect();
  const left = place.right + 12 + size.width < innerWidth ? place.right + 12 : place.left - 12 - size.width;
  tip.style.left = `${Math.max(4, left)}px`;
  tip.style.top = `${Math.max(4, Math.min(place.top - 20, innerHeight - size.height - 4))}px`;
}

for (const method of Object.keys(DATA.methods)) {
  const choice = html(get("methods"), "label");
  const box = html(choice, "input", undefined, { type: "checkbox", checked: true, value: method });
  const swatch = svg(choice, "svg", { width: 16, height: 16, viewBox: "0 0 16 16", style: "width: 16px", "aria-hidden": "true" });
  svg(swatch, "polygon", { points: shape(method, 8, 8, 7), fill: colour(method) });
  choice.append(method);
  box.addEventListener("change", () => { hidden[box.checked ? "delete" : "add"](method); draw(); });
}
for (const [key, { name }] of Object.entries(METRICS)) html(get("metric"), "option", name, { value: key });
get("metric").addEventListener("change", event => { metric = METRICS[event.target.value]; draw(); });
get("caption").textContent = DATA.caption;
draw();
