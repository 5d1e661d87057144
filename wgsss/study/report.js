"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const root = document.documentElement.style;
const [width, height] = data.size;
const LARGEST_ZOOM = 64; // a pixel of a small picture then fills the page
const state = { light: 0, a: 0, b: 0, at: 50, zoom: 1, x: 0, y: 0 };

function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const images = () => data.lights[state.light].images;

// Apply the state to the page. x and y are the position of the picture's corner in per cent of the view.
function show() {
  state.x = clamp(state.x, 100 - 100 * state.zoom, 0);
  state.y = clamp(state.y, 100 - 100 * state.zoom, 0);
  for (const key of ["at", "zoom", "x", "y"]) root.setProperty("--" + key, state[key]);
  byId("handle").setAttribute("aria-valuenow", Math.round(state.at));
  byId("zoom").value = (state.zoom < 10 ? state.zoom.toFixed(1).replace(".0", "") : Math.round(state.zoom)) + "×";
  document.body.classList.toggle("smooth", (byId("stage").clientWidth / width) * state.zoom < 3);
}

// Show the two chosen pictures.
function choose() {
  for (const [key, image, tag] of [["a", "over", "tag-a"], ["b", "under", "tag-b"]]) {
    const chosen = images()[state[key]];
    byId(key).value = state[key];
    byId(image).src = chosen.source;
    byId(image).alt = byId(tag).textContent = chosen.title;
  }
}

// Zoom about a point of the view, in per cent.
function zoomBy(factor, x = 50, y = 50) {
  const zoom = clamp(state.zoom * factor, 1, LARGEST_ZOOM);
  state.x = x - ((x - state.x) * zoom) / state.zoom;
  state.y = y - ((y - state.y) * zoom) / state.zoom;
  state.zoom = zoom;
  show();
}

// Fill the page with the pictures and the figures under the chosen light.
function fill() {
  const light = data.lights[state.light];
  for (const key of ["a", "b"]) {
    const options = light.images.map((image, i) => make("option", { value: i, textContent: image.title }));
    byId(key).replaceChildren(...options);
  }
  table(byId("figures"), light.figures, 1);
  byId("floor").textContent = light.floor;
  byId("ticks").replaceChildren(...light.ticks.map(([at, text]) => {
    const mark = make("span", { textContent: text });
    mark.style.left = 100 * at + "%";
    return mark;
  }));
  const cards = [], pictures = light.images.length / 2;
  light.images.forEach((image, i) => {
    const view = make("div", { className: "view" }, make("img", { src: image.source, alt: image.title, draggable: false }));
    movable(view);
    const card = i % pictures; // the pictures come first, then their error maps
    if (i === card) {
      const caption = make("figcaption", {}, make("span", { textContent: image.title }));
      caption.append(make("small", { textContent: image.note }), button(i, "a", "left"), button(i, "b", "right"));
      cards.push(make("figure", {}, caption));
    }
    cards[card].append(view);
  });
  byId("sheet").replaceChildren(...cards);
  choose();
  show();
}

function button(index, side, title) {
  const element = make("button", { textContent: title[0].toUpperCase(), title: "show on the " + title });
  element.setAttribute("aria-label", element.title);
  element.onclick = () => { state[side] = index; choose(); };
  return element;
}

// Fill a table. Percentages from column `first` on get a bar, whose length is relative to the largest one in the table.
function table(element, rows, first) {
  if (!rows.length) return;
  const head = make("tr", {}, ...rows[0].map((text) => make("th", { textContent: text })));
  const number = (text) => (/^[\d.e+-]+ %/.test(text) ? parseFloat(text) : NaN);
  const tinted = (i) => i >= first && rows.slice(1).some((row) => !Number.isNaN(number(row[i])));
  const values = rows.slice(1).flatMap((row) => row.filter((_, i) => tinted(i)).map(number)).filter((v) => v > 0);
  const largest = Math.max(...values, 1e-9);
  const body = rows.slice(1).map((row) => make("tr", {}, ...row.map((text, i) => {
    const cell = make("td", { textContent: text });
    if (tinted(i) && number(text) >= 0) cell.style.setProperty("--share", (100 * number(text)) / largest);
    return cell;
  })));
  element.replaceChildren(make("thead", {}, head), make("tbody", {}, ...body));
}

