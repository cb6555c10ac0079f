// The studio's page: asks the server for numbers, draws them, keeps the states that can be undone.
import { Chart } from "/static/chart.js";

const at = (id) => document.getElementById(id);
const COLOURS = ["#0072b2", "#d55e00", "#007a5a", "#b0509c", "#8a6d00", "#3f7fbf", "#a3201d", "#5b6b7a", "#6a4fb3", "#2e8b8b", "#b36b00", "#7a3b3b"];
const ICE = 273.15;
let project = null, stage = null, desk = null, values = {}, run = 0, gas = "air", time = null, chosen = null;
let done = [], undone = [], folded = new Set(), ticked = new Set();
const studio = (window.studio = { latencies: [], errors: [] });

async function ask(path, body) {
  const answer = await fetch(path, body === undefined ? {} : { method: "POST", headers: { "content-type": "application/json", "x-thermid-studio": "1" }, body: JSON.stringify(body) });
  const found = await answer.json();
  if (found.error) throw new Error(found.where && !found.error.includes(found.where) ? `${found.where}: ${found.error}` : found.error);
  return found;
}
function make(tag, attributes = {}, ...inside) {
  const node = document.createElement(tag);
  for (const [k, v] of Object.entries(attributes)) k === "text" ? (node.textContent = v) : k.startsWith("on") ? node.addEventListener(k.slice(2), v) : v === false || node.setAttribute(k, v === true ? "" : v);
  node.append(...inside);
  return node;
}
function wrong(error) { const box = at("error"); box.hidden = !error; box.textContent = error ? String(error.message || error) : ""; }
async function tried(make) { try { wrong(null); return await make(); } catch (error) { wrong(error); return null; } }
const shown = (v, digits = 4) => (v === null || v === undefined ? "–" : Number(v).toPrecision(digits).replace(/(\.\d*?)0+($|e)/, "$1$2").replace(/\.($|e)/, "$1"));

// ---- stages
function drawStages() {
  const list = at("stages"), job = project.job, waiting = document.activeElement && document.activeElement.dataset.stage;
  list.replaceChildren(...project.stages.map((s) => {
    const running = job && !job.ended && job.what === "run" && job.stage === s.name, state = running ? "running" : s.state;
    const worst = Math.max(...Object.values(s.sensors), 0);
    const says = state === "done" ? `RMSE to ${shown(worst, 2)} K` : state;
    return make("li", {}, make("button", { type: "button", "data-stage": s.name, "data-state": state, "aria-current": s.name === stage ? "true" : "false", title: s.why || state, onclick: () => open(s.name) }, make("span", { text: s.name }), make("small", { text: says })));
  }));
  if (waiting) list.querySelector(`[data-stage="${CSS.escape(waiting)}"]`)?.focus();
}
function drawLevels() {
  const state = project.stages.find((s) => s.name === stage), box = at("stage-detail");
  box.replaceChildren();
  if (!state || project.kind === "deck") { at("levels").hidden = true; return; }
  const above = project.stages.filter((s) => s.below.includes(stage)).map((s) => s.name);
  box.append(make("p", { text: `${stage}: ${state.state}${state.why ? `, ${state.why}` : ""}. ` + (state.below.length ? `Takes values of ${state.below.join(", ")}. ` : "Takes values of no other stage. ") + (above.length ? `Hands its own to ${above.join(", ")}.` : "Hands its own to none.") }));
  box.append(make("button", { type: "button", id: "run-stage", text: "Run this stage", onclick: () => tried(() => begin("/api/run", { stage, below: true })) }));
  const parts = Object.keys(project.table), levels = project.stages.map((s) => s.name).filter((n) => parts.some((p) => n in project.table[p]));
  at("table").tHead.replaceChildren(make("tr", {}, make("th", { scope: "col", text: "Part" }), ...levels.map((n) => make("th", { scope: "col", class: "num", text: n }))));
  at("table").tBodies[0].replaceChildren(...parts.map((p) => make("tr", {}, make("th", { scope: "row", text: p }), ...levels.map((n) => make("td", { class: "num", text: n in project.table[p] ? shown(project.table[p][n], 3) : "" })))));
}
async function refresh() {
  const found = await ask("/api/project");
  const changed = !project || JSON.stringify(found.stages) !== JSON.stringify(project.stages);
  project = found;
  at("title").textContent = project.title;
  at("note").textContent = [project.file, project.note].filter(Boolean).join(" — ");
  document.title = `${project.title} · thermid studio`;
  const job = project.job, running = job && job.ended === false;
  at("status").textContent = running ? `${job.what === "look" ? "looking at" : job.what === "fit" ? "fitting" : "running"} ${job.stage}${job.evaluations ? `, evaluation ${job.evaluations}, weighted RMS ${shown(job.rms, 3)}` : ""}` : "";
  at("fit").disabled = running || !desk || !desk.measured;
  drawStages();
  if (changed) drawLevels();
  return running;
}
async function watch(after) {
  const running = await refresh();
  if (running) { setTimeout(() => tried(() => watch(after)), 150); return; }
  if (project.job && project.job.error) wrong(project.job.error);
  else if (after) await after(project.job);
}
async function begin(path, body, after) {
  await ask(path, body);
  await watch(after || (async () => { if (body.stage === stage) await open(stage); }));
}

