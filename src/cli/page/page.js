// SPDX-License-Identifier: Apache-2.0
// Shows the results of `driftlight compare`.
"use strict";

// Tests and readers of the page's source see what went wrong.
addEventListener("error", (event) => { document.documentElement.dataset.error = event.message; });

const { results, pictures, error_scale: errorScale } =
  JSON.parse(document.getElementById("data").textContent);
const integrators = results.integrators;
const kColors = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b8860b", "#56b4e9", "#000000"];

const colorOf = (i) => kColors[i % kColors.length];
const dashOf = (i) => ["", "6 3", "2 3"][Math.floor(i / kColors.length) % 3];
const byId = (id) => document.getElementById(id);

/// An HTML element with properties and children.
function html(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/// An SVG element with attributes and children.
function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/// Three digits; a dash for what is not known.
function number(x) {
  if (x === null || x === undefined) return "–";
  if (x === 0) return "0";
  const size = Math.abs(x);
  if (size < 1e-3 || size >= 1e6) return x.toExponential(2);
  return size >= 1000 ? Math.round(x).toString() : x.toPrecision(3);
}

function probability(p) {
  return p < 1e-3 ? p.toExponential(0) : p.toPrecision(2);
}

// --- Heading -------------------------------------------------------------------------------------

function budgetText() {
  const { seconds, samples_per_pixel: samples, mutations_per_pixel: mutations } = results.budget;
  if (seconds) return `${seconds} s a run`;
  const parts = [];
  if (samples) parts.push(`${samples} samples per pixel`);
  if (mutations) parts.push(`${mutations} mutations per pixel`);
  return parts.join(" or ") + " a run";
}

function showHeading() {
  const scene = results.scene.file.split("/").pop();
  document.title = `${scene} – driftlight compare`;
  byId("title").textContent = scene;
  const { width, height } = results.image;
  const reference = results.reference
    ? `against ${results.reference.file}`
    : "no reference: errors are those of the spread between runs, in which no bias shows";
  const shown = results.exposure === 1 ? "" : `; shown ${results.exposure} times as bright`;
  byId("subtitle").textContent =
    `${width} × ${height} pixels, ${results.runs} runs of each integrator, ${budgetText()}, ` +
    `${results.threads} threads; ${reference}${shown}`;
}

// --- Images --------------------------------------------------------------------------------------

const view = { chosen: 0, before: Math.min(1, pictures.length - 1), errors: false, x: 0, y: 0, zoom: 1 };

function showPicture() {
  const picture = pictures[view.chosen];
  const showsErrors = view.errors && picture.error !== null;
  const image = byId("picture");
  image.src = showsErrors ? picture.error : picture.image;
  // Large pixels stay square; an image that is made smaller is smoothed.
  const scale = (byId("stage").clientWidth * view.zoom) / results.image.width;
  image.style.imageRendering = scale > 1.5 ? "pixelated" : "auto";
  image.style.transform = `translate(${view.x}px, ${view.y}px) scale(${view.zoom})`;
  const kind = results.reference ? "relative error" : "spread of two runs, relative";
  byId("caption").textContent = picture.name + (showsErrors ? `: ${kind}` : "");
  byId("errors").checked = view.errors;
  byId("scale").hidden = !showsErrors;
  for (const [i, button] of [...byId("choices").children].entries())
    button.setAttribute("aria-pressed", String(i === view.chosen));
}

function choose(index) {
  if (index < 0 || index >= pictures.length) return;
  if (index !== view.chosen) view.before = view.chosen;
  view.chosen = index;
  showPicture();
}

/// Keeps the picture over the whole stage.
function moveTo(x, y) {
  const stage = byId("stage");
  view.x = Math.min(0, Math.max(x, stage.clientWidth * (1 - view.zoom)));
  view.y = Math.min(0, Math.max(y, stage.clientHeight * (1 - view.zoom)));
  showPicture();
}

function zoomAt(x, y, factor) {
  const zoom = Math.min(64, Math.max(1, view.zoom * factor));
  const ratio = zoom / view.zoom;
  view.zoom = zoom;
  moveTo(x - (x - view.x) * ratio, y - (y - view.y) * ratio);
}

function showWhole() {
  view.zoom = 1;
  moveTo(0, 0);
}

function toggleErrors() {
  view.errors = !view.errors;
  showPicture();
}

function listenToPointer(stage) {
  let drag = null;
  stage.addEventListener("pointerdown", (event) => {
    drag = { x: event.clientX - view.x, y: event.clientY - view.y,
             startX: event.clientX, startY: event.clientY, moved: false };
    stage.setPointerCapture(event.pointerId);
  });
  stage.addEventListener("pointermove", (event) => {
    if (!drag) return;
    drag.moved ||= Math.hypot(event.clientX - drag.startX, event.clientY - drag.startY) > 3;
    if (drag.moved) moveTo(event.clientX - drag.x, event.clientY - drag.y);
  });
  stage.addEventListener("pointerup", () => {
    if (drag && !drag.moved) choose(view.before);
    drag = null;
  });
  stage.addEventListener("pointercancel", () => { drag = null; });
  stage.addEventListener("wheel", (event) => {
    event.preventDefault();
    const box = stage.getBoundingClientRect();
    zoomAt(event.clientX - box.left, event.clientY - box.top, Math.exp(-event.deltaY / 400));
  }, { passive: false });
}

function listenToKeys() {
  const actions = {
    ArrowLeft: () => choose(view.chosen - 1),
    ArrowRight: () => choose(view.chosen + 1),
    " ": () => choose(view.before),
    e: toggleErrors,
    0: showWhole,
  };
  for (let i = 1; i <= 9; ++i) actions[i] = () => choose(i - 1);
  addEventListener("keydown", (event) => {
    const action = actions[event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
  });
}

function showImages() {
  const { width, height } = results.image;
  const stage = byId("stage");
  stage.style.aspectRatio = `${width} / ${height}`;
  stage.style.maxWidth = `calc(80vh * ${width / height})`;
  for (const [i, picture] of pictures.entries()) {
    const label = html("span", {}, picture.name);
    if (i < 9) label.append(html("small", {}, `key ${i + 1}`));
    byId("choices").append(html("button", { type: "button", onclick: () => choose(i) },
                                html("img", { src: picture.image, alt: "" }), label));
  }
  byId("errors").addEventListener("change", toggleErrors);
  byId("whole").addEventListener("click", showWhole);
  byId("scale-image").src = errorScale.image;
  byId("scale-low").textContent = `${100 * errorScale.low} %`;
  byId("scale-high").textContent = `${100 * errorScale.high} %`;
  listenToPointer(stage);
  listenToKeys();
  addEventListener("resize", () => moveTo(view.x, view.y));
  // First the first integrator, so that going back shows the reference.
  choose(view.before);
}

// --- Plots ---------------------------------------------------------------------------------------

const kPlot = { width: 400, height: 270, left: 52, right: 10, top: 6, bottom: 34 };

/// 1, 2 and 5 times powers of ten within [low, high]; powers alone if these are many.
function ticks(low, high) {
  const decades = Math.log10(high / low);
  const steps = decades < 2.5 ? [1, 2, 5] : [1];
  const found = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); ++power)
    for (const step of steps) {
      const x = Number(`${step}e${power}`);
      if (x >= low && x <= high) found.push(x);
    }
  return found;
}

