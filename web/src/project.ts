// What the page of a project knows: its stages, one of them open with its values and curves, and what can be undone.
import { computed, effect, signal } from "@preact/signals";
import { frames } from "./plot";
import { ask, type Curve } from "./server";
import { error, errors, say } from "./state";

export interface Told { state: string; stage: string; accepted?: boolean; because: string }
export interface Stage { name: string; state: string; why: string; below: string[]; sensors: Record<string, number>; standing: string; because: string; usable: boolean; told: Told; verdicts: { record: string; text: string }[]; open: string; edition: number; says?: string }
export interface Fitted { value: number; error: number | null; unit: string }
export interface Doing { what?: string; stage?: string; ended?: boolean; stopped?: boolean; error?: string; evaluations?: number; rms?: number; seconds?: number; share?: number; reached?: number; path?: [number, number][]; result?: { values: Record<string, Fitted>; others: Record<string, number>; warnings: string[]; clocks: Record<string, string>; standing: Told; text: string; evaluations: number } }
export interface Project { title: string; file: string; kind: string; note: string; stages: Stage[]; decks: string[]; kept: string[]; table: { heads: string[]; rows: [string, string][][] }; job: Doing }
export interface Track { path: string; unit: string; value: number; low: number; high: number; log: boolean; free: boolean; error: number | null; source: string; note: string; also: string[]; prior: [number, number] | []; deck: number | null; found?: number }
export interface Run { name: string; remarks: string[]; curves: Curve[] }
export interface Desk { title: string; sliders: Track[]; others: string[]; parts: string[]; fitted: boolean; measured: boolean; warnings: string[]; clocks: Record<string, string>; standing: Told; synthetic: boolean; scheduled: string[]; runs: Run[] }
export interface Drawn { svg: string; table: { temperatures: Record<string, number>; flows: Record<string, number>; powers: Record<string, number> } }
export type Values = Record<string, number>;
type Pair = [number, number];

export const project = signal<Project | null>(null), stage = signal(""), desk = signal<Desk | null>(null), runs = signal<Run[]>([]), given = signal<Curve[]>([]);
export const values = signal<Values>({}), done = signal<Values[]>([]), undone = signal<Values[]>([]), ticked = signal<ReadonlySet<string>>(new Set());
export const run = signal(0), time = signal(0), zoom = signal<Pair | null>(null), cursor = signal<number | null>(null);
export const folded = signal<ReadonlySet<string>>(new Set()), chosen = signal(""), drawn = signal<Drawn | null>(null);
export const pinned = signal<{ label: string; values: Values; runs: Record<number, Run> } | null>(null);
export const view = signal<"correlate" | "scenarios" | "watch">("correlate"), status = signal("");
export const found = signal<{ title: string; clocks: Record<string, string>; warnings: string[]; text: string } | null>(null), diff = signal("");
export const after = new Map<string, (job: Doing) => Promise<void> | void>(), entered = new Set<() => unknown>();
export const studio = { errors, project, latencies: [] as number[], frames, ready: false, begun: 0, outcomes: 0, looks: 0, look: null as unknown, get state() { return { values: values.value, stage: stage.value, runs: runs.value, desk: desk.value, window: zoom.value }; } };
export const busy = computed(() => project.value?.job.ended === false);
export const current = computed(() => project.value?.stages.find((x) => x.name === stage.value) ?? null);
// just before the hottest of the sensors is at its top, where its power may go off: what the map shows at first
function hottest(): number {
  let top = -Infinity, when = whole.value[1];
  for (const c of runs.value[run.value]?.curves ?? []) c.simulated.forEach((v, k) => { if (v >= top) { top = v; when = c.times[Math.max(k - 1, 0)]!; } });
  return when;
}
export const whole = computed<Pair>(() => { const all = runs.value[run.value]?.curves ?? []; return [0, Math.max(1, ...all.map((c) => c.times[c.times.length - 1] ?? 0))]; });
export const valueOf = (x: Track) => values.value[x.path] ?? x.value;
export const misfit = (c: Curve) => (c.rmse ?? 0) / (c.sigma || 1);
export const order = signal<string[]>([]); // sensors, the worst first

export async function tried<T>(make: () => Promise<T>): Promise<T | null> {
  try { error.value = ""; return await make(); } catch (e) { say(e); return null; }
}

// what was moved comes back when the page is loaded anew or the stage opened again; it is this tab's alone
interface Kept { values: Values; done: Values[]; undone: Values[] }
const drawer = (name: string) => `thermid ${project.peek()?.file} ${name}`; // nothing is kept anew because a project was looked at
const kept = (name: string): Kept => JSON.parse(sessionStorage.getItem(drawer(name)) ?? '{"values":{},"done":[],"undone":[]}') as Kept;
const keep = (name: string, what: Kept) => sessionStorage.setItem(drawer(name), JSON.stringify({ values: what.values, done: what.done.slice(-50), undone: what.undone.slice(-50) }));
effect(() => { const now = { values: values.value, done: done.value, undone: undone.value }; if (desk.value && desk.value.title === stage.peek()) keep(stage.peek(), now); });

