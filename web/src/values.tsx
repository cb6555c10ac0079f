// The values of a stage, one row each: tick, name, value, unit, error, and a track with its interval and prior on it.
import { signal, useComputed } from "@preact/signals";
import { Clocks } from "./results";
import { ask, nice, shown } from "./server";
import { error } from "./state";
import { Typed } from "./typed";
import { become, busy, chosen, desk, done, fit, found, move, pinned, redo, remember, run, settle, stage, studio, ticked, undo, undone, values, type Track } from "./project";

const FEW = 12; // values up to which all groups are open
const search = signal(""), opened = signal<ReadonlySet<string>>(new Set()), moved = signal<{ path: string; text: string } | null>(null);
const place = (x: Track, v: number) => Math.min(1, Math.max(0, x.log ? Math.log(Math.max(v, x.low) / x.low) / Math.log(x.high / x.low) : (v - x.low) / (x.high - x.low)));
const fromPlace = (x: Track, t: number) => (x.log ? x.low * (x.high / x.low) ** t : x.low + t * (x.high - x.low));
const typed = (v: number) => String(Number(v.toPrecision(5)));
const unitOf = (x: { unit: string }) => (x.unit === "1" ? "" : nice(x.unit));
const set = (path: string, v: number) => { values.value = { ...values.value, [path]: v }; studio.begun = performance.now(); void move(); };
const holds: { now: string } = { now: "" };

function Span({ x, ends, kind }: { x: Track; ends: [number, number]; kind: string }) {
  const a = 100 * place(x, ends[0]), b = 100 * place(x, ends[1]);
  return <i class={kind} style={{ left: `${a}%`, width: `${Math.max(b - a, 0.7)}%` }} />;
}

function Row({ x }: { x: Track }) {
  // what a signal alone says: one that would also read the row's own value keeps that of an earlier desk
  const mine = useComputed(() => values.value[x.path]), tick = useComputed(() => ticked.value.has(x.path)), of = useComputed(() => pinned.value && (pinned.value.values[x.path] ?? NaN));
  const v = mine.value ?? x.value, id = `s-${x.path}`, still = x.error !== null && v === (x.found ?? x.value), other = Number.isNaN(of.value) ? x.value : of.value;
  const write = async (text: string) => {
    const n = text === "" ? NaN : Number(text);
    if (!(n >= x.low && n <= x.high)) { error.value = `${x.path}: ${text || "that"} is no number from ${shown(x.low)} to ${shown(x.high)} ${unitOf(x)}.`; return null; }
    error.value = ""; remember(); set(x.path, n); settle();
    return x;
  };
  const told = [x.source, x.note, x.also.length ? `moves ${x.also.join(", ")} too` : "", `from ${shown(x.low, 3)} to ${shown(x.high, 3)} ${unitOf(x)}`].filter(Boolean).join("; ");
  return (
    <div class={`row slider ${v !== x.value ? "moved" : ""} ${chosen.value && (x.path === chosen.value || x.path.startsWith(`${chosen.value}.`)) ? "chosen" : ""}`} data-slider={x.path}>
      <input type="checkbox" checked={tick.value} aria-label={`let the fit move ${x.path}`} onChange={(e) => { const next = new Set(ticked.value); if (e.currentTarget.checked) next.add(x.path); else next.delete(x.path); ticked.value = next; }} />
      <label for={id} title={`${x.path}: ${told}`} onClick={() => void moves(x)}><bdi>{x.path}</bdi></label>
      <Typed class="number" inputMode="decimal" now={typed(v)} unit={unitOf(x)} of={x.path} aria-label={unitOf(x) ? `${x.path} in ${unitOf(x)}` : x.path} send={write} />
      <span class="unit">{unitOf(x)}</span>
      <span class="error-of" title={still ? "standard error of the fit" : ""}>{still ? `± ${shown(x.error, 2)}` : other !== null && other !== v && other ? `${shown(100 * (v / other - 1), 2)} %` : ""}</span>
      <span class="track">
        {x.prior.length === 2 && <Span x={x} ends={x.prior} kind="prior" />}
        {x.error !== null && <Span x={x} ends={[(x.found ?? x.value) - 1.96 * x.error, (x.found ?? x.value) + 1.96 * x.error]} kind="interval" />}
        {other !== null && <Span x={x} ends={[other, other]} kind="pin" />}
        <input type="range" id={id} min="0" max="1" step="0.001" value={place(x, v)} aria-valuetext={`${shown(v)} ${unitOf(x)}`} onFocus={() => void moves(x)}
          onInput={(e) => { if (holds.now !== x.path) { holds.now = x.path; remember(); } set(x.path, fromPlace(x, Number(e.currentTarget.value))); }} onChange={() => { holds.now = ""; settle(); }} />
      </span>
      <button type="button" class="solo" aria-pressed={tick.value && ticked.value.size === 1} aria-label={`let the fit move ${x.path} alone`} title="fit this one alone" onClick={() => { ticked.value = new Set([x.path]); }}>⊙</button>
    </div>
  );
}