function tickText(x) {
  return x >= 1e-3 && x < 1e4 ? String(x) : x.toExponential(0);
}

/// A logarithmic axis over the values, with some room about them.
function axis(values, from, to) {
  const room = 1.15;
  const low = Math.min(...values) / room;
  const high = Math.max(...values) * room;
  const scale = (to - from) / Math.log(high / low);
  return { low, high, at: (x) => from + Math.log(x / low) * scale };
}

/// The line of an integrator and the points of its runs: [seconds, error] of what is positive.
function curvesOf(figure, name) {
  const good = ([x, y]) => x > 0 && y > 0;
  return integrators.map(({ moments }) => ({
    line: moments.filter((m) => m[figure]).map((m) => [m.seconds, m[figure][name]]).filter(good),
    points: moments.flatMap((m) => m[figure]?.by_run ?? [])
      .map((run) => [run.seconds, run[name]]).filter(good),
  }));
}

function plot(title, figure, name) {
  const curves = curvesOf(figure, name);
  const all = curves.flatMap(({ line, points }) => [...line, ...points]);
  if (all.length === 0) return null;
  const right = kPlot.width - kPlot.right;
  const bottom = kPlot.height - kPlot.bottom;
  const x = axis(all.map((p) => p[0]), kPlot.left, right);
  const y = axis(all.map((p) => p[1]), bottom, kPlot.top);
  const picture = svg("svg", { viewBox: `0 0 ${kPlot.width} ${kPlot.height}`, role: "img" });
  picture.append(svg("title", {}, title));
  for (const t of ticks(x.low, x.high))
    picture.append(
      svg("line", { class: "grid", x1: x.at(t), x2: x.at(t), y1: kPlot.top, y2: bottom }),
      svg("text", { x: x.at(t), y: bottom + 15, "text-anchor": "middle" }, tickText(t)));
  for (const t of ticks(y.low, y.high))
    picture.append(
      svg("line", { class: "grid", x1: kPlot.left, x2: right, y1: y.at(t), y2: y.at(t) }),
      svg("text", { x: kPlot.left - 6, y: y.at(t) + 4, "text-anchor": "end" }, tickText(t)));
  picture.append(
    svg("text", { x: (kPlot.left + right) / 2, y: kPlot.height - 4, "text-anchor": "middle" }, "seconds"),
    svg("rect", { class: "frame", x: kPlot.left, y: kPlot.top,
                  width: right - kPlot.left, height: bottom - kPlot.top }));
  for (const [i, { line, points }] of curves.entries()) {
    for (const p of points)
      picture.append(svg("circle", { cx: x.at(p[0]), cy: y.at(p[1]), r: 1.6, fill: colorOf(i), opacity: 0.45 }));
    picture.append(svg("polyline", {
      points: line.map((p) => `${x.at(p[0])},${y.at(p[1])}`).join(" "), fill: "none",
      stroke: colorOf(i), "stroke-width": 1.8, "stroke-dasharray": dashOf(i) }));
    for (const p of line) {
      const label = `${integrators[i].name}\n${number(p[0])} s: ${number(p[1])}`;
      picture.append(svg("circle", { cx: x.at(p[0]), cy: y.at(p[1]), r: 3, fill: colorOf(i) },
                         svg("title", {}, label)));
    }
  }
  return html("figure", {}, html("figcaption", {}, title), picture);
}

