// The strip of stages, what a stage takes and hands on, jobs that run and their progress, swaps.
import { ask, at, hour, make, nice, shown, tried, wrong } from "/static/page.js";
import { forget, s } from "/static/state.js";

const SAYS = { new: "not run yet", stale: "stale: run again", waiting: "waits for one below" };
const MANY = 14; // stages beyond which the strip is one line with a search
let drawn = "";
let open = async () => {};
export function opensWith(f) { open = f; }

export function drawStages() {
  const list = at("stages"), job = s.project.job, held = document.activeElement?.dataset.stage, many = s.project.stages.length > MANY;
  const word = at("find-stage").value.trim().toLowerCase();
  list.hidden = s.project.kind === "deck";
  list.classList.toggle("many", many);
  at("stage-tools").hidden = !many;
  const seen = s.project.stages.filter((x) => !many || x.name === s.stage || x.name.toLowerCase().includes(word) || x.state === word || x.standing === word);
  const counts = Object.entries(Object.groupBy ? Object.groupBy(s.project.stages, (x) => x.standing || x.state) : {}).map(([k, v]) => `${v.length} ${k}`).join(", ");
  at("stage-count").textContent = `${s.project.stages.length} stages: ${counts}${word ? `; ${seen.length} shown` : ""}`;
  list.replaceChildren(...seen.map((x) => {
    const running = job && !job.ended && job.what === "run" && job.stage === x.name, state = running ? "running" : x.state;
    const says = state === "done" && x.standing ? `${x.usable ? "?" : "✗"} ${x.told.stage !== x.name ? `RESTS ON ${x.told.stage}: ` : ""}${x.standing.toUpperCase()}${x.told.accepted ? " (accepted)" : ""}` : state === "done" && x.open ? "? NOT JUDGED" : state === "done" && !Object.keys(x.sensors).length ? "values by hand" : state === "done" ? `RMSE to ${shown(Math.max(...Object.values(x.sensors), 0), 2)} K` : (!running && x.says) || SAYS[state] || state;
    return make("li", {}, make("button", { type: "button", "data-stage": x.name, "data-state": state, "data-standing": (state === "done" && x.standing) || false, "data-open": (state === "done" && !x.standing && Boolean(x.open)) || false, "data-rests": (state === "done" && x.standing && x.told.stage !== x.name) || false, "aria-current": x.name === s.stage ? "true" : "false", title: x.because || x.open || x.why || state, onclick: () => open(x.name) }, make("span", { text: x.name }), make("small", { text: says })));
  }));
  const current = list.querySelector("[aria-current=true]");
  if (many && current && drawn !== s.stage) { drawn = s.stage; list.scrollLeft = current.parentElement.offsetLeft - list.clientWidth / 2; }
  if (held) list.querySelector(`[data-stage="${CSS.escape(held)}"]`)?.focus();
}
at("find-stage").addEventListener("input", drawStages);

// a standing as the studio writes it, as tiles have it: empty where there is nothing to be told
export const told = ({ state, because }) => ({ standing: ["credible", "unjudged"].includes(state) ? "" : state, because, usable: !["not credible", "failed"].includes(state) });
// how loud the standing of a stage is said
export const mark = (state) => (!state?.standing ? "" : state.usable ? "not decided" : "passed a limit");

export function drawLevels() {
  const state = s.project.stages.find((x) => x.name === s.stage), box = at("stage-detail");
  box.replaceChildren();
  box.hidden = at("levels").hidden = !state || s.project.kind === "deck";
  if (box.hidden) return;
  const above = s.project.stages.filter((x) => x.below.includes(s.stage)).map((x) => x.name);
  const undone = state.below.filter((n) => s.project.stages.find((x) => x.name === n)?.state !== "done");
  box.append(make("button", { type: "button", id: "run-stage", text: `Run ${s.stage}${undone.length ? ` and ${undone.join(", ")} below it` : state.state === "done" ? " again" : ""}`, onclick: () => tried(() => { forget(s.stage); return begin("/api/run", { stage: s.stage, below: true }); }) }));
  box.append(make("span", { class: "soft grow", text: nice(`${state.state === "done" ? (state.usable ? "Done" : "Done, but do not use its values") : state.state === "new" ? "Not run yet" : state.state === "waiting" ? "Not run yet" : state.state === "failed" ? "Failed" : `${state.state[0].toUpperCase()}${state.state.slice(1)}: ${state.why}`}. ` + (state.below.length ? `Takes values of ${state.below.join(", ")}; ` : "Takes values of no other stage; ") + (above.length ? `hands its own to ${above.join(", ")}.` : "hands its own to none.")) }));
  if (state.standing) box.append(make("p", { class: "verdict", "data-word": mark(state) }, make("strong", { text: `${state.usable ? "?" : "✗"} ` }), make("span", { text: nice(`${state.because}.`) })));
  if (!state.standing && state.open) box.append(make("p", { class: "verdict", "data-word": "not decided" }, make("strong", { text: "? not judged " }), make("span", { text: nice(`${state.open}.`) })));
  for (const v of state.verdicts) box.append(make("details", { class: "detail judged", "data-verdict": v.record }, make("summary", { text: nice(v.text.split("\n")[0]) }), make("pre", { text: nice(v.text), tabindex: "0" })));
  const { heads, rows } = s.project.table, kind = (k) => (k > 2 ? "num" : "text");
  at("table").tHead.replaceChildren(make("tr", {}, ...heads.map((n, k) => make("th", { scope: "col", class: kind(k), text: n }))));
  at("table").tBodies[0].replaceChildren(...rows.map((cells) => make("tr", {}, ...cells.map(([text, look], k) => make(k ? "td" : "th", { scope: k ? false : "row", class: `${kind(k)} ${look}`, text })))));
  at("table").parentElement.hidden = !rows.length;
  at("levels").hidden = !rows.length && at("swap").hidden;
}

