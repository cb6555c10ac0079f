// Measured and simulated curves, what is left, metrics. The newest values win; answers that come late are dropped.
import { Chart } from "/static/chart.js";
import { ask, at, colour, dash, hour, hours, legend, make, studio, tried } from "/static/page.js";
import { drawPicture } from "/static/picture.js";
import { mark, told } from "/static/stages.js";
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
const below = new Chart(at("residuals"), { x: "time [h]", y: "residual [K]" }, (h) => cursor(h * 3600), (w) => show(w, below));
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
  at("time").max = last; if (s.time === null) s.time = last; at("time").value = s.time; at("time-text").textContent = hour(s.time);
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
const kelvin = (v) => (v === null ? "–" : (Math.abs(v) < 0.0005 ? 0 : v).toFixed(3));
function drawMetrics() {
  const curves = s.desk.runs[s.run].curves, worst = curves.filter((c) => c.largest !== null && c.measured.length).sort((a, b) => b.rmse - a.rmse)[0];
  at("metrics").tBodies[0].replaceChildren(...curves.map((c) => make("tr", { "data-sensor": c.name, "data-worst": c === worst && curves.length > 1 }, make("th", { scope: "row", text: c.name }), make("td", { text: c.node }), ...[c.rmse, c.bias, c.largest].map((v) => make("td", { class: "num", text: kelvin(v) })))));
  const lines = [worst ? "Points: measured. Lines: simulated." : "Lines: simulated.", curves.some((c) => c.gone) ? `Dots: ${s.gas === "vacuum" ? "the same in vacuum" : "without convection, as printed"}.` : ""];
  const rising = !worst && curves.map((c) => ({ name: c.name, at: Math.max(...c.simulated) })).sort((a, b) => b.at - a.at)[0];
  at("strokes").textContent = lines.filter(Boolean).join(" ");
  const state = told(s.desk.standing);
  at("worst").dataset.word = mark(state);
  at("worst").replaceChildren(...(state.standing ? [make("strong", { text: `${state.usable ? "?" : "✗"} ${state.standing}` }), "; "] : []), ...(worst ? [make("strong", { text: "furthest off " }), `${worst.name}: RMSE ${kelvin(worst.rmse)} K, largest ${kelvin(worst.largest)} K.`] : rising ? [make("strong", { text: "hottest " }), `${rising.name}: ${rising.at.toFixed(1)} °C.`] : []), ` ${known()}`);
}
// what the values on the page rest on: those with an error are known from logs, and how well
function known() {
  const free = s.desk.sliders.filter((x) => x.free), at = (x) => s.values[x.path] ?? x.value;
  const errors = free.filter((x) => x.error !== null && at(x) === (x.found ?? x.value)), moved = s.desk.sliders.filter((x) => at(x) !== (x.found ?? x.value)).length;
  if (!s.desk.measured) return `Nothing was measured; ${s.desk.fitted ? "values were tuned by hand, found by stages below, or are the decks' own" : "every value is the deck's own"}.${moved ? ` ${moved} moved.` : ""}`;
  if (!errors.length) return `None of ${free.length} values stands as a fit found it.${moved ? ` ${moved} moved.` : ""}`;
  const loose = errors.filter((x) => x.error > 0.2 * Math.abs(at(x))).map((x) => x.path);
  return `${errors.length} of ${s.desk.sliders.length} values fitted${loose.length ? `; known worse than 20 %: ${loose.slice(0, 3).join(", ")}${loose.length > 3 ? ` and ${loose.length - 3} more` : ""}` : ", each to 20 % or better"}; the others are the decks' or were found by stages below.${moved ? ` ${moved} moved.` : ""}`;
}
let waiting = 0;
function cursor(t) { s.time = t; at("time").value = t; at("time-text").textContent = hour(t); clearTimeout(waiting); waiting = setTimeout(drawPicture, 150); above.cursor = below.cursor = t / 3600; above.draw(); below.draw(); }

at("run").addEventListener("change", () => { s.run = Number(at("run").value); s.time = null; drawCharts(); drawPicture(); });
at("gas").addEventListener("change", async () => { const asked = at("gas").value, found = await tried(() => ask("/api/curves", { stage: s.stage, values: s.values, gas: asked, measured: true, window: s.window })); if (!found) { at("gas").value = s.gas; return; } s.gas = asked; s.desk.runs = found.runs; drawCharts(false); });
at("time").addEventListener("input", () => cursor(Number(at("time").value)));
document.addEventListener("recolour", () => s.desk && drawCharts(false));