function showPlots() {
  for (const [i, { name }] of integrators.entries()) {
    const key = svg("svg", { viewBox: "0 0 28 12" },
                    svg("line", { x1: 0, x2: 28, y1: 6, y2: 6, stroke: colorOf(i),
                                  "stroke-width": 2.5, "stroke-dasharray": dashOf(i) }));
    byId("legend").append(html("span", {}, key, name));
  }
  const kinds = [
    ["relMSE", "error", "relmse"],
    ["relMSE, trimmed", "error", "relmse_trimmed"],
    ["MSE", "error", "mse"],
    ["MAPE", "error", "mape"],
    ["Spread, relMSE", "spread", "relmse"],
    ["Spread, relMSE, trimmed", "spread", "relmse_trimmed"],
  ];
  for (const kind of kinds) {
    const figure = plot(...kind);
    if (figure) byId("plots").append(figure);
  }
}

// --- Tables --------------------------------------------------------------------------------------

/// Columns are [heading, integrator -> text or {text, doubt}, and if the least is best its value].
function fillTable(table, columns) {
  table.append(html("thead", {}, html("tr", {}, html("th", {}, "integrator"),
                                      ...columns.map(([heading]) => html("th", {}, heading)))));
  const best = columns.map(([, , value]) => {
    if (!value || integrators.length < 2) return null;
    const values = integrators.map(value).filter((x) => x !== null && x !== undefined);
    return values.length > 0 ? Math.min(...values) : null;
  });
  const body = html("tbody");
  for (const integrator of integrators) {
    const row = html("tr", {}, html("td", {}, integrator.name));
    for (const [i, [, text, value]] of columns.entries()) {
      const shown = text(integrator);
      const cell = html("td", {}, shown.text ?? shown);
      if (shown.doubt) cell.className = "doubt";
      if (value && best[i] !== null && value(integrator) === best[i]) cell.className = "best";
      row.append(cell);
    }
    body.append(row);
  }
  table.append(body);
}

