"use strict";

// The assets of a batch as a table of which only the rows in view exist. Text is only ever set as text.

const ROWS = JSON.parse(document.getElementById("rows").textContent);
const STATES = ["crashed", "memory", "timeout", "failed", "stopped", "baked", "moved", "unchanged"];
const WORDS = { memory: "out of memory", timeout: "out of time" };
const SPARE = 8; // rows beyond either end of the window
const SPELLED = /[\u0000-\u001f\u007f-\u009f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]/gu;

const $ = (id) => document.getElementById(id);
const words = (state) => WORDS[state] || state;
const code = (letter) => letter.codePointAt(0).toString(16);
// What would be invisible, or turn what follows around, is shown as an escape; whole emoji are not matched.
const visible = (text) => text.replace(SPELLED, (letter) => `\\u{${code(letter)}}`);

function make(tag, attributes = {}, ...inside) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...inside.map((part) => (typeof part === "string" ? visible(part) : part)));
  return element;
}

const folderOf = (row) => row.source.slice(0, Math.max(0, row.source.lastIndexOf("/")));
const nameOf = (row) => row.source.slice(row.source.lastIndexOf("/") + 1);
const wentWrong = (row) => STATES.indexOf(row.state) < STATES.indexOf("stopped");
const whole = (n) => n.toLocaleString("en-US");

function bytes(n) {
  for (const unit of ["B", "kB", "MB", "GB"]) {
    if (n < 999.5 || unit === "GB") return `${unit === "B" || n >= 99.5 ? Math.round(n) : n.toFixed(1)} ${unit}`;
    n /= 1000;
  }
}

function seconds(s) {
  if (s < 60) return `${s < 10 ? s.toFixed(2) : s.toFixed(1)} s`;
  const all = Math.round(s);
  if (all < 3600) return `${Math.floor(all / 60)} min ${all % 60} s`;
  return `${Math.floor(all / 3600)} h ${Math.floor((all % 3600) / 60)} min`;
}

// title, what it is sorted by, and what a cell shows
const COLUMNS = [
  { id: "pictures", title: "Before, after" },
  { id: "name", title: "Asset", key: (r) => r.source },
  { id: "state", title: "State", key: (r) => STATES.indexOf(r.state) },
  { id: "error", title: "Error rms", number: true, key: (r) => r.rms, text: (r) => (r.rms === undefined ? "" : r.rms.toFixed(4)) },
  { id: "triangles", title: "Triangles", number: true, key: (r) => r.triangles, text: (r) => (r.triangles === undefined ? "" : whole(r.triangles)) },
  { id: "seconds", title: "Time", number: true, key: (r) => r.seconds, text: (r) => seconds(r.seconds) },
  { id: "size", title: "Written", number: true, key: (r) => r.written, text: (r) => (r.written ? bytes(r.written) : "") },
  { id: "warnings", title: "Warnings", number: true, key: (r) => r.warnings.length, text: (r) => (r.warnings.length ? whole(r.warnings.length) : "") },
];

ROWS.forEach((row, number) => {
  row.number = number;
  row.warnings = row.warnings || [];
  row.reason = row.reason || "";
  row.sought = [row.source, row.target, row.reason, ...row.warnings].join("\n").toLowerCase();
});

const chosen = { state: "", warned: false, text: "", folder: "", by: "state", down: false };
let shown = []; // rows that fit, in order
let open = -1; // number of the row whose details are shown
let active = -1; // number of the row that the keyboard is at
let detailHeight = 0;
let columns = 0; // that are shown: a narrow window has fewer
const made = new Map(); // number of a row -> its elements

function fits(row) {
  return (
    (!chosen.state || row.state === chosen.state) &&
    (!chosen.warned || row.warnings.length > 0) &&
    (!chosen.folder || row.source.startsWith(chosen.folder + "/")) &&
    (!chosen.text || row.sought.includes(chosen.text))
  );
}

function compare(a, b) {
  if (a === b) return 0;
  if (a === undefined) return 1;
  if (b === undefined) return -1;
  return a < b ? -1 : 1;
}