// Draw a stacked bar of the parts of the error for each method.
function bars(causes) {
  const colours = ["#0072b2", "#d55e00", "#cc79a7", "#009e73"];
  const sum = (parts, sign) => parts.reduce((total, part) => total + Math.max(sign * part, 0), 0);
  const below = Math.max(...causes.rows.map((row) => sum(row.parts, -1)), 0);
  const span = below + Math.max(...causes.rows.map((row) => Math.max(sum(row.parts, 1), row.total)), 1e-9);
  const percent = (value) => (100 * value) / span + "%";
  for (const row of causes.rows) {
    const track = make("div", { className: "track" });
    let up = below, down = below;
    row.parts.forEach((part, i) => {
      const piece = make("span", { title: causes.names[i] + ": " + (100 * part).toFixed(1) + " %" });
      if (part < 0) down += part;
      Object.assign(piece.style, { left: percent(part < 0 ? down : up), width: percent(Math.abs(part)) });
      piece.style.background = colours[i];
      if (part > 0) up += part;
      track.append(piece);
    });
    const total = make("i", { title: "relative RMSE: " + (100 * row.total).toFixed(1) + " %" });
    total.style.left = percent(below + row.total);
    track.append(total);
    byId("bars").append(make("div", { textContent: row.name }), track);
  }
  const key = causes.names.map((name, i) => {
    const patch = make("b");
    patch.style.background = colours[i];
    return make("span", { title: causes.meanings[i] }, patch, name);
  });
  byId("bars").append(make("div", { className: "key" }, ...key, make("span", {}, "│ relative RMSE")));
}

// The position of the pointer in per cent of a view.
const place = (event, view) => {
  const box = view.getBoundingClientRect();
  return [(100 * (event.clientX - box.left)) / box.width, (100 * (event.clientY - box.top)) / box.height];
};

// Let the pointer move and zoom the pictures of a view.
function movable(view) {
  let last = null;
  view.addEventListener("pointerdown", (event) => {
    if (event.target.id === "handle" || event.button !== 0) return;
    last = place(event, view);
    view.setPointerCapture(event.pointerId);
  });
  view.addEventListener("pointermove", (event) => {
    if (!last) return;
    const [x, y] = place(event, view);
    state.x += x - last[0];
    state.y += y - last[1];
    last = [x, y];
    show();
  });
  for (const end of ["pointerup", "pointercancel"]) view.addEventListener(end, () => (last = null));
  view.addEventListener("wheel", (event) => {
    if (view.id !== "stage" && !event.ctrlKey) return; // over small pictures the wheel scrolls the page
    event.preventDefault();
    zoomBy(2 ** (-event.deltaY / 250), ...place(event, view));
  }, { passive: false });
  view.addEventListener("dblclick", (event) => zoomBy(2, ...place(event, view)));
}

// Let the pointer and the keys move the line between the two pictures.
function slide() {
  const handle = byId("handle"), stage = byId("stage");
  let isDragged = false;
  const move = (at) => { state.at = clamp(at, 0, 100); show(); };
  handle.addEventListener("pointerdown", (event) => { isDragged = true; handle.setPointerCapture(event.pointerId); });
  handle.addEventListener("pointermove", (event) => isDragged && move(place(event, stage)[0]));
  for (const end of ["pointerup", "pointercancel"]) handle.addEventListener(end, () => (isDragged = false));
  handle.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? 10 : 1;
    const to = { ArrowLeft: state.at - step, ArrowDown: state.at - step, ArrowRight: state.at + step,
      ArrowUp: state.at + step, PageDown: state.at - 10, PageUp: state.at + 10, Home: 0, End: 100 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    move(to);
  });
}

function keys() {
  const moves = { ArrowLeft: [5, 0], ArrowRight: [-5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] };
  byId("stage").addEventListener("keydown", (event) => {
    const step = moves[event.key];
    if (!step) return;
    event.preventDefault();
    state.x += step[0];
    state.y += step[1];
    show();
  });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
    const act = { "+": () => zoomBy(1.5), "=": () => zoomBy(1.5), "-": () => zoomBy(1 / 1.5), 0: () => zoomBy(0), x: swap };
    act[event.key]?.();
  });
  byId("in").onclick = () => zoomBy(1.5);
  byId("out").onclick = () => zoomBy(1 / 1.5);
  byId("reset").onclick = () => zoomBy(0);
  byId("swap").onclick = swap;
}

function swap() {
  [state.a, state.b] = [state.b, state.a];
  choose();
}

document.title = byId("title").textContent = data.title;
byId("about").textContent = data.about;
byId("versions").textContent = data.versions;
root.setProperty("--aspect", width + " / " + height);
root.setProperty("--ratio", width / height);
byId("bar").src = data.bar;
if (data.causes) {
  byId("causes-part").hidden = false;
  bars(data.causes);
  table(byId("causes"), data.causes.table, 1);
}
if (data.lights.length > 1) {
  byId("light-choice").hidden = byId("lights-part").hidden = false;
  byId("light").append(...data.lights.map((light, i) => make("option", { value: i, textContent: light.name })));
  byId("light").onchange = (event) => { state.light = Number(event.target.value); fill(); };
  table(byId("lights"), data.by_light, 1);
}
for (const side of ["a", "b"]) byId(side).onchange = (event) => { state[side] = Number(event.target.value); choose(); };
state.a = Math.min(1, images().length - 1);
movable(byId("stage"));
slide();
keys();
fill();
addEventListener("resize", show);