const atEnd = (integrator) => integrator.moments[integrator.moments.length - 1];

function errorColumn(heading, figure, name) {
  const value = (integrator) => atEnd(integrator)[figure]?.[name];
  return [heading, (integrator) => number(value(integrator)), value];
}

function showErrorTable() {
  const errors = results.reference ? [
    errorColumn("relMSE", "error", "relmse"),
    errorColumn("trimmed", "error", "relmse_trimmed"),
    errorColumn("MSE", "error", "mse"),
    errorColumn("MAPE", "error", "mape"),
  ] : [];
  fillTable(byId("error-table"), [
    ["seconds", (integrator) => number(atEnd(integrator).seconds)],
    ["work", (integrator) => `${number(atEnd(integrator).work)} ${integrator.work_in}`],
    ...errors,
    errorColumn("spread, relMSE", "spread", "relmse"),
    errorColumn("trimmed", "spread", "relmse_trimmed"),
    errorColumn("MSE", "spread", "mse"),
  ]);
}

const kDoubt = 0.01;

/// The mean to the digits that its interval leaves.
function brightnessText({ brightness }) {
  const half = brightness.high - brightness.mean;
  if (!(half > 0)) return number(brightness.mean);
  const digits = Math.min(8, Math.max(0, 1 - Math.floor(Math.log10(half))));
  return `${brightness.mean.toFixed(digits)} ± ${half.toFixed(digits)}`;
}

function ratioText({ brightness }) {
  return { text: `${brightness.ratio.toFixed(4)} (p ${probability(brightness.p_value)})`,
           doubt: brightness.p_value < kDoubt };
}

function tilesText({ tile_test: test }) {
  return { text: `${test.rejected} of ${test.tiles} (p ${probability(test.p_value)})`,
           doubt: test.rejected > 0 };
}

function agreementText({ agreement }) {
  return agreement ? `${agreement.rhat.toFixed(3)} (${number(agreement.worst)})` : "–";
}

/// Of the steps of one kernel.
function acceptanceColumn(heading, kernel) {
  return [heading, ({ acceptance }) => number(acceptance?.[kernel])];
}

function showSamplerTable() {
  const against = results.reference
    ? [["mean / reference", ratioText], ["tiles rejected", tilesText],
       ["resolution", ({ tile_test: test }) => `${number(100 * test.resolution)} %`]] : [];
  fillTable(byId("sampler-table"), [
    ["mean ± 95 %", brightnessText],
    ...against,
    ["R-hat", agreementText],
    ["effective samples / s", (integrator) => number(integrator.effective_samples_per_second),
     ({ effective_samples_per_second: x }) => x === null ? null : -x],
    acceptanceColumn("large steps accepted", "large_step"),
    acceptanceColumn("small steps accepted", "small_step"),
    acceptanceColumn("second steps accepted", "second_step"),
    ["families", ({ effective_families: families }) => number(families)],
  ]);
}

showHeading();
showImages();
showPlots();
showErrorTable();
showSamplerTable();
document.documentElement.dataset.ready = "yes";