// what one per cent more of a value does to the curves
let asked = "";
async function moves(x: Track) {
  if (asked === x.path) return;
  asked = x.path;
  const got = await ask<Record<string, number>>("moves", { stage: stage.value, path: x.path, values: values.value, run: run.value }).catch(() => null);
  if (!got || asked !== x.path) return;
  const all = Object.entries(got).sort((a, b) => Math.abs(b[1]) - Math.abs(a[1])), some = all.filter(([, k]) => Math.abs(k) > 1e-4).slice(0, 5);
  moved.value = { path: x.path, text: some.length ? `+1 % moves ${some.map(([n, k]) => `${n} by ${k > 0 ? "+" : "−"}${shown(Math.abs(k), 2)} K`).join(", ")}` : "+1 % moves no sensor by more than 0.1 mK" };
}

const keyOf = (x: Track) => (x.free ? "Fitted by this stage" : [...desk.value!.parts].filter((p) => x.path.startsWith(`${p}.`)).pop() ?? desk.value!.title);
export function Values() {
  const now = desk.value!, word = search.value.trim().toLowerCase(), groups = new Map<string, Track[]>();
  for (const x of now.sliders) { const key = keyOf(x); groups.set(key, [...(groups.get(key) ?? []), x]); }
  const opens = (name: string, list: Track[]) => word !== "" || list[0]!.free || groups.size === 1 || now.sliders.length < FEW || opened.value.has(name);
  return (
    <div id="sliders">
      <label class="filter">Find <input id="find" type="search" placeholder="part or parameter" value={search.value} onInput={(e) => { search.value = e.currentTarget.value; }} /></label>
      {[...groups].map(([name, list]) => {
        const hits = list.filter((x) => !word || x.path.toLowerCase().includes(word)), open = opens(name, list);
        return (
          <details key={name} open={open} hidden={!hits.length} onToggle={(e) => { const next = new Set(opened.value); if (e.currentTarget.open) next.add(name); else next.delete(name); if (!word) opened.value = next; }}>
            <summary>{name} ({list.length})</summary>{open && hits.map((x) => <Row key={`${now.title} ${x.path}`} x={x} />)}
          </details>
        );
      })}
      {now.scheduled.length > 0 && <p class="soft" id="scheduled">No slider: {now.scheduled.join(", ")}. A schedule of a record sets {now.scheduled.length > 1 ? "them" : "it"} over time; change the schedule instead.</p>}
      <p class="soft" role="status" id="moves">{moved.value && desk.value!.sliders.some((x) => x.path === moved.value!.path) ? `${moved.value.path}: ${moved.value.text}` : ""}</p>
    </div>
  );
}
export const findValue = (word: string) => { search.value = word; };

export function Tuning() {
  const now = desk.value!, stages = () => new Set(now.sliders.filter((x) => x.free).map((x) => x.path)), count = ticked.value.size;
  return (
    <div class="bar" role="group" aria-label="Tuning">
      <button id="fit" type="button" class="main" disabled={busy.value || !now.measured} onClick={fit}>Fit {count}</button>
      <button id="tick-stage" type="button" onClick={() => { ticked.value = stages(); }}>stage's own</button><button id="tick-none" type="button" onClick={() => { ticked.value = new Set(); }}>none</button>
      <span class="grow" /><button id="undo" type="button" disabled={!done.value.length} onClick={undo}>Undo</button><button id="redo" type="button" disabled={!undone.value.length} onClick={redo}>Redo</button>
      <button id="reset" type="button" disabled={!Object.keys(values.value).length} onClick={() => { remember(); void become({}); }}>Reset</button>
    </div>
  );
}

export function Found() {
  const f = found.value;
  if (!f) return <div id="fit-result" hidden />;
  return (
    <div id="fit-result" class="detail" tabIndex={0} role="region" aria-label={f.title}>
      <h3>{f.title}</h3>
      <Clocks found={f.clocks} />
      {f.warnings.map((w) => <p key={w} class={w === "none" ? "soft" : "warning"}>{w === "none" ? "No warning." : `warning: ${nice(w)}`}</p>)}
      {f.text && <details><summary>The whole report</summary><pre tabIndex={0}>{nice(f.text)}</pre></details>}
    </div>
  );
}