// ---- one stage
async function open(name) {
  stage = name;
  drawStages();
  const found = await tried(() => ask(`/api/desk?stage=${encodeURIComponent(name)}`));
  desk = found; values = {}; done = []; undone = []; run = 0; time = null; chosen = null; folded = new Set();
  at("fit-result").replaceChildren(); at("detail").replaceChildren(); at("swap-result").replaceChildren();
  drawLevels();
  for (const id of ["model", "curves", "tuning"]) at(id).hidden = !desk;
  if (!desk) return;
  at("banner").hidden = !(desk.synthetic || project.note);
  at("banner").textContent = [desk.synthetic ? "Synthetic data: no reading here was measured." : "", project.note].filter(Boolean).join(" ");
  ticked = new Set(desk.sliders.filter((s) => s.free).map((s) => s.path));
  at("fit").disabled = !desk.measured;
  at("curves-title").textContent = desk.measured ? "Measured and simulated" : "Simulated";
  at("run").replaceChildren(...desk.runs.map((r, k) => make("option", { value: k, text: r.name })));
  at("folds").replaceChildren(...desk.parts.map((p) => make("button", { type: "button", "aria-pressed": "false", "data-fold": p, text: p, title: `fold or unfold ${p}`, onclick: () => fold(p) })));
  at("swap-part").replaceChildren(...desk.parts.map((p) => make("option", { value: p, text: p })));
  at("swap-deck").replaceChildren(...project.decks.map((d) => make("option", { value: d, text: d })));
  at("swap").hidden = project.kind === "deck" || desk.parts.length === 0;
  drawSliders(); drawCharts(); drawPicture();
}

