// Scenarios: choose what is run, run it with progress, see limits and margins on the curves, the worst part and time in words.
import { Chart } from "/static/chart.js";
import { PHASES, swatch } from "/static/marks.js";
import { ask, at, colour, dash, hour, hours, legend, make, nice, row, shown, studio, tried, wrong } from "/static/page.js";
import { begin } from "/static/stages.js";
import { s } from "/static/state.js";

const chart = new Chart(at("scenario-chart"), { x: "time [h]", y: "temperature [°C]" }, () => {}, look);
let shelf = null, found = null, asking = 0, describing = 0, renew = false;

export async function openScenarios() {
  shelf = await tried(() => ask(`/api/shelf?stage=${encodeURIComponent(s.stage)}`));
  if (!shelf) return;
  const groups = new Map(), before = at("course").value;
  for (const c of shelf.courses) groups.set(c.group, [...(groups.get(c.group) || []), c]);
  at("course").replaceChildren(...[...groups].map(([name, list]) => make("optgroup", { label: name }, ...list.map((c) => make("option", { value: c.key, text: c.title })))));
  if (shelf.courses.some((c) => c.key === before)) at("course").value = before;
  at("chamber").replaceChildren(...shelf.boundaries.map((b) => { const box = make("input", { type: "checkbox", value: b }); box.checked = true; return make("label", {}, box, ` ${b}`); }));
  at("base").replaceChildren(make("option", { value: "", text: "the chamber's" }), ...shelf.nodes.map((n) => make("option", { value: n, text: `at ${n}` })));
  at("limits-known").textContent = shelf.limits.length ? `Limits of ${shelf.limits.join(", ")} from ${shelf.source}.` : "No limits are kept beside this deck for its nodes. A file with a table per reference point (node, operating, non_operating, start_up) is found in its folder, the folders in it, or the one above.";
  await describe();
}
const chosen = () => shelf?.courses.find((c) => c.key === at("course").value);
function asked() {
  const ends = ["lowest", "highest"].map((id) => (at(id).value === "" ? null : Number(at(id).value)));
  const texts = Object.fromEntries([...at("numbers").querySelectorAll("input")].filter((i) => i.value.trim()).map((i) => [i.dataset.number, i.value]));
  const chamber = [...at("chamber").querySelectorAll("input:checked")].map((i) => i.value);
  return { stage: s.stage, course: at("course").value, values: s.values, lowest: ends[0], highest: ends[1], numbers: texts, chamber, base: at("base").value, gas: at("scenario-gas").value, state: at("state").value, uncertain: at("uncertain").checked && !at("uncertain").parentElement.hidden };
}

const LEVELS = ["hot", "cold", "cycles", "dwell", "ramp", "stable"];
const plain = (text) => (text || "not given").replace(/ \[.*\]$/, "");
const written = (text) => nice(text.replace(/ \[1\]/, "").replace(/\[([^\]]*)\]/g, "$1")); // as decks write them: 3 [K/min]
const UNITS = { hot: "°C", cold: "°C", dwell: "h", ramp: "K/min" };
// answers may come in another order than their questions: the last question counts, and what a lost one would have drawn anew is drawn then
async function describe(fresh = true) {
  const mine = ++describing;
  renew = renew || fresh;
  const course = chosen(), profile = course?.kind === "profile";
  for (const n of document.querySelectorAll("#scenario-form [data-for]")) n.hidden = !n.dataset.for.split(" ").includes(course?.kind);
  if (!shelf.fitted || !shelf.limits.length) at("uncertain").parentElement.hidden = true;
  if (fresh) { at("numbers").replaceChildren(); for (const id of ["lowest", "highest"]) at(id).value = ""; }
  if (!profile) { at("profile-numbers").replaceChildren(); return; }
  const told = await tried(() => ask("/api/profile", asked()));
  if (!told || mine !== describing) return;
  if (renew) at("numbers").replaceChildren(...LEVELS.filter((n) => n in told.numbers || n === "hot" || n === "cold").filter((n) => told.kind !== "humidity" || n in told.numbers).map((n) => make("label", {}, `${n}${UNITS[n] ? ` [${UNITS[n]}]` : ""} `, make("input", { type: "text", "data-number": n, autocomplete: "off", onchange: () => describe(false) }))));
  renew = false;
  for (const i of at("numbers").querySelectorAll("input")) i.placeholder = plain(told.numbers[i.dataset.number]?.text);
  const lines = Object.entries(told.numbers).map(([n, v]) => make("tr", {}, make("th", { scope: "row", text: n }), make("td", { text: written(v.text) }), make("td", { text: v.mark }), make("td", { text: [v.clause, v.note].filter(Boolean).join("; ") })));
  at("profile-numbers").replaceChildren(
    make("p", { text: [told.lacking && `Not complete: ${told.lacking}`, told.trust, told.note].filter(Boolean).join(" — ") }), ...told.remarks.map((r) => make("p", { class: "warning", text: nice(r) })),
    make("details", {}, make("summary", { text: `Its numbers, with clauses${told.steps ? `; ${told.steps} steps` : ""}` }), make("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": "Numbers of the profile" }, make("table", {}, make("thead", {}, make("tr", {}, ...["Number", "Value", "Known how", "Where"].map((t) => make("th", { scope: "col", text: t })))), make("tbody", {}, ...lines)))));
}
at("course").addEventListener("change", () => describe());
for (const id of ["lowest", "highest"]) at(id).addEventListener("change", () => { if ((at("lowest").value === "") === (at("highest").value === "")) describe(false); });

