// The studio's page: opens a stage, changes between its views. Every other module has one purpose of its own.
import { followed, openBench } from "/static/bench.js";
import { drawCharts, move } from "/static/curves.js";
import { ask, at, make, studio, tried } from "/static/page.js";
import { drawPicture, foldAtFirst } from "/static/picture.js";
import { openScenarios, outcome } from "/static/scenario.js";
import { drawSliders } from "/static/sliders.js";
import { drawLevels, drawStages, opensWith, refresh, watch } from "/static/stages.js";
import { s } from "/static/state.js";
import { buttons, fitted, restore, warnings } from "/static/tuning.js";

async function open(name) {
  s.stage = name;
  s.edition = s.editions[name];
  drawStages();
  s.desk = await tried(() => ask(`/api/desk?stage=${encodeURIComponent(name)}`));
  Object.assign(s, { values: {}, done: [], undone: [], run: 0, time: null, window: null, chosen: null, gas: "air" });
  at("gas").value = "air";
  at("fit-result").replaceChildren(); at("detail").replaceChildren(); at("swap-result").replaceChildren();
  at("swap").hidden = s.project.kind === "deck" || !s.desk?.parts.length;
  if (s.desk) { restore(); buttons(); }
  drawLevels();
  for (const id of ["model", "curves", "tuning"]) at(id).hidden = !s.desk;
  at("scenario-run").disabled = !s.desk;
  if (!s.desk) return;
  const { desk, project } = s;
  at("banner").hidden = !desk.synthetic;
  at("banner").textContent = "Synthetic data: no reading here was measured.";
  if (desk.fitted && desk.measured) at("fit-result").replaceChildren(make("h3", { text: "What the stage's fit says" }), ...(desk.warnings.length ? warnings(desk.warnings) : [make("p", { text: "No warning." })]));
  s.ticked = new Set(desk.sliders.filter((x) => x.free).map((x) => x.path));
  at("fit").disabled = !desk.measured;
  at("curves-title").textContent = desk.measured ? "Measured and simulated" : "Simulated";
  at("run").replaceChildren(...desk.runs.map((r, k) => make("option", { value: k, text: r.name })));
  at("swap-part").replaceChildren(...desk.parts.map((p) => make("option", { value: p, text: p })));
  at("swap-deck").replaceChildren(...project.decks.map((d) => make("option", { value: d, text: d })));
  foldAtFirst(); drawSliders(); drawCharts(); drawPicture();
  if (Object.keys(s.values).length) move();
  await openScenarios();
}
opensWith(open);

// decks, logs and campaigns that their author changes: what is shown is opened anew
async function follow() {
  if (!document.hidden && s.stage && s.project.job?.ended !== false) {
    const now = await ask("/api/fresh").catch(() => null); // a studio that was ended states this when something is asked of it
    const other = (name, than) => JSON.stringify(now[name]) !== than;
    if (now && other(s.stage, s.edition)) {
      await refresh();
      await open(s.project.stages.some((x) => x.name === s.stage) ? s.stage : s.project.stages[0].name);
    } else if (now && Object.keys({ ...now, ...s.editions }).some((name) => other(name, s.editions[name]))) await refresh();
  }
  setTimeout(follow, 1000);
}

function view(name) {
  s.view = name;
  for (const b of at("views").querySelectorAll("button")) b.setAttribute("aria-pressed", String(b.dataset.view === name));
  for (const n of ["tune", "scenarios", "bench"]) at(`view-${n}`).hidden = n !== name;
  if (name === "bench") followed();
}
for (const b of at("views").querySelectorAll("button")) b.addEventListener("click", () => view(b.dataset.view));

// stages must have been looked at before one is opened; anything else that runs goes on beside, and is taken up where it stands
await tried(async () => {
  while ((await refresh()) && s.project.job.what === "look") await new Promise((r) => setTimeout(r, 150));
  const { stages, job } = s.project, ready = [...stages].reverse().find((x) => x.state === "done" || x.state === "deck") || stages.find((x) => x.state !== "waiting") || stages[0];
  const log = await openBench();
  await open((job.stage && stages.some((x) => x.name === job.stage) && job.what !== "look" && !job.ended && job.stage) || ready.name);
  if (log) view("bench");
  studio.ready = true;
  if (job.what !== "look" && !job.ended) { if (job.what === "scenario") view("scenarios"); await watch({ fit: fitted, scenario: outcome, run: () => open(s.stage) }[job.what]); }
});
follow();