// ---- sliders
const track = (s, v) => (s.log ? Math.log(v / s.low) / Math.log(s.high / s.low) : (v - s.low) / (s.high - s.low));
const fromTrack = (s, t) => (s.log ? s.low * (s.high / s.low) ** t : s.low + t * (s.high - s.low));
function drawSliders() {
  const groups = new Map();
  for (const s of desk.sliders) {
    const cut = s.path.lastIndexOf("."), part = desk.parts.filter((p) => s.path.startsWith(`${p}.`)).pop() || desk.title;
    const key = s.free ? "Fitted by this stage" : cut < 0 ? desk.title : part;
    groups.set(key, [...(groups.get(key) || []), s]);
  }
  at("sliders").replaceChildren(...[...groups].map(([name, list]) => make("details", { open: list[0].free || groups.size === 1 || desk.sliders.length < 12 }, make("summary", { text: `${name} (${list.length})` }), ...list.map(slider))));
}
function slider(s) {
  const id = `s-${s.path}`, value = values[s.path] ?? s.value;
  const range = make("input", { type: "range", id, min: 0, max: 1, step: 0.001, value: track(s, value), "aria-valuetext": `${shown(value)} ${s.unit}` });
  const number = make("input", { type: "number", step: "any", min: s.low, max: s.high, value: shown(value), "aria-label": `${s.path} in ${s.unit}` });
  const box = make("div", { class: "slider", "data-slider": s.path });
  const tick = make("input", { type: "checkbox", "aria-label": `let the fit move ${s.path}`, onchange: () => (tick.checked ? ticked.add(s.path) : ticked.delete(s.path)) });
  tick.checked = ticked.has(s.path);
  const error = s.error === null ? "" : ` ± ${shown(s.error, 2)}`;
  const set = (v) => { values = { ...values, [s.path]: v }; range.value = track(s, v); number.value = shown(v); range.setAttribute("aria-valuetext", `${shown(v)} ${s.unit}`); box.classList.toggle("moved", v !== s.value); move(); };
  range.addEventListener("input", () => { studio.begun = performance.now(); if (!range.held) { range.held = true; remember(); } set(fromTrack(s, Number(range.value))); });
  range.addEventListener("change", () => { range.held = false; drawPicture(); });
  number.addEventListener("change", () => { const v = Number(number.value); if (!(v >= s.low && v <= s.high)) { wrong(`${s.path}: ${number.value} lies outside ${shown(s.low)} .. ${shown(s.high)} ${s.unit}.`); number.value = shown(values[s.path] ?? s.value); return; } wrong(null); remember(); studio.begun = performance.now(); set(v); drawPicture(); });
  box.classList.toggle("moved", value !== s.value);
  box.append(make("div", { class: "name" }, tick, make("label", { for: id, text: s.path, title: [s.source, s.note, s.also.length ? `moves ${s.also.join(", ")} too` : ""].filter(Boolean).join("; ") })), range,
    make("div", { class: "value" }, number, make("span", { text: `${s.unit}${error}  (${shown(s.low, 3)} .. ${shown(s.high, 3)})` })));
  return box;
}
function remember() { done.push(values); undone = []; buttons(); }
function buttons() { at("undo").disabled = !done.length; at("redo").disabled = !undone.length; at("reset").disabled = !Object.keys(values).length; }
function step(from, to) { if (!from.length) return; to.push(values); values = from.pop(); after(); }
function after() { buttons(); drawSliders(); studio.begun = performance.now(); move(); drawPicture(); }