const DOING = { look: "looking at", fit: "fitting", run: "running", scenario: "running a scenario on" };
export async function refresh() {
  const found = await ask("/api/project");
  const changed = !s.project || JSON.stringify(found.stages) !== JSON.stringify(s.project.stages);
  s.project = found;
  s.editions = Object.fromEntries(found.stages.map((x) => [x.name, JSON.stringify([x.state, x.edition])])); // as the studio told them; what a swap would make of them is marked on the page alone
  at("title").textContent = found.title;
  at("note").textContent = [found.file, found.note].filter(Boolean).join(" — ");
  document.title = `${found.title} · thermid studio`;
  const job = found.job, running = job && job.ended === false;
  const far = job.what === "scenario" ? (job.share < 1 ? `, ${hour(job.reached)} simulated, ${Math.round(100 * job.share)} % of its steps` : ", all its steps; humidity, limits and margins") : job.evaluations ? `, evaluation ${job.evaluations}, weighted RMS ${shown(job.rms, 3)}` : "";
  at("status").textContent = running ? `${DOING[job.what]} ${job.stage}${far}` : "";
  at("stop").hidden = !running || job.what === "look";
  at("progress").hidden = !(running && job.what === "scenario");
  if (job.share < 1) at("progress").value = job.share; else at("progress").removeAttribute("value");
  for (const b of [at("swap").querySelector("button"), at("run-stage")]) if (b) b.disabled = running;
  at("fit").disabled = running || !s.desk || !s.desk.measured;
  at("scenario-run").disabled = running || !s.desk;
  drawStages();
  if (changed) drawLevels();
  return running;
}
export async function watch(after) {
  const running = await refresh();
  if (running) { setTimeout(() => tried(() => watch(after)), 150); return; }
  if (s.project.job?.error && s.project.job.what !== "look") { wrong(s.project.job.error); if (s.project.job.what === "scenario") at("verdict").replaceChildren(); }
  else if (after) await after(s.project.job);
}
export async function begin(path, body, after) {
  await ask(path, body);
  await watch(after || (async () => { if (body.stage === s.stage) await open(s.stage); }));
}
// what another tab has begun or ended shows when this one is looked at
let looking = false;
window.addEventListener("focus", async () => {
  if (!s.stage || looking) return;
  looking = true;
  try { while (await refresh()) await new Promise((r) => setTimeout(r, 500)); } catch (error) { wrong(error); }
  looking = false;
});
at("stop").addEventListener("click", () => tried(async () => { await ask("/api/stop", {}); }));

at("swap").addEventListener("submit", (e) => { e.preventDefault(); tried(async () => {
  at("swap-result").replaceChildren(make("p", { class: "soft", text: "Working it out …" }));
  const plan = await ask("/api/swap", { part: at("swap-part").value, deck: at("swap-deck").value }).catch((error) => { at("swap-result").replaceChildren(); throw error; });
  const due = new Set(plan.stages.filter((x) => x.action !== "kept").map((x) => x.name));
  s.project.stages = s.project.stages.map((x) => (due.has(x.name) ? { ...x, state: "stale", says: "due after the swap", why: `after ${plan.part}: ${plan.old} → ${plan.new}` } : x));
  drawStages();
  const doubts = s.project.stages.filter((x) => x.standing).map((x) => make("p", { class: "warning", text: nice(`${x.name}: ${x.because}.`) }));
  at("swap-result").replaceChildren(...doubts, make("p", { text: `${plan.part}: ${plan.old} → ${plan.new}. ${plan.freed.length} interface values retuned, ${due.size} of ${plan.stages.length} stages due again, ${plan.tests.length} tests to repeat.` }), make("ul", {}, ...plan.stages.map((x) => make("li", { "data-action": x.action, text: nice(`${x.name}: ${x.action}, ${x.why}`) }))), make("details", {}, make("summary", { text: "In full" }), make("pre", { text: nice(plan.text), tabindex: "0" })));
}); });
