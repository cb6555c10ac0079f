// Scenarios: choose what is run, run it with progress, see limits and margins on the curves, the worst part and time in words.
import { signal } from "@preact/signals";
import { useMemo } from "preact/hooks";
import { after, begin, busy, desk, entered, stage, studio, tried, values } from "./project";
import { PHASES, over, swatch, under, type Limit, type Marks, type Phase } from "./marks";
import { Plot, colour, dash, hour, scheme, type Line } from "./plot";
import { ask, nice, shown, type Refused } from "./server";
import { refused } from "./state";
import { OneOf } from "./typed";

interface Course { key: string; title: string; group: string; kind: string }
interface Shelf { courses: Course[]; boundaries: string[]; nodes: string[]; limits: string[]; source: string; fitted: boolean }
interface Number_ { text: string; mark: string; clause: string; note: string }
interface Profile { numbers: Record<string, Number_>; kind: string; lacking: string; trust: string; note: string; remarks: string[]; steps: number }
interface Check { point: string; node: string; state: string; limits: [number | null, number | null]; lowest: number; highest: number; room: number | null; value: number; time: number; passed: boolean | null; why: string; crossings: unknown[] }
interface Margin { point: string; side: string; state: string; predicted: number; uncertainty: number; added: number; limit: number; margin: number; passed: boolean | null; policy: string }
interface Course_ { name: string; times: Float32Array; values: Float32Array; chamber: boolean; band?: Float32Array; band_times?: Float32Array; band_values?: Float32Array }
interface Outcome {
  title: string; duration: number; waited: number | null; trust: string; verdict: { word: string; text: string }; worst: Check | null; phases: Phase[]; levels: { name: string; value: number }[]; nodes: number; curves: Course_[];
  points: { point: string; node: string; spans: { state: string; from: number; to: number; limits: [number | null, number | null] }[] }[]; checks: Check[]; margins: Margin[]; remarks: string[];
  moisture: { dew: { name: string; times: Float32Array; values: Float32Array }[]; surfaces: { surface: string; margin: number; time: number; condensing: number; film: number }[] } | null;
}

const LEVELS = ["hot", "cold", "cycles", "dwell", "ramp", "stable"], UNITS: Record<string, string> = { hot: "°C", cold: "°C", dwell: "h", ramp: "K/min" };
const MARKS: Record<string, string> = { kept: "✓", "passed a limit": "✗", "margin not met": "✗", "not met": "✗", "not decided": "?", open: "–" };
const shelf = signal<Shelf | null>(null), profile = signal<Profile | null>(null), outcome = signal<Outcome | null>(null), running = signal(false), focus = signal(""), zoom = signal<[number, number] | null>(null);
interface Asked { course: string; lowest: string; highest: string; numbers: Record<string, string>; off: string[]; base: string; gas: string; state: string; uncertain: boolean }
const plain: Asked = { course: "", lowest: "", highest: "", numbers: {}, off: [], base: "", gas: "air", state: "operating", uncertain: false }, asked = signal<Asked>(plain), wrong = signal<Refused | null>(null);

const course = () => shelf.value?.courses.find((c) => c.key === asked.value.course);
const body = () => {
  const a = asked.value, number = (t: string) => (t === "" ? null : Number(t));
  return { stage: stage.value, course: a.course, values: values.value, lowest: number(a.lowest), highest: number(a.highest), numbers: Object.fromEntries(Object.entries(a.numbers).filter(([, v]) => v.trim())), chamber: (shelf.value?.boundaries ?? []).filter((b) => !a.off.includes(b)), base: a.base, gas: a.gas, state: a.state, uncertain: a.uncertain && uncertainty() };
};
const uncertainty = () => Boolean(shelf.value?.fitted && shelf.value.limits.length && ["profile", "scenario", "record"].includes(course()?.kind ?? ""));
// answers may come in another order than their questions: the last question counts
let describing = 0;
async function describe() {
  const mine = ++describing;
  if (course()?.kind !== "profile") { profile.value = null; return; }
  const got = await tried(() => ask<Profile>("profile", body()));
  if (mine !== describing) return;
  wrong.value = got ? null : refused.value;
  if (got) profile.value = got;
}
function set(more: Partial<Asked>, told = true) { asked.value = { ...asked.value, ...more }; if (told) void describe(); }