function choose() {
  const { key } = COLUMNS.find((column) => column.id === chosen.by);
  const turn = chosen.down ? -1 : 1;
  const keyed = ROWS.filter(fits).map((row) => [key(row), row]);
  // What has no value comes last either way.
  keyed.sort(([a, r], [b, s]) => compare(a, b) * (a === undefined || b === undefined ? 1 : turn) || r.number - s.number);
  shown = keyed.map(([, row]) => row);
  if (!shown.some((row) => row.number === open)) open = -1;
  if (!shown.some((row) => row.number === active)) active = shown.length ? shown[0].number : -1;
  $("none").hidden = shown.length > 0;
  $("count").textContent = `${whole(shown.length)} of ${whole(ROWS.length)} assets`;
  drawControls();
  for (const elements of made.values()) elements.forEach((element) => element.remove());
  made.clear();
  draw();
}

function pictures(row) {
  return ["before", "after"]
    .filter((which) => row[which])
    .map((which) => make("img", { src: row[which], alt: `${which} baking`, width: 128, height: 96, decoding: "async" }));
}

function rowOf(row) {
  const name = make("button", { class: "name", type: "button", tabindex: "-1", "aria-expanded": "false", title: visible(row.source) }, nameOf(row));
  const said = wentWrong(row) ? row.reason : folderOf(row);
  const cells = COLUMNS.map((column) => {
    const at = { class: `c-${column.id}${column.number ? " number" : ""}` };
    if (column.id === "pictures") return make("td", at, ...pictures(row));
    if (column.id === "name") return make("td", at, name, make("span", { class: wentWrong(row) ? "under bad" : "under" }, said));
    if (column.id === "state") {
      return make("td", at, make("span", { class: row.state }, make("span", { class: "dot" }), words(row.state)),
        make("span", { class: "under" }, row.command));
    }
    return make("td", at, column.text(row));
  });
  const element = make("tr", { class: "row" }, ...cells);
  element.dataset.number = row.number;
  return element;
}

function facts(row) {
  const list = make("dl");
  const tell = (title, ...lines) => {
    const told = lines.filter(Boolean).flatMap((line) => [make("br"), line]).slice(1);
    if (told.length) list.append(make("dt", {}, title), make("dd", {}, ...told));
  };
  const named = (values) => Object.entries(values || {}).map(([name, value]) => `${name} ${value}`).join(", ");
  tell("Read", `${row.source}, ${bytes(row.read)}`);
  tell("Written", ...(row.outputs || []), row.written && `${bytes(row.written)} in all`);
  tell("Baked", [row.triangles !== undefined && `${whole(row.triangles)} triangles`, row.points !== undefined &&
    `${whole(row.points)} ${row.command === "texture" ? "texels" : "vertices"}`, row.rays && `${whole(row.rays)} rays`].filter(Boolean).join(", "));
  tell("Standard error", row.rms !== undefined ? `rms ${row.rms}, 99 % below ${row.p99}, largest ${row.max}` : "");
  tell("Beyond tolerance", row.missed ? `${whole(row.missed)} points` : "");
  tell("Time", seconds(row.seconds) + (row.stages ? ` (${named(row.stages)})` : ""));
  tell("Memory", row.peak ? `at most ${bytes(row.peak)}` : "");
  tell("Attempts", row.attempts > 1 ? String(row.attempts) : "");
  tell("Layout", ...(row.layout || []));
  tell("Settings", row.settings ? named(row.settings) : "defaults");
  tell("From", ...(row.files || []));
  return list;
}

function detailOf(row) {
  const told = make("div", { class: "told" });
  if (row.reason) told.append(make("p", wentWrong(row) ? { class: "bad" } : {}, row.reason));
  if (row.warnings.length) told.append(make("ul", {}, ...row.warnings.map((text) => make("li", {}, text))));
  if (row.view) told.append(make("p", {}, make("a", { href: row.view, target: "_blank", rel: "noopener" }, "Open in the viewer")));
  told.append(facts(row));
  const figures = pictures(row).map((image) => make("figure", {}, image, make("figcaption", {}, image.alt)));
  const sheet = make("div", { class: "sheet" }, ...(figures.length ? [make("div", {}, ...figures)] : []), told);
  return make("tr", { class: "detail", id: "detail" }, make("td", { colspan: columns }, sheet));
}