at("scenario-form").addEventListener("submit", (e) => { e.preventDefault(); tried(async () => {
  wrong(null); at("verdict").replaceChildren(make("p", { class: "soft", text: "Running …" }));
  try { await begin("/api/scenario", asked(), outcome); } catch (error) { at("verdict").replaceChildren(); throw error; }
}); });

export async function outcome() {
  found = await ask("/api/outcome", { window: null });
  chart.zoom = null; chart.hidden.clear();
  const points = found.points.map((p) => p.point), worst = found.worst?.point;
  at("focus").replaceChildren(...points.map((p) => make("option", { value: p, text: p === worst ? `${p} (nearest to its limit)` : p })), make("option", { value: "", text: "no limits" }));
  at("focus").value = worst ?? "";
  at("scenario-result").hidden = false;
  words(); draw();
  studio.outcomes = (studio.outcomes || 0) + 1;
}
// a window is asked for again, so that what is shown of it is every sample that lies in it
async function look(w) {
  const mine = ++asking, part = await tried(() => ask("/api/outcome", { window: w && [w[0] * 3600, w[1] * 3600] }));
  if (part && mine === asking) { found.curves = part.curves; found.moisture = part.moisture; draw(); }
}

const MARKS = { kept: "✓", "passed a limit": "✗", "margin not met": "✗", "not met": "✗", "not decided": "?", open: "–" };
function words() {
  at("verdict").replaceChildren(make("p", { class: "verdict", "data-word": found.verdict.word }, make("strong", { text: `${MARKS[found.verdict.word]} ${found.verdict.word}` }), make("span", { text: ` ${nice(found.verdict.text)}` })));
  const long = `${hour(found.duration)}${found.waited === null ? "" : `, of it ${hour(found.waited)} waiting for the unit`}`;
  at("scenario-title").textContent = `${found.title}: ${long}`;
  at("checks").tBodies[0].replaceChildren(...[...found.checks].sort((a, b) => (a.room ?? 1e9) - (b.room ?? 1e9)).map((c) => make("tr", { "data-check": c.point, "data-bad": c.crossings.length > 0 }, make("th", { scope: "row", text: c.point }), make("td", { text: c.state + (c.why ? ` (not decided: ${c.why})` : "") }),
    ...[c.lowest, c.highest].map((v) => make("td", { class: "num", text: v.toFixed(1) })), make("td", { class: "num", text: c.limits.map((v) => (v === null ? "–" : shown(v, 5))).join(" to ") }),
    make("td", { class: "num", text: c.room === null ? "–" : `${c.crossings.length ? "✗ " : ""}${c.room.toFixed(1)}` }), make("td", { class: "num", text: shown(c.time / 3600, 3) }))));
  at("checks").parentElement.hidden = !found.checks.length;
  at("margins").tBodies[0].replaceChildren(...found.margins.map((m) => row(m.point, `${m.side}, ${m.state}`, m.predicted, m.uncertainty, m.added, shown(m.limit, 5), `${m.passed === false ? "✗ " : m.passed === null ? "? " : ""}${m.margin.toFixed(1)}`)));
  at("margins").parentElement.hidden = !found.margins.length;
  at("margins").caption.textContent = found.margins.length ? `Margins [K] by ${found.margins[0].policy}: limit less predicted, less uncertainty (95 %), less what the policy adds` : "";
  const wet = found.moisture?.surfaces || [];
  at("moisture").tBodies[0].replaceChildren(...wet.map((w) => row(w.surface, w.margin, w.time / 3600, w.condensing / 3600, w.film)));
  at("moisture").parentElement.hidden = !wet.length;
  at("scenario-remarks").replaceChildren(...[found.trust, ...found.remarks].filter(Boolean).map((r) => make("li", { text: nice(r) })));
  const soft = getComputedStyle(document.body).getPropertyValue("--soft"), kinds = Object.keys(PHASES).filter((k) => found.phases.some((p) => p.kind === k));
  at("phases").replaceChildren(...kinds.map((k) => make("span", {}, swatch(k, soft), ` ${PHASES[k]}`)), ...(found.points.length ? [make("span", { text: "limits: —— operating, - - non-operating, ··· start-up" })] : []));
  at("phase-list").replaceChildren(...found.phases.map((p) => make("li", { text: `${hour(p.from)}: ${p.name}${p.cycle ? `, cycle ${p.cycle}` : ""}, ${PHASES[p.kind]}, ${hour(p.to - p.from)}${p.slowest ? `; slowest ${p.slowest} by '${p.rule}'` : ""}` })));
  at("phase-list").parentElement.hidden = !found.phases.length;
  legend(at("scenario-legend"), [...found.curves.map((c) => c.name), ...(found.moisture?.dew || []).map((d) => d.name)], [chart]);
  at("scenario-shown").textContent = found.curves.length < found.nodes ? `${found.curves.length} of ${found.nodes} nodes: those with limits, then the widest swings` : "";
}