// two for each pixel of a tile
export const points = () => Math.min(1200, Math.max(300, 2 * (document.querySelector("#tiles .plot")?.clientWidth ?? 600)));
const sort = () => { const all = runs.value[run.value]?.curves ?? []; order.value = [...all].sort((a, b) => misfit(b) - misfit(a)).map((c) => c.name); };

let turn = 0; // counts what was opened: an answer to what was asked before is not shown
export async function open(name: string) {
  const mine = ++turn;
  stage.value = name;
  opened = editions[name] ?? "";
  // one that waits has nothing to show before the stages below it are run, as its button says; where one of them cannot be, the answer says why
  const now = current.value, waits = now?.state === "waiting" && !project.value!.stages.some((x) => x.state === "failed" && now.below.includes(x.name));
  const made = await tried(async () => (waits ? null : ask<Desk>(`desk?stage=${encodeURIComponent(name)}`)));
  if (mine !== turn) return;
  pinned.value = null; drawn.value = null; given.value = []; drawing++;
  zoom.value = null; run.value = 0; chosen.value = ""; found.value = null; diff.value = "";
  desk.value = null;
  if (!made) { runs.value = []; values.value = {}; return; }
  const had = kept(name), known = new Set([...made.sliders.map((x) => x.path), ...made.others]);
  const fits = [had.values, ...had.done, ...had.undone].every((v) => Object.keys(v).every((path) => known.has(path)));
  [values.value, done.value, undone.value] = fits ? [had.values, had.done, had.undone] : [{}, [], []];
  folded.value = new Set(made.parts.length > FEW ? made.parts.filter((p) => !p.includes(".")) : []);
  ticked.value = new Set(made.sliders.filter((x) => x.free).map((x) => x.path));
  runs.value = made.runs;
  desk.value = made;
  time.value = hottest();
  if (made.fitted && made.measured) found.value = { title: "What the stage's fit says", clocks: made.clocks, warnings: made.warnings.length ? made.warnings : ["none"], text: "" };
  sort();
  await null; // tiles have a width now, and it says how many points are seen
  await move(true);
  if (mine !== turn) return;
  void surroundings();
  await Promise.all([...entered].map((f) => f()));
}
export const FEW = 16;

async function surroundings() {
  const mine = stage.value, at = run.value, got = await tried(() => ask<{ curves: Curve[] }>("given", { stage: mine, run: at }));
  if (got && mine === stage.value && at === run.value) given.value = got.curves;
  await picture();
}

// the newest values win: one question at a time, and what was moved meanwhile is asked for after it; whoever asks waits for the last
let asking: Promise<void> | null = null, again = false, full = false;
export function move(measured = false): Promise<void> { again = true; full ||= measured; return (asking ??= answers()); }
async function answers() {
  while (again) {
    const mine = turn, at = run.value, begun = studio.begun, now = desk.value, sent = { stage: now?.title, values: values.value, run: at, measured: full, window: zoom.value, points: points() };
    again = full = false;
    const got = await tried(async () => now && ask<{ runs: Run[] }>("curves", sent));
    if (!got || mine !== turn) continue;
    const fresh = got.runs[0]!, before = runs.value[at]!;
    runs.value = runs.value.map((r, k) => (k === at ? { ...fresh, name: r.name, curves: fresh.curves.map((c, i) => ({ ...before.curves[i]!, ...c, ...still(before.curves[i]!, c) })) } : r));
    if (begun) requestAnimationFrame(() => studio.latencies.push(performance.now() - begun));
  }
  asking = null;
}
// what a screen cannot show is not drawn again: the arrays stay where the curve moved by less than a fifth of a pixel of its tile
function still(a: Curve, b: Curve): Partial<Curve> {
  if (a.times.length !== b.times.length || a.times[a.times.length - 1] !== b.times[b.times.length - 1] || a.times[0] !== b.times[0]) return {};
  let low = Infinity, high = -Infinity, most = 0;
  for (let k = 0; k < a.times.length; k++) { const v = a.simulated[k]!; low = Math.min(low, v); high = Math.max(high, v); most = Math.max(most, Math.abs(v - b.simulated[k]!)); }
  const rest = a.measured?.length ? Math.max(2 * (a.sigma ?? 0), a.largest ?? 0) : Infinity;
  return most < Math.min((high - low) / 1000, rest / 150) ? { times: a.times, simulated: a.simulated, apart: a.apart, left: a.left } : {};
}
// the hand left the slider: tiles are put in order, the map is drawn
export async function settle() { await asking; sort(); void picture(); }

let drawing = 0;
export async function picture() {
  if (!desk.value) return;
  const mine = ++drawing, got = await tried(() => ask<Drawn>("picture", { stage: stage.value, values: values.value, run: run.value, time: time.value, folded: [...folded.value] }));
  if (got && mine === drawing) drawn.value = got;
}
let waiting = 0;
export function at(t: number) { time.value = t; clearTimeout(waiting); waiting = window.setTimeout(picture, 150); }
export async function look(w: Pair | null) { zoom.value = w; await move(true); await pin(); }
export async function choose(k: number) { run.value = k; zoom.value = null; time.value = hottest(); await move(true); sort(); await pin(); await surroundings(); }