const above = make("tr", { "aria-hidden": "true" }, make("td"));
const below = above.cloneNode(true);
const rowHeight = parseFloat(getComputedStyle(document.documentElement).getPropertyValue("--row")) || 60;
$("body").append(above, below);

const openAt = () => (open < 0 ? -1 : shown.findIndex((row) => row.number === open));
const place = (index) => index * rowHeight + (open >= 0 && index > openAt() ? detailHeight : 0);

function countColumns() {
  columns = [...$("heads").children].filter((head) => getComputedStyle(head).display !== "none").length;
  for (const cell of $("body").querySelectorAll("tr:not(.row) > td")) cell.colSpan = columns;
}

// The first row to be made, and the one after the last.
function range() {
  const top = -$("body").getBoundingClientRect().top;
  const details = openAt();
  const at = (y) => {
    const index = Math.floor(y / rowHeight);
    if (details < 0 || index <= details) return index;
    return Math.max(details, Math.floor((y - detailHeight) / rowHeight));
  };
  const first = Math.max(0, at(top) - SPARE);
  return [Math.min(first, shown.length), Math.min(shown.length, Math.max(0, at(top + innerHeight)) + SPARE + 1)];
}

function height(spacer, pixels) {
  spacer.hidden = pixels <= 0;
  spacer.firstChild.style.height = `${pixels}px`;
  spacer.firstChild.style.padding = "0";
}

function draw() {
  const [first, end] = range();
  const wanted = new Map(shown.slice(first, end).map((row, offset) => [row.number, first + offset]));
  removeBut(wanted);
  let next = above.nextSibling;
  for (const [number, index] of wanted) {
    for (const element of elementsOf(number, index)) {
      if (element === next) next = next.nextSibling;
      else $("body").insertBefore(element, next);
    }
  }
  // The table is always entered at one row; at the first one in view where the last one used is not.
  if (shown.length && !wanted.has(active)) $("body").querySelector(".name").tabIndex = 0;
  if ($("detail")) detailHeight = $("detail").getBoundingClientRect().height;
  document.querySelector("table").setAttribute("aria-rowcount", shown.length + 1);
  height(above, place(first));
  height(below, (shown.length - end) * rowHeight + (openAt() >= end ? detailHeight : 0));
}

function removeBut(wanted) {
  for (const [number, elements] of made) {
    if (elements[1] && number !== open) elements.pop().remove();
    if (!wanted.has(number)) {
      elements.forEach((element) => element.remove());
      made.delete(number);
    }
  }
}

// The row of an asset, and its details where they are open.
function elementsOf(number, index) {
  if (!made.has(number)) made.set(number, [rowOf(ROWS[number])]);
  const elements = made.get(number);
  const [row] = elements;
  if (number === open && !elements[1]) elements.push(detailOf(ROWS[number]));
  row.setAttribute("aria-rowindex", index + 2);
  row.classList.toggle("open", number === open);
  const name = row.querySelector(".name");
  name.setAttribute("aria-expanded", String(number === open));
  name.tabIndex = number === active ? 0 : -1;
  return elements;
}

function toggle(number) {
  open = open === number ? -1 : number;
  active = number;
  draw();
}

function go(index) {
  if (!shown.length) return;
  const wanted = Math.min(shown.length - 1, Math.max(0, index));
  active = shown[wanted].number;
  const top = $("body").getBoundingClientRect().top + place(wanted);
  const head = document.querySelector("thead").getBoundingClientRect().height;
  if (top < head) scrollBy(0, top - head);
  else if (top + rowHeight > innerHeight) scrollBy(0, top + rowHeight - innerHeight);
  draw();
  made.get(active)?.[0].querySelector(".name").focus({ preventScroll: true });
}