// ---- curves: the newest values win, answers that come late are dropped
let busy = false, again = false;
async function move() {
  buttons();
  if (busy) { again = true; return; }
  busy = true;
  const begun = studio.begun;
  const found = await tried(() => ask("/api/curves", { stage, values, gas, measured: false }));
  if (found) { found.runs.forEach((r, i) => r.curves.forEach((c, k) => Object.assign(desk.runs[i].curves[k], c))); retrace(); drawMetrics(); if (begun) { studio.latencies.push(performance.now() - begun); } }
  busy = false;
  if (again) { again = false; move(); }
}
const seconds = (list) => Float64Array.from(list, (t) => t / 3600);
const left = (c) => { let k = 0; return Float64Array.from(c.seen, (t, i) => { while (k < c.times.length - 2 && c.times[k + 1] < t) k++; const w = c.times.length > 1 ? Math.min(1, Math.max(0, (t - c.times[k]) / (c.times[k + 1] - c.times[k]))) : 0; return c.measured[i] - (c.simulated[k] + w * ((c.simulated[k + 1] ?? c.simulated[k]) - c.simulated[k])); }); };
const colour = (k) => COLOURS[k % COLOURS.length];
const above = new Chart(at("chart"), { x: "time [h]", y: "temperature [°C]" }, (h) => cursor(h * 3600));
const below = new Chart(at("residuals"), { x: "time [h]", y: "left [K]" }, (h) => cursor(h * 3600));
function drawCharts() {
  const r = desk.runs[run], measured = r.curves.some((c) => c.measured.length);
  at("residuals").hidden = !measured; at("metrics").parentElement.hidden = !measured;
  const last = Math.max(...r.curves.map((c) => c.times[c.times.length - 1]));
  at("time").max = last; if (time === null) time = last; at("time").value = time; at("time-text").textContent = `${shown(time / 3600, 3)} h`;
  at("legend").replaceChildren(...r.curves.map((c, k) => make("button", { type: "button", "aria-pressed": String(!above.hidden.has(c.name)), "data-curve": c.name, onclick: (e) => toggle(c.name, e.currentTarget) }, make("i", { style: `background:${colour(k)}` }), make("span", { text: c.name }))));
  retrace(); drawMetrics();
}
function toggle(name, button) { for (const chart of [above, below]) { chart.hidden.has(name) ? chart.hidden.delete(name) : chart.hidden.add(name); chart.draw(); } button.setAttribute("aria-pressed", String(!above.hidden.has(name))); }
function retrace() {
  const r = desk.runs[run], upper = [], lower = [];
  r.curves.forEach((c, k) => {
    c.seenHours ??= seconds(c.seen); c.hours ??= seconds(c.times);
    if (c.measured.length) { upper.push({ name: c.name, x: c.seenHours, y: c.measured, kind: "points", colour: colour(k) }); lower.push({ name: c.name, x: c.seenHours, y: left(c), kind: "line", thin: true, colour: colour(k) }); }
    upper.push({ name: c.name, x: c.hours, y: c.simulated, kind: "line", colour: colour(k) });
    if (c.gone) upper.push({ name: c.name, x: seconds(c.gone_times), y: c.gone, kind: "dots", colour: colour(k) });
  });
  above.cursor = below.cursor = time / 3600;
  above.set(upper); below.set(lower);
}
function drawMetrics() {
  at("metrics").tBodies[0].replaceChildren(...desk.runs[run].curves.map((c) => make("tr", { "data-sensor": c.name }, make("th", { scope: "row", text: c.name }), make("td", { text: c.node }), ...[c.rmse, c.bias, c.largest].map((v) => make("td", { class: "num", text: shown(v, 3) })))));
}
let waiting = 0;
function cursor(t) { time = t; at("time").value = t; at("time-text").textContent = `${shown(t / 3600, 3)} h`; clearTimeout(waiting); waiting = setTimeout(drawPicture, 150); above.cursor = below.cursor = t / 3600; above.draw(); below.draw(); }

// ---- picture
let drawing = 0;
async function drawPicture() {
  const mine = ++drawing;
  const found = await tried(() => ask("/api/picture", { stage, values, run, time, folded: [...folded] }));
  if (!found || mine !== drawing) return;
  at("picture").innerHTML = found.svg; // made by the server, every text in it escaped, and no script may run here
  mark();
}
function fold(part) {
  folded.has(part) ? folded.delete(part) : folded.add(part);
  for (const b of at("folds").children) b.setAttribute("aria-pressed", folded.has(b.dataset.fold));
  drawPicture();
}
function mark() { for (const n of at("picture").querySelectorAll(".chosen")) n.classList.remove("chosen"); if (chosen) for (const n of at("picture").querySelectorAll(`[data-path="${CSS.escape(chosen)}"]`)) n.classList.add("chosen"); }
function detail(path) {
  chosen = path; mark();
  const own = desk.sliders.filter((s) => s.path.startsWith(`${path}.`) || s.path === path);
  const list = own.map((s) => make("li", { text: `${s.path} = ${shown(values[s.path] ?? s.value)} ${s.unit}${s.error === null ? "" : ` ± ${shown(s.error, 2)}`}; ${s.source || "no source given"}${s.note ? `; ${s.note}` : ""}` }));
  at("detail").replaceChildren(make("strong", { text: path }), own.length ? make("ul", {}, ...list) : make("p", { text: "Its values are derived from others, or zero." }));
  if (own.length) { at("find").value = path; filter(); }
}
function filter() {
  const word = at("find").value.trim().toLowerCase();
  for (const box of document.querySelectorAll(".slider")) box.hidden = word !== "" && !box.dataset.slider.toLowerCase().includes(word);
  for (const group of document.querySelectorAll("#sliders details")) { const some = [...group.querySelectorAll(".slider")].some((b) => !b.hidden); group.hidden = !some; if (word && some) group.open = true; }
}