export function remember() { done.value = [...done.value, values.value]; undone.value = []; }
function stepped(from: typeof done, to: typeof done) {
  const last = from.value[from.value.length - 1];
  if (!last) return;
  to.value = [...to.value, values.value]; from.value = from.value.slice(0, -1);
  void become(last);
}
export const undo = () => stepped(done, undone), redo = () => stepped(undone, done);
export async function become(to: Values) { values.value = to; studio.begun = performance.now(); await move(); await settle(); }

// state A: what is compared with; its curves come from its own values
export async function pin(label?: string, of?: Values) {
  const now = label === undefined ? pinned.value : label ? { label, values: of ?? values.value, runs: {} } : null;
  if (!now) { pinned.value = null; return; }
  const mine = turn, got = await tried(() => ask<{ runs: Run[] }>("curves", { stage: stage.value, values: now.values, run: run.value, measured: false, window: zoom.value, points: points() }));
  if (got && mine === turn) pinned.value = { ...now, runs: { [run.value]: got.runs[0]! } };
}
export const pinFile = async (file: string) => { const got = await tried(() => ask<Values>("kept", { stage: stage.value, file })); if (got) await pin(file.replace(".values.toml", ""), got); };

let editions: Record<string, string> = {}, opened = "";
export async function refresh(): Promise<boolean> {
  const got = await ask<Project>("project"), before = project.value;
  editions = Object.fromEntries(got.stages.map((x) => [x.name, JSON.stringify([x.state, x.edition])]));
  // marks of a swap are the page's alone, and stay while nothing is run
  project.value = before && JSON.stringify(before.stages.map(({ says: _, ...x }) => x.name + x.edition)) === JSON.stringify(got.stages.map((x) => x.name + x.edition)) && got.job.ended !== false && before.stages.some((x) => x.says) ? { ...got, stages: before.stages } : got;
  document.title = `${got.title} · thermid studio`;
  return got.job.ended === false;
}
export async function watch(then?: (job: Doing) => Promise<void> | void) {
  while (await refresh()) await new Promise((r) => setTimeout(r, 150));
  const job = project.value!.job;
  if (job.error && job.what !== "look") error.value = job.error;
  else await (then ?? after.get(job.what ?? ""))?.(job);
}
export const begin = async (path: string, body: unknown) => { await ask(path, body); await watch(); };
export const stop = () => tried(() => ask("stop", {}));
export const runStage = () => tried(() => begin("run", { stage: stage.value, below: true }));
export const fit = () => tried(() => begin("fit", { stage: desk.value!.title, values: values.value, free: [...ticked.value] }));

// what was moved before a run is undone by it, and comes back by Undo
after.set("run", (job) => {
  const had = kept(job.stage!);
  if (Object.keys(had.values).length) keep(job.stage!, { values: {}, done: [...had.done, had.values], undone: [] });
  return open(stage.value);
});
after.set("fit", async (job) => {
  const result = job.result!, got = { ...Object.fromEntries(Object.entries(result.values).map(([p, v]) => [p, v.value])), ...result.others };
  if (job.stage !== stage.value) { // another was opened meanwhile: it lies there when its stage is opened again
    const there = kept(job.stage!);
    keep(job.stage!, { values: { ...there.values, ...got }, done: [...there.done, there.values], undone: [] });
    status.value = `The fit of ${job.stage} has ended; open it to see.`;
    return;
  }
  remember();
  const mine = turn;
  await become({ ...values.value, ...got }); // what the page says of the fit comes with its curves, not before them
  if (mine !== turn) return;
  desk.value = { ...desk.value!, sliders: desk.value!.sliders.map((x) => { const v = result.values[x.path]; return v ? { ...x, error: v.error, found: v.value } : x; }) };
  const { state, because } = result.standing, loud = ["credible", "unjudged"].includes(state) || result.warnings.some((w) => w.includes(because)) ? [] : [`${state.toUpperCase()}: ${because}`];
  found.value = { title: `Fitted, ${result.evaluations} evaluations, ${(job.seconds ?? 0).toPrecision(2)} s`, clocks: result.clocks, warnings: [...loud, ...result.warnings], text: result.text };
});

// decks, logs and campaigns that their author changes: what is shown is opened anew
export async function follow() {
  if (!document.hidden && stage.value && !busy.value) {
    const now = await ask<Record<string, [string, number]>>("fresh").catch(() => null), other = (name: string, than = editions[name]) => JSON.stringify(now![name]) !== than;
    if (now && other(stage.value, opened)) {
      if (project.value) project.value = { ...project.value, stages: project.value.stages.map(({ says: _, ...x }) => x) };
      await tried(refresh);
      await open(project.value!.stages.some((x) => x.name === stage.value) ? stage.value : project.value!.stages[0]!.name);
    } else if (now && Object.keys({ ...now, ...editions }).some((name) => other(name))) await tried(refresh);
  }
  setTimeout(follow, 1000);
}