function drawControls() {
  for (const chip of $("states").children) {
    const pressed = chip.dataset.state === "warned" ? chosen.warned : chip.dataset.state === chosen.state && (chosen.state || !chosen.warned);
    chip.setAttribute("aria-pressed", String(Boolean(pressed)));
  }
  for (const head of $("heads").children) {
    if (head.dataset.column === chosen.by) head.setAttribute("aria-sort", chosen.down ? "descending" : "ascending");
    else head.removeAttribute("aria-sort");
  }
}

function chip(state, title, count) {
  const button = make("button", { type: "button", class: state, "aria-pressed": "false" },
    ...(state ? [make("span", { class: "dot" })] : []), `${title} `, make("b", {}, whole(count)));
  button.dataset.state = state;
  button.addEventListener("click", () => {
    if (state === "warned") chosen.warned = !chosen.warned;
    else {
      chosen.state = chosen.state === state ? "" : state;
      if (!state) chosen.warned = false;
    }
    choose();
  });
  return button;
}

function start() {
  const counts = new Map();
  const folders = new Set();
  for (const row of ROWS) {
    counts.set(row.state, (counts.get(row.state) || 0) + 1);
    for (let folder = folderOf(row); folder && !folders.has(folder); folder = folder.slice(0, Math.max(0, folder.lastIndexOf("/")))) folders.add(folder);
  }
  const warned = ROWS.filter((row) => row.warnings.length).length;
  $("states").append(chip("", "All", ROWS.length), ...STATES.filter((state) => counts.has(state)).map((state) => chip(state, words(state), counts.get(state))));
  if (warned) $("states").append(chip("warned", "with warnings", warned));
  $("folder").append(make("option", { value: "" }, "All folders"), ...[...folders].sort().map((folder) => make("option", { value: folder }, folder)));
  $("folder").parentElement.hidden = folders.size < 2;
  for (const column of COLUMNS) {
    const inside = column.key ? make("button", { type: "button" }, column.title) : make("span", {}, column.title);
    const head = make("th", { scope: "col", class: `c-${column.id}${column.number ? " number" : ""}` }, inside);
    head.dataset.column = column.id;
    if (column.key) inside.addEventListener("click", () => {
      chosen.down = chosen.by === column.id ? !chosen.down : Boolean(column.number);
      chosen.by = column.id;
      choose();
    });
    $("heads").append(head);
  }
  listen();
  countColumns();
  choose();
  document.documentElement.dataset.state = "ready";
}

function listen() {
  $("text").addEventListener("input", () => { chosen.text = $("text").value.trim().toLowerCase(); choose(); });
  $("folder").addEventListener("change", () => { chosen.folder = $("folder").value; choose(); });
  $("clear").addEventListener("click", () => {
    Object.assign(chosen, { state: "", warned: false, text: "", folder: "" });
    $("text").value = $("folder").value = "";
    choose();
    $("text").focus();
  });
  $("body").addEventListener("click", (event) => {
    const row = event.target.closest("tr.row");
    if (!row || String(getSelection())) return;
    toggle(Number(row.dataset.number));
    row.querySelector(".name").focus({ preventScroll: true });
  });
  $("body").addEventListener("keydown", (event) => {
    if (!event.target.classList.contains("name") || event.ctrlKey || event.altKey || event.metaKey) return;
    const at = shown.findIndex((row) => row.number === Number(event.target.closest("tr").dataset.number));
    const page = Math.max(1, Math.floor(innerHeight / rowHeight) - 2);
    const to = { ArrowDown: at + 1, ArrowUp: at - 1, PageDown: at + page, PageUp: at - page, Home: 0, End: shown.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    go(to);
  });
  document.addEventListener("keydown", (event) => {
    if (event.key !== "/" || event.ctrlKey || event.altKey || event.metaKey || /^(INPUT|SELECT)$/.test(event.target.tagName)) return;
    event.preventDefault();
    $("text").focus();
  });
  let waiting = false;
  const later = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; draw(); });
  };
  addEventListener("scroll", later, { passive: true });
  addEventListener("resize", () => { countColumns(); later(); });
}

start();