entered.add(async () => {
  const got = await tried(() => ask<Shelf>(`shelf?stage=${encodeURIComponent(stage.value)}`));
  if (!got) return;
  shelf.value = got;
  if (!got.courses.some((c) => c.key === asked.value.course)) asked.value = { ...plain, course: got.courses[0]?.key ?? "" };
  await describe();
});
after.set("scenario", async () => {
  const got = await ask<Outcome>("outcome", { window: null });
  zoom.value = null; outcome.value = got; running.value = false;
  focus.value = got.worst?.point ?? "";
  studio.outcomes++;
});
// a window is asked for again, so that what is shown of it is every sample that lies in it
async function look(w: [number, number] | null) {
  zoom.value = w;
  const got = await tried(() => ask<Outcome>("outcome", { window: w }));
  if (got && outcome.value && zoom.value === w) outcome.value = { ...outcome.value, curves: got.curves, moisture: got.moisture };
}

function Form() {
  const s = shelf.value, a = asked.value, kind = course()?.kind, told = profile.value, isProfile = kind === "profile", groups = new Map<string, Course[]>();
  for (const c of s?.courses ?? []) groups.set(c.group, [...(groups.get(c.group) ?? []), c]);
  const bare = (t: string) => (t || "not given").replace(/ \[.*\]$/, ""), written = (t: string) => nice(t.replace(/ \[1\]/, "").replace(/\[([^\]]*)\]/g, "$1"));
  const both = (more: Partial<Asked>) => { set(more, false); if ((asked.value.lowest === "") === (asked.value.highest === "")) void describe(); };
  const numbers = told ? LEVELS.filter((n) => n in told.numbers || n === "hot" || n === "cold").filter((n) => told.kind !== "humidity" || n in told.numbers) : [];
  return (
    <section aria-labelledby="scenario-form-title">
      <h2 id="scenario-form-title">What is run</h2>
      <form id="scenario-form" onSubmit={(e) => { e.preventDefault(); running.value = true; outcome.value = null; void tried(() => begin("scenario", body())).finally(() => { running.value = false; }); }}>
        <label>Profile, scenario or test <select id="course" value={a.course} onChange={(e) => set({ course: e.currentTarget.value, numbers: {}, lowest: "", highest: "" })}>{[...groups].map(([name, list]) => <optgroup key={name} label={name}>{list.map((c) => <option key={c.key} value={c.key}>{c.title}</option>)}</optgroup>)}</select></label>
        {isProfile && <>
          <div class="pair"><label>lowest predicted [°C] <input id="lowest" type="number" step="any" value={a.lowest} onChange={(e) => both({ lowest: e.currentTarget.value })} /></label><label>highest predicted [°C] <input id="highest" type="number" step="any" value={a.highest} onChange={(e) => both({ highest: e.currentTarget.value })} /></label></div>
          <div id="numbers" class="pair">{numbers.map((n) => <label key={`${a.course} ${n}`}>{n}{UNITS[n] && ` [${UNITS[n]}]`} <OneOf of={n === "stable" ? "stability" : `, ${n}`} refused={wrong.value} on="change" data-number={n} now={a.numbers[n] ?? ""} placeholder={bare(told!.numbers[n]?.text ?? "")} send={(to) => set({ numbers: { ...a.numbers, [n]: to } })} /></label>)}</div>
          <fieldset><legend>Chamber</legend><div id="chamber">{s!.boundaries.map((b) => <label key={b}><input type="checkbox" value={b} checked={!a.off.includes(b)} onChange={(e) => set({ off: e.currentTarget.checked ? a.off.filter((x) => x !== b) : [...a.off, b] }, false)} /> {b}</label>)}</div></fieldset>
          <label>Levels hold <select id="base" value={a.base} onChange={(e) => set({ base: e.currentTarget.value }, false)}><option value="">the chamber's</option>{s!.nodes.map((n) => <option key={n} value={n}>at {n}</option>)}</select></label></>}
        {(kind === "scenario" || kind === "record") && <label>Gas <select id="scenario-gas" value={a.gas} onChange={(e) => set({ gas: e.currentTarget.value }, false)}><option value="air">as it says</option><option value="vacuum">vacuum</option><option value="printed">without convection, as printed</option></select></label>}
        {kind !== "test" && <label>A unit without switched loads is <select id="state" value={a.state} onChange={(e) => set({ state: e.currentTarget.value }, false)}><option value="operating">operating</option><option value="non-operating">non-operating</option></select></label>}
        {uncertainty() && <label><input id="uncertain" type="checkbox" checked={a.uncertain} onChange={(e) => set({ uncertain: e.currentTarget.checked }, false)} /> with the fit's uncertainty and margins</label>}
        <button id="scenario-run" class="main" type="submit" disabled={busy.value || !desk.value}>Run</button>
      </form>
      <p id="limits-known" class="soft">{s && (s.limits.length ? `Limits of ${s.limits.join(", ")} from ${s.source}.` : "No limits are kept beside this deck for its nodes. A file with a table per reference point (node, operating, non_operating, start_up) is found in its folder, the folders in it, or the one above.")}</p>
      {told && <div id="profile-numbers" class="detail"><p>{[told.lacking && `Not complete: ${told.lacking}`, told.trust, told.note].filter(Boolean).join(" — ")}</p>{told.remarks.map((r) => <p key={r} class="warning">{nice(r)}</p>)}
        <details><summary>Its numbers, with clauses{told.steps ? `; ${told.steps} steps` : ""}</summary><div class="scroll" tabIndex={0} role="group" aria-label="Numbers of the profile"><table><thead><tr>{["Number", "Value", "Known how", "Where"].map((t) => <th key={t} scope="col">{t}</th>)}</tr></thead>
          <tbody>{Object.entries(told.numbers).map(([n, v]) => <tr key={n}><th scope="row">{n}</th><td>{written(v.text)}</td><td>{v.mark}</td><td>{[v.clause, v.note].filter(Boolean).join("; ")}</td></tr>)}</tbody></table></div></details></div>}
    </section>
  );
}

function Chart({ o }: { o: Outcome }) {
  const tint = scheme.value, at = focus.value;
  const [lines, marks] = useMemo<[Line[], Marks]>(() => {
    const point = o.points.find((p) => p.point === at), made: Line[] = [], limits: Limit[] = [], said = new Set<string>();
    o.curves.forEach((c, k) => {
      const own = point && c.name === point.node;
      if (c.band && (!point || own)) made.push({ x: c.band_times!, y: c.band_values!, low: c.band_values!.map((v, i) => v - c.band![i]!), high: c.band_values!.map((v, i) => v + c.band![i]!), kind: "band", colour: colour(k) });
      made.push({ x: c.times, y: c.values, kind: "line", colour: colour(k), dash: c.chamber ? [6, 4] : dash(k), width: own ? 3 : point && !c.chamber ? 1 : 1.8 });
    });
    (o.moisture?.dew ?? []).forEach((d, k) => made.push({ x: d.times, y: d.values, kind: "line", colour: colour(o.curves.length + k), dash: [2, 4] }));
    for (const span of point?.spans ?? []) span.limits.forEach((v, k) => {
      if (v === null) return;
      const side = k ? "upper" as const : "lower" as const, key = `${span.state} ${side}`;
      limits.push({ value: v, side, state: span.state, from: span.from, to: span.to, label: said.has(key) ? "" : `${span.state} ${k ? "≤" : "≥"} ${shown(v, 5)} °C` });
      said.add(key);
    });
    const own = o.checks.filter((c) => point && c.point === point.point && c.room !== null).sort((a, b) => a.room! - b.room!)[0];
    const flags = own ? [{ x: own.time, y: own.value, bad: own.passed === false, text: `${own.room! < 0 ? `${(-own.room!).toFixed(1)} K beyond` : `${own.room!.toFixed(1)} K left`}${own.why ? ", not decided" : ""}` }] : [];
    return [made, { phases: o.phases, limits, flags, levels: point ? [] : o.levels.map((l) => ({ value: l.value, label: `${l.name} ${l.value.toFixed(1)} °C` })) }];
  }, [o, at, tint]);
  const draw = useMemo(() => ({ under: under(marks), over: over(marks, lines) }), [marks, lines]);
  return <div id="scenario-chart" class="tall"><Plot lines={lines} label="Temperatures of the run with limits" window={zoom.value} onWindow={look} reach={[...marks.limits!.map((l) => l.value), ...marks.levels!.map((l) => l.value)]} {...draw} /></div>;
}

function Result({ o }: { o: Outcome }) {
  const kinds = Object.keys(PHASES).filter((k) => o.phases.some((p) => p.kind === k)), cell = (v: number | null, digits = 1) => <td class="num">{v === null ? "–" : v.toFixed(digits)}</td>;
  return (
    <div id="scenario-result">
      <div class="bar"><label>Limits of <select id="focus" value={focus.value} onChange={(e) => { focus.value = e.currentTarget.value; }}>{o.points.map((p) => <option key={p.point} value={p.point}>{p.point === o.worst?.point ? `${p.point} (nearest to its limit)` : p.point}</option>)}<option value="">no limits</option></select></label>
        <span id="phases" class="keys">{kinds.map((k) => <span key={k}><img src={swatch(k)} alt="" width={26} height={12} /> {PHASES[k]}</span>)}{o.points.length > 0 && <span>limits: —— operating, - - non-operating, ··· start-up</span>}</span></div>
      <p class="keys" id="scenario-legend">{o.curves.map((c, k) => <span key={c.name} data-curve={c.name}><i style={{ borderTopColor: colour(k), borderTopStyle: dash(k).length || c.chamber ? "dashed" : "solid" }} />{c.name}</span>)}{(o.moisture?.dew ?? []).map((d, k) => <span key={d.name}><i class="dotted" style={{ borderTopColor: colour(o.curves.length + k) }} />{d.name}</span>)}</p>
      <Chart o={o} />
      <p id="scenario-shown" class="soft">{o.curves.length < o.nodes && `${o.curves.length} of ${o.nodes} nodes: those with limits, then the widest swings`}</p>
      {o.checks.length > 0 && <div class="scroll" tabIndex={0} role="group" aria-label="Limits"><table id="checks"><caption>Compared with limits [°C]; the margin is the distance to the nearer limit, negative where it is exceeded</caption><thead><tr>{["Point", "State", "Lowest", "Highest", "Limits", "Margin [K]", "At [h]"].map((t, k) => <th key={t} scope="col" class={k > 1 ? "num" : ""}>{t}</th>)}</tr></thead>
        <tbody>{[...o.checks].sort((a, b) => (a.room ?? 1e9) - (b.room ?? 1e9)).map((c) => <tr key={`${c.point} ${c.state}`} data-check={c.point} data-bad={c.crossings.length > 0 || undefined}><th scope="row">{c.point}</th><td>{c.state}{c.why && ` (not decided: ${c.why})`}</td>{cell(c.lowest)}{cell(c.highest)}<td class="num">{c.limits.map((v) => (v === null ? "–" : shown(v, 5))).join(" to ")}</td><td class="num">{c.room === null ? "–" : `${c.crossings.length ? "✗ " : ""}${c.room.toFixed(1)}`}</td><td class="num">{shown(c.time / 3600, 3)}</td></tr>)}</tbody></table></div>}
      {o.margins.length > 0 && <div class="scroll" tabIndex={0} role="group" aria-label="Margins"><table id="margins"><caption>Margins [K] by {o.margins[0]!.policy}: limit less predicted, less uncertainty (95 %), less what the policy adds</caption><thead><tr>{["Point", "Side", "Predicted [°C]", "Uncertainty", "Added", "Limit [°C]", "Margin"].map((t, k) => <th key={t} scope="col" class={k > 1 ? "num" : ""}>{t}</th>)}</tr></thead>
        <tbody>{o.margins.map((m) => <tr key={`${m.point} ${m.side} ${m.state}`}><th scope="row">{m.point}</th><td>{m.side}, {m.state}</td>{cell(m.predicted)}{cell(m.uncertainty)}{cell(m.added)}<td class="num">{shown(m.limit, 5)}</td><td class="num">{m.passed === false ? "✗ " : m.passed === null ? "? " : ""}{m.margin.toFixed(1)}</td></tr>)}</tbody></table></div>}
      {(o.moisture?.surfaces.length ?? 0) > 0 && <div class="scroll" tabIndex={0} role="group" aria-label="Moisture"><table id="moisture"><caption>Surfaces above the dew point; below zero water settles</caption><thead><tr>{["Surface", "Least margin [K]", "At [h]", "Condensing [h]", "Film to [g/m²]"].map((t, k) => <th key={t} scope="col" class={k ? "num" : ""}>{t}</th>)}</tr></thead>
        <tbody>{o.moisture!.surfaces.map((w) => <tr key={w.surface}><th scope="row">{w.surface}</th>{cell(w.margin)}{cell(w.time / 3600)}{cell(w.condensing / 3600)}{cell(w.film)}</tr>)}</tbody></table></div>}
      {o.phases.length > 0 && <details><summary>Phases</summary><ol id="phase-list" class="detail">{o.phases.map((p, k) => <li key={k}>{hour(p.from)}: {p.name}{p.cycle ? `, cycle ${p.cycle}` : ""}, {PHASES[p.kind]}, {hour(p.to - p.from)}{p.slowest ? `; slowest ${p.slowest} by '${p.rule}'` : ""}</li>)}</ol></details>}
      <ul id="scenario-remarks" class="detail">{[o.trust, ...o.remarks].filter(Boolean).map((r) => <li key={r}>{nice(r)}</li>)}</ul>
    </div>
  );
}

export function Scenarios() {
  const o = outcome.value;
  return (
    <main class="two" id="curves" tabIndex={-1}><Form />
      <section aria-labelledby="scenario-title">
        <h2 id="scenario-title">{o ? `${o.title}: ${hour(o.duration)}${o.waited === null ? "" : `, of it ${hour(o.waited)} waiting for the unit`}` : running.value ? "Running …" : "Nothing was run yet"}</h2>
        <div id="verdict" role="status" aria-live="polite">{o && <p class="verdict" data-word={o.verdict.word}><strong>{MARKS[o.verdict.word]} {o.verdict.word}</strong> {nice(o.verdict.text)}</p>}</div>
        {o && <Result o={o} />}
      </section>
    </main>
  );
}