function draw() {
  const focus = found.points.find((p) => p.point === at("focus").value), series = [], marks = { phases: found.phases.map((p) => ({ ...p, from: p.from / 3600, to: p.to / 3600 })), limits: [], levels: [], flags: [], bands: [], values: [] };
  found.curves.forEach((c, k) => {
    const own = focus && c.name === focus.node, look = { name: c.name, x: hours(c.times), y: c.values, kind: "line", colour: colour(k), dash: c.chamber ? [6, 4] : dash(k) };
    series.push({ ...look, wide: own, thin: focus && !own && !c.chamber, faint: focus && !own });
    if (c.band && (!focus || own)) marks.bands.push({ x: hours(c.band_times), y: c.band_values, half: c.band, colour: colour(k) });
  });
  (found.moisture?.dew || []).forEach((d, k) => series.push({ name: d.name, x: hours(d.times), y: d.values, kind: "dots", colour: colour(found.curves.length + k) }));
  series.sort((a, b) => (a.wide || 0) - (b.wide || 0));
  const said = new Set();
  for (const span of focus?.spans || []) span.limits.forEach((v, k) => {
    if (v === null) return;
    const side = k ? "upper" : "lower", key = `${span.state} ${side}`;
    marks.limits.push({ value: v, side, state: span.state, from: span.from / 3600, to: span.to / 3600, label: said.has(key) ? "" : `${span.state} ${k ? "≤" : "≥"} ${shown(v, 5)} °C` });
    said.add(key); marks.values.push(v);
  });
  if (!focus) for (const l of found.levels) { marks.levels.push({ value: l.value, label: `${l.name} ${l.value.toFixed(1)} °C` }); marks.values.push(l.value); }
  const own = found.checks.filter((c) => focus && c.point === focus.point && c.room !== null).sort((a, b) => a.room - b.room)[0];
  if (own) marks.flags.push({ x: own.time / 3600, y: own.value, bad: own.passed === false, text: `${own.room < 0 ? `${(-own.room).toFixed(1)} K beyond` : `${own.room.toFixed(1)} K left`}${own.why ? ", not decided" : ""}` });
  chart.set(series, marks);
}
at("focus").addEventListener("change", () => found && draw());
document.addEventListener("recolour", () => { if (found) { words(); draw(); } });
