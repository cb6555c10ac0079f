// Bench: a log that grows is followed, held against a rule of stability, and its end forecast or declined.
import { Chart } from "/static/chart.js";
import { ask, at, colour, dash, hour, hours, legend, make, nice, shown, studio, tried, wrong } from "/static/page.js";
import { s } from "/static/state.js";

const chart = new Chart(at("bench-chart"), { x: "time [h]", y: "temperature [°C]" }, () => {}, () => look(true));
const WORDS = { stop: ["✓ stop now", "stable"], wait: ["… wait", "too early"], declined: ["? no stop advised", "cannot tell"] };
const MARKS = { stable: "✓", "not stable": "✗", "cannot tell": "?", "too early": "…", reference: "=" };
let found = null, focus = "", timer = 0, busy = false, again = false, open = false;

// asked once: whether a log was named on the command line, and what may be opened
export async function openBench() {
  const told = await tried(() => ask("/api/logs"));
  if (!told) return false;
  at("logs").replaceChildren(...told.logs.map((name) => make("option", { value: name })));
  at("rule").replaceChildren(...told.rules.map((r) => make("option", { value: r.name, text: `${r.name}: ${r.source}${r.mark === "memory" ? ", from memory" : ""}` })), make("option", { value: "own", text: "one of your own …" }));
  at("log").placeholder = told.given ? told.given : told.logs.length ? "choose a log of the project" : "no log lies in the project";
  open = Boolean(told.given);
  return open;
}
export function followed() { clearTimeout(timer); if (open && s.view === "bench") look(true); }

