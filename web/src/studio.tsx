// The page of a project: its stages, and one of three views on the one that is open.
import { render } from "preact";
import { useEffect } from "preact/hooks";
import { Correlate } from "./correlate";
import { hour } from "./plot";
import { nice, shown } from "./server";
import { error } from "./state";
import { Stages } from "./stages";
import { desk, follow, open, project, redo, refresh, status, stop, studio, tried, undo, view, watch } from "./project";
import { Scenarios } from "./scenarios";
import { Watch, known } from "./watch";

const VIEWS = ["correlate", "scenarios", "watch"] as const, DOING: Record<string, string> = { look: "looking at", fit: "fitting", run: "running", scenario: "running a scenario on" };

function Doing() {
  const job = project.value!.job;
  if (job.ended !== false) return <p id="status" role="status" aria-live="polite">{status.value}</p>;
  const share = job.share ?? 0, path = job.path ?? [], best = Math.min(...path.map(([, r]) => r));
  const far = job.what === "scenario" ? (share < 1 ? `, ${hour(job.reached ?? 0)} simulated, ${Math.round(100 * share)} % of its steps` : ", all its steps; humidity, limits and margins") : job.evaluations ? `, evaluation ${job.evaluations}, weighted RMS ${shown(job.rms, 3)}` : "";
  return (
    <div class="doing"><p id="status" role="status" aria-live="polite">{DOING[job.what ?? ""]} {job.stage}{far}</p>
      {job.what === "fit" && path.length > 1 && <svg class="path" viewBox="0 0 100 24" aria-hidden="true"><polyline points={path.map(([, r], k) => `${100 * k / (path.length - 1)},${2 + 20 * (1 - Math.min(1, Math.log(r / best + 1e-9) / Math.log(Math.max(...path.map(([, q]) => q)) / best + 1e-9)))}`).join(" ")} transform="matrix(1 0 0 -1 0 24)" /></svg>}
      {job.what === "scenario" && <progress id="progress" max={1} value={share < 1 ? share : undefined} aria-label="How far it is" />}
      {job.what !== "look" && <button id="stop" type="button" onClick={stop}>{job.what === "fit" ? "Stop, keep the best" : "Stop"}</button>}</div>
  );
}

function keys(e: KeyboardEvent) {
  if (!(e.ctrlKey || e.metaKey) || (e.target as Element).matches("input[type=text],input[type=search],input[type=number],textarea")) return;
  const key = e.key.toLowerCase();
  if (key === "z" && !e.shiftKey) { e.preventDefault(); undo(); } else if (key === "y" || (key === "z" && e.shiftKey)) { e.preventDefault(); redo(); }
}

async function begin() {
  await tried(async () => {
    while ((await refresh()) && project.value!.job.what === "look") await new Promise((r) => setTimeout(r, 150));
    const { stages, job } = project.value!, going = job.ended === false && job.what !== "look", ready = [...stages].reverse().find((x) => x.state === "done" || x.state === "deck") ?? stages.find((x) => x.state !== "waiting") ?? stages[0]!;
    const log = await known();
    await open((going && stages.some((x) => x.name === job.stage) && job.stage) || ready.name);
    if (log) view.value = "watch";
    studio.ready = true;
    if (going) { if (job.what === "scenario") view.value = "scenarios"; await watch(); }
  });
  void follow();
}

// what another tab has begun or ended shows when this one is looked at
let looking = false;
window.addEventListener("focus", async () => {
  if (!studio.ready || looking) return;
  looking = true;
  await tried(async () => { while (await refresh()) await new Promise((r) => setTimeout(r, 500)); });
  looking = false;
});

function Page() {
  const p = project.value;
  useEffect(() => { void begin(); document.addEventListener("keydown", keys); }, []);
  if (!p) return <main><p role="alert" class="error" id="error" hidden={!error.value}>{error.value}</p></main>;
  return (
    <div class="project" data-view={view.value}>
      <a class="skip" href="#curves">Skip to the curves</a>
      <header>
        <h1 id="title">{p.title}</h1><span class="soft" id="note">{[p.file, p.note].filter(Boolean).join(" — ")}</span>
        <div id="views" role="group" aria-label="Views">{VIEWS.map((v) => <button key={v} type="button" data-view={v} aria-pressed={view.value === v} onClick={() => { view.value = v; }}>{v[0]!.toUpperCase() + v.slice(1)}</button>)}</div>
        <nav aria-label="Pages"><a href="/build">Build</a><a href="/start">Start</a></nav><span id="banner" class="banner" hidden={!desk.value?.synthetic}>Synthetic data: no reading here was measured.</span><span class="grow" /><Doing />
      </header>
      <p id="error" class="error" role="alert" hidden={!error.value}>{nice(error.value)}</p>
      <div class="work"><Stages />{view.value === "correlate" ? <Correlate /> : view.value === "scenarios" ? <Scenarios /> : <Watch />}</div>
    </div>
  );
}

Object.assign(window, { studio });
render(<Page />, document.body);
