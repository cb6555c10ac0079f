// What the buttons of tuning do: fit, undo, redo, reset, save.
import { move } from "/static/curves.js";
import { ask, at, make, nice, shown, studio, tried, unitOf } from "/static/page.js";
import { drawPicture } from "/static/picture.js";
import { drawSliders, slidersTell } from "/static/sliders.js";
import { begin, told } from "/static/stages.js";
import { keep, kept, s } from "/static/state.js";

export function buttons() { if (s.desk?.title === s.stage) keep(s.stage, s); at("undo").disabled = !s.done.length; at("redo").disabled = !s.undone.length; at("reset").disabled = !Object.keys(s.values).length; }
export function restore() {
  const found = kept(s.stage), known = new Set([...s.desk.sliders.map((x) => x.path), ...s.desk.others]);
  if ([found.values, ...found.done, ...found.undone].every((values) => Object.keys(values).every((path) => known.has(path)))) Object.assign(s, found);
}
function remember() { s.done.push(s.values); s.undone = []; buttons(); }
function step(from, to) { if (!from.length) return; to.push(s.values); s.values = from.pop(); after(); }
function after() { buttons(); drawSliders(); studio.begun = performance.now(); move(); drawPicture(); }
slidersTell(() => { buttons(); move(); }, remember, drawPicture);

at("undo").addEventListener("click", () => step(s.done, s.undone));
at("redo").addEventListener("click", () => step(s.undone, s.done));
at("reset").addEventListener("click", () => { remember(); s.values = {}; after(); });
document.addEventListener("keydown", (e) => { if (!(e.ctrlKey || e.metaKey) || e.target.matches("input[type=text],input[type=search],input[type=number]")) return; if (e.key === "z" && !e.shiftKey) { e.preventDefault(); step(s.done, s.undone); } else if (e.key === "y" || (e.key.toLowerCase() === "z" && e.shiftKey)) { e.preventDefault(); step(s.undone, s.done); } });

at("fit").addEventListener("click", () => tried(async () => { await begin("/api/fit", { stage: s.stage, values: s.values, free: [...s.ticked] }, fitted); }));
export async function fitted(job) {
  // errors of sensors, starts and powers belong to the fit as its parameters do: without them its curves are not its own
  const values = { ...Object.fromEntries(Object.entries(job.result.values).map(([path, v]) => [path, v.value])), ...job.result.others };
  if (job.stage !== s.stage) { // another was opened meanwhile: it lies there when its stage is opened again
    const there = kept(job.stage);
    keep(job.stage, { values: { ...there.values, ...values }, done: [...there.done, there.values], undone: [] });
    at("status").textContent = `the fit of ${job.stage} has ended; open it to see`;
    return;
  }
  remember();
  s.values = { ...s.values, ...values };
  for (const [path, v] of Object.entries(job.result.values)) { const x = s.desk.sliders.find((y) => y.path === path); if (x) Object.assign(x, { error: v.error, found: v.value }); }
  after();
  const rows = Object.entries(job.result.values).map(([p, v]) => make("li", { text: `${p}: ${shown(v.value)} ± ${shown(v.error, 2)} ${unitOf(v)}` }));
  const { standing, because } = told(job.result.standing), loud = standing && !job.result.warnings.some((w) => w.includes(because)) ? [`${standing.toUpperCase()}: ${because}`] : [];
  at("fit-result").replaceChildren(make("h3", { text: `Fitted, ${job.result.evaluations} evaluations, ${shown(job.seconds, 2)} s` }), make("ul", {}, ...rows), ...warnings([...loud, ...job.result.warnings]), make("details", {}, make("summary", { text: "The whole report" }), make("pre", { text: nice(job.result.text), tabindex: "0" })));
}
export const warnings = (list) => list.map((w) => make("p", { class: "warning", text: `warning: ${nice(w)}` }));
// the difference is seen before anything is written, and what is written is what was seen
at("write-back").addEventListener("click", () => tried(async () => {
  const body = { stage: s.stage, values: s.values }, { diff } = await ask("/api/difference", body), close = () => at("fit-result").replaceChildren();
  const write = make("button", { type: "button", id: "write-now", text: "Write", onclick: () => tried(async () => { const found = await ask("/api/write", { ...body, diff }); close(); at("status").textContent = `written: ${found.file}`; }) });
  at("fit-result").replaceChildren(make("h3", { text: "What is changed in the deck" }), make("pre", { class: "diff", text: diff, tabindex: "0" }), make("div", { class: "bar" }, write, make("button", { type: "button", text: "Cancel", onclick: close })));
  write.focus();
}));
at("save").addEventListener("submit", (e) => { e.preventDefault(); tried(async () => { const found = await ask("/api/save", { stage: s.stage, values: s.values, name: at("save-name").value }); at("status").textContent = `saved as results/${found.file}`; }); });