// ---- what the buttons do
at("undo").addEventListener("click", () => step(done, undone));
at("redo").addEventListener("click", () => step(undone, done));
at("reset").addEventListener("click", () => { remember(); values = {}; after(); });
document.addEventListener("keydown", (e) => { if (!(e.ctrlKey || e.metaKey) || e.target.matches("input[type=text],input[type=search],input[type=number]")) return; if (e.key === "z" && !e.shiftKey) { e.preventDefault(); step(done, undone); } else if (e.key === "y" || (e.key.toLowerCase() === "z" && e.shiftKey)) { e.preventDefault(); step(undone, done); } });
at("find").addEventListener("input", filter);
at("run").addEventListener("change", () => { run = Number(at("run").value); time = null; drawCharts(); drawPicture(); });
at("gas").addEventListener("change", async () => { const asked = at("gas").value, found = await tried(() => ask("/api/curves", { stage, values, gas: asked, measured: true })); if (!found) { at("gas").value = gas; return; } gas = asked; desk.runs = found.runs; drawCharts(); });
at("time").addEventListener("input", () => cursor(Number(at("time").value)));
at("picture").addEventListener("click", (e) => { const part = e.target.closest("[data-part]"), path = e.target.closest("[data-path]"); if (path) detail(path.dataset.path); else if (part) fold(part.dataset.part); });
at("fit").addEventListener("click", () => tried(async () => { const from = values; await begin("/api/fit", { stage, values, free: [...ticked] }, (job) => fitted(job, from)); }));
async function fitted(job, from) {
  remember();
  for (const [path, v] of Object.entries(job.result.values)) { values = { ...values, [path]: v.value }; const s = desk.sliders.find((x) => x.path === path); if (s) s.error = v.error; }
  after();
  const rows = Object.entries(job.result.values).map(([p, v]) => make("li", { text: `${p}: ${shown(v.value)} ± ${shown(v.error, 2)} ${v.unit}` }));
  at("fit-result").replaceChildren(make("h3", { text: `Fitted, ${job.result.evaluations} evaluations, ${shown(job.seconds, 2)} s` }), make("ul", {}, ...rows), ...job.result.warnings.map((w) => make("p", { class: "warning", text: `warning: ${w}` })), make("details", {}, make("summary", { text: "The whole report" }), make("pre", { text: job.result.text, tabindex: "0" })));
}
at("save").addEventListener("submit", (e) => { e.preventDefault(); tried(async () => { const found = await ask("/api/save", { stage, values, name: at("save-name").value }); at("status").textContent = `saved as results/${found.file}`; }); });
at("swap").addEventListener("submit", (e) => { e.preventDefault(); tried(async () => {
  const plan = await ask("/api/swap", { part: at("swap-part").value, deck: at("swap-deck").value });
  const due = new Set(plan.stages.filter((s) => s.action !== "kept").map((s) => s.name));
  project.stages = project.stages.map((s) => (due.has(s.name) ? { ...s, state: "stale", why: `after ${plan.part}: ${plan.old} → ${plan.new}` } : s));
  drawStages();
  at("swap-result").replaceChildren(make("p", { text: `${plan.part}: ${plan.old} → ${plan.new}. ${plan.freed.length} interface values retuned, ${due.size} of ${plan.stages.length} stages due again, ${plan.tests.length} tests to repeat.` }), make("ul", {}, ...plan.stages.map((s) => make("li", { "data-action": s.action, text: `${s.name}: ${s.action}, ${s.why}` }))), make("details", {}, make("summary", { text: "In full" }), make("pre", { text: plan.text, tabindex: "0" })));
}); });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => desk && retrace());
window.addEventListener("error", (e) => studio.errors.push(e.message));
window.addEventListener("unhandledrejection", (e) => studio.errors.push(String(e.reason)));

await tried(async () => {
  await watch(async () => { const ready = [...project.stages].reverse().find((s) => s.state === "done" || s.state === "deck") || project.stages.find((s) => s.state !== "waiting") || project.stages[0]; await open(ready.name); studio.ready = true; });
});
