// Measured and simulated curves, what is left, metrics. The newest values win; answers that come late are dropped.
import { Chart } from "/static/chart.js";
import { ask, at, colour, dash, hours, legend, make, shown, studio, tried } from "/static/page.js";
import { drawPicture } from "/static/picture.js";
import { s } from "/static/state.js";

let busy = false, again = false;
export async function move() {
  if (busy) { again = true; return; }
  busy = true;
  const begun = studio.begun;
  const found = await tried(() => ask("/api/curves", { stage: s.stage, values: s.values, gas: s.gas, measured: false, window: s.window }));
  if (found) { merge(found); retrace(); drawMetrics(); if (begun) requestAnimationFrame(() => studio.latencies.push(performance.now() - begun)); }
  busy = false;
  if (again) { again = false; move(); }
}
function merge(found) { found.runs.forEach((r, i) => r.curves.forEach((c, k) => Object.assign(s.desk.runs[i].curves[k], c, { hours: null }))); }

const above = new Chart(at("chart"), { x: "time [h]", y: "temperature [°C]" }, (h) => cursor(h * 3600), (w) => show(w, above));
const below = new Chart(at("residuals"), { x: "time [h]", y: "left [K]" }, (h) => cursor(h * 3600), (w) => show(w, below));
// a window is drawn at once from what is here, then from all samples that lie in it
let asking = 0;
async function show(w, from) {
  (from === above ? below : above).look(w, false);
  s.window = w && [w[0] * 3600, w[1] * 3600];
  const mine = ++asking, found = await tried(() => ask("/api/curves", { stage: s.stage, values: s.values, gas: s.gas, measured: true, window: s.window }));
  if (!found || mine !== asking) return;
  s.desk.runs.forEach((r, i) => { r.curves = found.runs[i].curves; });
  retrace();
}

export function drawCharts(whole = true) {
  const r = s.desk.runs[s.run], measured = r.curves.some((c) => c.measured.length);
  if (whole && (s.window || above.zoom)) { above.look(null, false); below.look(null, false); if (s.window) { s.window = null; show(null, above); } }
  at("residuals").hidden = !measured; at("metrics").parentElement.hidden = !measured;
  const last = Math.max(...r.curves.map((c) => c.times[c.times.length - 1]));
  at("time").max = last; if (s.time === null) s.time = last; at("time").value = s.time; at("time-text").textContent = `${shown(s.time / 3600, 3)} h`;
  legend(at("legend"), r.curves.map((c) => c.name), [above, below]);
  retrace(); drawMetrics();
}
export function retrace() {
  const upper = [], lower = [];
  s.desk.runs[s.run].curves.forEach((c, k) => {
    const look = { name: c.name, colour: colour(k), dash: dash(k) };
    c.seenHours ??= hours(c.seen); c.hours ??= hours(c.times);
    if (c.measured.length) { upper.push({ ...look, x: c.seenHours, y: c.measured, kind: "points" }); lower.push({ ...look, x: hours(c.apart), y: c.left, kind: "line", thin: true }); }
    upper.push({ ...look, x: c.hours, y: c.simulated, kind: "line" });
    if (c.gone) upper.push({ ...look, x: hours(c.gone_times), y: c.gone, kind: "dots" });
  });
  above.cursor = below.cursor = s.time / 3600;
  above.set(upper); below.set(lower);
}
function drawMetrics() {
  at("metrics").tBodies[0].replaceChildren(...s.desk.runs[s.run].curves.map((c) => make("tr", { "data-sensor": c.name }, make("th", { scope: "row", text: c.name }), make("td", { text: c.node }), ...[c.rmse, c.bias, c.largest].map((v) => make("td", { class: "num", text: shown(v, 3) })))));
}
let waiting = 0;
function cursor(t) { s.time = t; at("time").value = t; at("time-text").textContent = `${shown(t / 3600, 3)} h`; clearTimeout(waiting); waiting = setTimeout(drawPicture, 150); above.cursor = below.cursor = t / 3600; above.draw(); below.draw(); }

at("run").addEventListener("change", () => { s.run = Number(at("run").value); s.time = null; drawCharts(); drawPicture(); });
at("gas").addEventListener("change", async () => { const asked = at("gas").value, found = await tried(() => ask("/api/curves", { stage: s.stage, values: s.values, gas: asked, measured: true, window: s.window })); if (!found) { at("gas").value = s.gas; return; } s.gas = asked; s.desk.runs = found.runs; drawCharts(false); });
at("time").addEventListener("input", () => cursor(Number(at("time").value)));
document.addEventListener("recolour", () => s.desk && drawCharts(false));