function asked(fresh) {
  const number = (id) => (at(id).value === "" ? null : Number(at(id).value));
  return { file: at("log").value, rule: at("rule").value === "own" ? at("own-rule").value : at("rule").value, since: number("since"), slowest: number("slowest"), reference: at("reference").value, channel: focus, boundaries: at("watch-boundaries").value, within: number("watch-within"), window: chart.zoom && chart.zoom.map((h) => h * 3600), known: fresh ? "" : found?.known ?? "" };
}
async function look(fresh) {
  if (busy) { again = again || fresh; return; }
  busy = true; clearTimeout(timer);
  let told = null;
  try { told = await ask("/api/bench", asked(fresh)); if (fresh) wrong(null); } catch (error) { wrong(error); }
  busy = false;
  if (told?.same) { found.age = told.age; beat(); } else if (told?.waiting) wait(told); else if (told) { found = told; show(); studio.looks = (studio.looks || 0) + 1; }
  if (again) { again = false; look(true); return; }
  // a long log takes longer to read, and is asked for less often
  if (told && s.view === "bench" && at("follow").checked) timer = setTimeout(() => look(false), Math.max(1000, 2000 * (told.seconds || 0)));
}
function wait(told) { found = null; at("bench-verdict").replaceChildren(make("p", { class: "verdict", "data-word": "too early" }, make("strong", { text: "… waiting" }), make("span", { text: ` ${told.waiting}` }))); at("bench-watch").replaceChildren(); at("bench-result").hidden = true; }
function beat() {
  const quiet = found.age > Math.max(10, 3 * found.step);
  at("bench-title").textContent = `${found.file}: ${found.rows} rows over ${hour(found.end - found.begin)}; ${quiet ? `has not grown for ${found.age < 120 ? `${Math.round(found.age)} s` : `${shown(found.age / 60, 3)} min`}` : "growing"}`;
  at("bench-title").dataset.quiet = quiet;
}
function forecastWords(c) {
  const f = c.forecast;
  if (!f) return "";
  const holds = f.holds === null || f.holds === undefined ? "" : f.holds <= found.end ? "; the rule holds by now" : `; the rule holds about ${hour(f.holds)}${f.late ? `, with 95 % by ${hour(f.late)}` : ""}`;
  return f.final === null ? `declined: ${nice(f.declined)}${holds}` : `${f.final.toFixed(2)} °C, ${f.level || 95} % from ${f.low.toFixed(2)} to ${f.high.toFixed(2)}${holds}`;
}
function endWords(c) {
  const f = c.forecast, at_ = f?.at ?? found.forecast_at, when = at_ < found.end ? ` (from the readings to ${hour(at_)})` : "";
  if (!f) return "";
  return f.final === null ? `Where ${c.name} will end is not said yet${when}: ${nice(f.declined)}` : `${c.name} will end at ${forecastWords(c)}${when}.`;
}
function show() {
  at("bench-result").hidden = false;
  beat();
  found.channels.forEach(foreseen);
  const { verdict, channels } = found, own = channels.find((c) => c.name === focus) || channels.find((c) => c.name === found.slowest) || channels[0];
  at("bench-verdict").replaceChildren(make("p", { class: "verdict", "data-word": verdict.word }, make("strong", { text: `${MARKS[verdict.word]} ${verdict.word}` }), make("span", { text: ` ${nice(verdict.text)}` }), make("br"), make("span", { text: endWords(own) })));
  watched(found.watch);
  fillOnce(at("reference"), [["", "none"], ...channels.map((c) => [c.name, c.name])]);
  fillOnce(at("bench-focus"), [["", "the slowest"], ...channels.map((c) => [c.name, c.name])]);
  at("channels").tBodies[0].replaceChildren(...channels.map((c) => make("tr", { "data-channel": c.name }, make("th", { scope: "row", text: c.name }), make("td", { class: "num", text: c.latest === null ? "–" : c.latest.toFixed(2) }),
    make("td", { class: "num", text: c.rate === null ? "–" : `${c.rate >= 0 ? "+" : ""}${c.rate.toFixed(2)} ± ${c.error.toFixed(2)}` }), make("td", { text: `${MARKS[c.verdict]} ${c.verdict}${c.since === null ? "" : ` since ${hour(c.since)}`}${c.why ? `: ${c.why}` : ""}` }),
    make("td", { class: "num", text: c.forecast && c.forecast.final !== null ? `${c.forecast.final.toFixed(2)} (${c.forecast.low.toFixed(2)} to ${c.forecast.high.toFixed(2)})` : c.forecast ? "declined" : "–", title: forecastWords(c) }), make("td", { text: gapWords(c) }))));
  at("declined").replaceChildren(...channels.filter((c) => c.forecast && c.forecast.final === null && !c.forecast.open).map((c) => make("li", { text: `${c.name}: ${nice(c.forecast.declined)}` })));
  at("declined").parentElement.hidden = !at("declined").children.length;
  at("bench-notes").replaceChildren(...[found.synthetic ? "Synthetic data: no reading here was measured." : "", ...found.notes].filter(Boolean).map((n) => make("li", { text: n })));
  const names = channels.map((c) => c.name);
  if (at("bench-legend").dataset.names !== names.join("\n")) { at("bench-legend").dataset.names = names.join("\n"); legend(at("bench-legend"), names, [chart]); }
  draw(own);
}
// where the model ends a channel takes the place of where the readings alone do
function foreseen(c) {
  const w = found.watch, e = w.model && w.ends?.[c.name];
  if (e) c.forecast = { declined: e.declined || "", final: e.final_C, low: e.interval_C[0], high: e.interval_C[1], holds: e.holds, late: null, at: e.now, level: (100 * e.level).toFixed(2) };
}
// what thermid watch prints: alarms first, then the advice, nodes without a sensor, what is assumed
function watched(w) {
  const [word, mark] = WORDS[w.advice], nodes = Object.entries(w.nodes || {}).filter(([, n]) => !n.measured);
  const alarms = w.alarms.map((a) => make("p", { class: "verdict", "data-word": "not stable" }, make("strong", { text: `✗ ALARM ${a.kind}: ${a.suspect}` }), make("span", { text: ` ${nice(a.because)}` })));
  const unseen = nodes.map(([name, n]) => `${name} (not measured) ${n.value_C.toFixed(2)} ± ${n.half_K.toFixed(2)} °C`);
  const lines = [...unseen, w.assumed.length ? `Assumed: ${w.assumed.map(nice).join("; ")}.` : "", w.unused ? `${nice(w.unused)}.` : ""].filter(Boolean);
  at("bench-watch").replaceChildren(...alarms, make("p", { class: "verdict", "data-word": mark }, make("strong", { text: word }), make("span", { text: ` ${nice(w.because)}${w.model ? ` Model: ${w.model}${w.like ? `, columns as in record ${w.like}` : ""}.` : ""}` })), ...lines.map((text) => make("p", { class: "soft", text })));
}
function gapWords(c) {
  const by = {};
  for (const g of c.gaps) by[g.why] = (by[g.why] || 0) + Math.max(g.count, 1);
  return Object.entries(by).map(([why, n]) => `${n} × ${why}`).join(", ");
}
// the choice stays while rows are added; it is made anew only when the channels are others
function fillOnce(select, options) {
  const names = options.map((o) => o[0]).join("\n"), kept = select.value;
  if (select.dataset.names === names) return;
  select.dataset.names = names;
  select.replaceChildren(...options.map(([value, text]) => make("option", { value, text })));
  if (options.some((o) => o[0] === kept)) select.value = kept;
}
function draw(own) {
  const marks = { gaps: [], ends: [], values: [] }, series = [];
  found.channels.forEach((c, k) => {
    series.push({ name: c.name, x: hours(c.times), y: c.values, kind: "line", colour: colour(k), dash: c.name === found.reference ? [6, 4] : dash(k), wide: c === own && found.channels.length > 1 });
    if (!chart.hidden.has(c.name)) marks.gaps.push(...c.gaps.map((g) => [g.from / 3600, g.to / 3600]));
  });
  const f = own?.forecast;
  if (f && f.final !== null && !chart.zoom && !chart.hidden.has(own.name)) {
    const span = (found.end - found.begin) / 3600, x = found.end / 3600 + 0.12 * span;
    marks.ends.push({ x, from: found.end / 3600, value: f.final, low: f.low, high: f.high, colour: colour(found.channels.indexOf(own)), label: `${own.name} ends at ${f.final.toFixed(1)} °C (${f.low.toFixed(1)} to ${f.high.toFixed(1)})` });
    marks.values.push(f.low, f.high); marks.until = x + 0.03 * span;
  }
  chart.set(series, marks);
}

at("bench-form").addEventListener("submit", (e) => { e.preventDefault(); open = true; found = null; focus = ""; at("bench-focus").value = ""; chart.zoom = null; look(true); });
at("rule").addEventListener("change", () => { at("own-rule").parentElement.hidden = at("rule").value !== "own"; if (open && (at("rule").value !== "own" || at("own-rule").value)) look(true); });
for (const id of ["since", "slowest", "reference", "own-rule", "watch-boundaries", "watch-within"]) at(id).addEventListener("change", () => open && look(true));
at("bench-focus").addEventListener("change", () => { focus = at("bench-focus").value; if (open) look(true); });
at("follow").addEventListener("change", () => followed());
document.addEventListener("recolour", () => { if (found) { at("bench-legend").dataset.names = ""; show(); } });
