// Watch: a log that grows, judged as `thermid watch` does: alarms, when the test may stop, where every channel will end, with a fan.
import { signal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import { studio, tried, view } from "./project";
import { over, under, type Marks } from "./marks";
import { Plot, css, hour, scheme, type Line } from "./plot";
import { Row, type Offered } from "./log";
import { ask, nice, shown, type Binding, type Column } from "./server";
import { error } from "./state";

interface Forecast { declined: string; final: number | null; low: number; high: number; holds: number | null; late: number | null; open?: boolean; at?: number; level?: string; fan?: { times: Float32Array; low: Float32Array; value: Float32Array; high: Float32Array } }
interface Channel { name: string; times: Float32Array; values: Float32Array; latest: number | null; latest_at: number | null; gaps: { from: number; to: number; why: string; count: number }[]; verdict: string; why: string; rate: number | null; error: number | null; since: number | null; forecast?: Forecast }
interface Seen { advice: "stop" | "wait" | "declined"; because: string; remaining_s?: number | null; at_s?: number; alarms: { kind: string; suspect: string; since_s: number; because: string }[]; nodes: Record<string, { value_C: number; half_K: number; measured: boolean }>; assumed: string[]; ends?: Record<string, { declined: string; final_C: number; interval_C: [number, number]; holds: number | null; now: number; level: number }>; model: string; like: string; unused: string; bound: Record<string, Binding> }
interface Look { same?: boolean; waiting?: string; columns?: Column[]; roles?: Record<string, string>; known: string; age: number; seconds?: number; file: string; rows: number; begin: number; end: number; step: number; forecast_at: number; slowest: string | null; verdict: { word: string; text: string }; channels: Channel[]; reference: string; synthetic: boolean; notes: string[]; watch: Seen }
interface Logs { given: string | null; logs: string[]; rules: { name: string; source: string; mark: string }[] }

const WORDS = { stop: ["✓ stop now", "stable"], wait: ["… wait", "too early"], declined: ["? no stop advised", "cannot tell"] } as const;
const MARKS: Record<string, string> = { stable: "✓", "not stable": "✗", "cannot tell": "?", "too early": "…", reference: "=" };
const logs = signal<Logs | null>(null), found = signal<Look | null>(null), waits = signal(""), columns = signal<Pick<Look, "columns" | "roles">>({}), bound = signal<Record<string, Binding> | null>(null), opened = signal(false), zoom = signal<[number, number] | null>(null), follows = signal(true);
const form = signal({ file: "", rule: "3 C/h", own: "", since: "", slowest: "", reference: "", channel: "", boundaries: "", within: "", limits: "" });

// asked once: whether a log was named on the command line, and what may be opened
export async function known(): Promise<boolean> {
  logs.value = await tried(() => ask<Logs>("logs"));
  if (logs.value?.rules.length) form.value = { ...form.value, rule: logs.value.rules[0]!.name };
  return (opened.value = Boolean(logs.value?.given));
}

let timer = 0, busy = false, again = false;
async function look(fresh: boolean) {
  if (busy) { again = again || fresh; return; }
  busy = true; clearTimeout(timer);
  const f = form.value, number = (t: string) => (t === "" ? null : Number(t));
  let told: Look | null = null;
  try {
    told = await ask<Look>("bench", { file: f.file, rule: f.rule === "own" ? f.own : f.rule, since: number(f.since), slowest: number(f.slowest), reference: f.reference, channel: f.channel, boundaries: f.boundaries, within: number(f.within), limits: f.limits, channels: bound.value ?? {}, window: zoom.value, known: fresh ? "" : found.value?.known ?? "" });
    if (fresh) error.value = "";
  } catch (e) { error.value = String((e as Error).message ?? e); }
  busy = false;
  if (told?.columns) columns.value = told;
  if (told?.same) { if (found.value) found.value = { ...found.value, age: told.age }; } else if (told?.waiting) { found.value = null; waits.value = told.waiting; } else if (told) { waits.value = ""; found.value = told; studio.look = told.watch; studio.looks++; }
  if (again) { again = false; void look(true); return; }
  // a long log takes longer to read, and is asked for less often
  if (told && view.value === "watch" && follows.value) timer = window.setTimeout(() => look(false), Math.max(1000, 2000 * (told.seconds ?? 0)));
}
const set = (more: Partial<typeof form.value>, asks = true) => { form.value = { ...form.value, ...more }; if (asks && opened.value) void look(true); };

// where the model ends a channel takes the place of where the readings alone do
function foreseen(c: Channel, l: Look): Forecast | undefined {
  const e = l.watch.model ? l.watch.ends?.[c.name] : undefined;
  return e ? { declined: e.declined || "", final: e.final_C, low: e.interval_C[0], high: e.interval_C[1], holds: e.holds, late: null, at: e.now, level: (100 * e.level).toFixed(2) } : c.forecast;
}
function ends(c: Channel, f: Forecast | undefined, l: Look): string {
  if (!f) return "";
  const at = f.at ?? l.forecast_at, when = at < l.end ? ` (from the readings to ${hour(at)})` : "", holds = f.holds == null ? "" : f.holds <= l.end ? "; the rule holds by now" : `; the rule holds about ${hour(f.holds)}${f.late ? `, with 95 % by ${hour(f.late)}` : ""}`;
  return f.final === null ? `Where ${c.name} will end is not known yet${when}: ${nice(f.declined).replace(/\.$/, "")}${holds}.` : `${c.name} will end at ${f.final.toFixed(2)} °C, ${f.level ?? 95} % from ${f.low.toFixed(2)} to ${f.high.toFixed(2)}${holds}${when}.`;
}
const gaps = (c: Channel) => { const by = new Map<string, number>(); for (const g of c.gaps) by.set(g.why, (by.get(g.why) ?? 0) + Math.max(g.count, 1)); return [...by].map(([why, n]) => `${n} × ${why}`).join(", "); };
const limitsOf = (name: string) => form.value.limits.split(",").map((t) => t.split("=")).filter(([n]) => n?.trim() === name).map(([, v]) => parseFloat(v ?? "")).filter(Number.isFinite);

function Tile({ c, l }: { c: Channel; l: Look }) {
  const f = foreseen(c, l), tint = scheme.value, own = limitsOf(c.name), fan = f && f === c.forecast && f.final !== null ? f.fan : undefined, span = l.end - l.begin, until = fan ? fan.times[fan.times.length - 1]! : l.end + 0.25 * span;
  const [lines, marks] = useMemo<[Line[], Marks]>(() => {
    const made: Line[] = [{ x: c.times, y: c.values, kind: "line", colour: css("--ink"), width: 1.5 }];
    if (fan) made.unshift({ x: fan.times, y: fan.value, low: fan.low, high: fan.high, kind: "band", colour: css("--accent") }, { x: fan.times, y: fan.value, kind: "line", colour: css("--accent"), dash: [6, 4] });
    const known = f?.final != null && c.verdict !== "reference";
    return [made, { gaps: c.gaps.map((g) => [g.from, g.to]), ends: known ? [{ x: until - 0.03 * span, from: l.end, value: f!.final!, low: f!.low, high: f!.high, colour: css("--accent"), label: `${f!.final!.toFixed(1)} °C` }] : [], limits: own.map((v) => ({ value: v, side: "upper", state: "operating", from: l.begin, to: until, label: `limit ${shown(v)} °C` })) }];
  }, [c, l, tint, own.join()]);
  const draw = useMemo(() => ({ under: under(marks), over: over(marks, lines) }), [marks, lines]);
  return (
    <figure class="tile" data-channel-tile={c.name} data-fan={Boolean(fan) || undefined}>
      <figcaption><strong>{c.name}</strong> <span class="readout">{c.latest === null ? "–" : `${c.latest.toFixed(2)} °C`}, {MARKS[c.verdict]} {c.verdict}</span></figcaption>
      <Plot lines={lines} label={`${c.name}: readings, and where they will end`} window={zoom.value} until={zoom.value ? undefined : until} reach={[...own, ...(f?.final != null ? [f.low, f.high] : [])]} onWindow={(w) => { zoom.value = w; void look(true); }} {...draw} />
    </figure>
  );
}

function Form() {
  const o = logs.value, f = form.value, names = found.value?.channels.map((c) => c.name) ?? [], rule = o?.rules.find((r) => r.name === f.rule);
  return (
    <section aria-labelledby="bench-form-title">
      <h2 id="bench-form-title">Which log</h2>
      <form id="bench-form" onSubmit={(e) => { e.preventDefault(); const file = (document.getElementById("log") as HTMLInputElement).value; opened.value = true; found.value = null; zoom.value = null; bound.value = null; columns.value = {}; set({ file, channel: "" }); }}>
        <label>Log <input id="log" type="text" list="logs" autocomplete="off" placeholder={o?.given ?? (o?.logs.length ? "choose a log of the project" : "no log lies in the project")} /></label><datalist id="logs">{o?.logs.map((n) => <option key={n} value={n} />)}</datalist>
        <button id="bench-open" class="main" type="submit">Open</button>
        <label>Stable by <select id="rule" value={f.rule} onChange={(e) => set({ rule: e.currentTarget.value }, e.currentTarget.value !== "own" || Boolean(f.own))}>{o?.rules.map((r) => <option key={r.name} value={r.name}>{r.name}</option>)}<option value="own">one of your own …</option></select></label>
        {rule && <p class="soft">{rule.source}{rule.mark === "memory" && ", from memory"}</p>}
        {f.rule === "own" && <label>Rule <input id="own-rule" type="text" placeholder="0.5 K/h over 1 h" value={f.own} onChange={(e) => set({ own: e.currentTarget.value })} /></label>}
        <div class="pair"><label>conditions hold since [h] <input id="since" type="number" step="any" placeholder="start" value={f.since} onChange={(e) => set({ since: e.currentTarget.value })} /></label><label>slowest part has [h] <input id="slowest" type="number" step="any" min="0" placeholder="not known" value={f.slowest} onChange={(e) => set({ slowest: e.currentTarget.value })} /></label></div>
        <label>They follow <select id="reference" value={f.reference} onChange={(e) => set({ reference: e.currentTarget.value })}><option value="">none</option>{names.map((n) => <option key={n} value={n}>{n}</option>)}</select></label>
        <label>Forecast first <select id="bench-focus" value={f.channel} onChange={(e) => set({ channel: e.currentTarget.value })}><option value="">the slowest</option>{names.map((n) => <option key={n} value={n}>{n}</option>)}</select></label>
        <div class="pair"><label>model's boundaries [°C] <input id="watch-boundaries" type="text" autocomplete="off" placeholder="air=22" value={f.boundaries} onChange={(e) => set({ boundaries: e.currentTarget.value })} /></label><label>ends known to ± [K] <input id="watch-within" type="number" step="any" min="0" placeholder="1" value={f.within} onChange={(e) => set({ within: e.currentTarget.value })} /></label></div>
        <label>limits that must be decided [°C] <input id="watch-limits" type="text" autocomplete="off" placeholder={`${names[0] ?? "case"}=70`} value={f.limits} onChange={(e) => set({ limits: e.currentTarget.value })} /></label>
        <label><input id="follow" type="checkbox" checked={follows.value} onChange={(e) => { follows.value = e.currentTarget.checked; if (opened.value) void look(true); }} /> follow while it grows</label>
      </form>
    </section>
  );
}

function Advice({ w }: { w: Seen }) {
  const [word, mark] = WORDS[w.advice], hidden = Object.entries(w.nodes).filter(([, n]) => !n.measured), left = w.remaining_s ?? null;
  return (
    <div id="bench-watch" aria-live="polite" data-advice={w.advice}>
      {w.alarms.map((a) => <p key={`${a.kind} ${a.suspect}`} class="verdict" data-word="not met" data-alarm={a.suspect}><strong>✗ ALARM {a.kind}: {a.suspect}</strong> since {hour(a.since_s)}. {nice(a.because)}</p>)}
      <p class="verdict" data-word={mark}><strong>{word}</strong>{left !== null && left > 0 && <span id="remaining">, the rule holds in about {hour(left)}</span>}: {nice(w.because)}{w.model && ` Model: ${w.model}${w.like ? `, columns as in record ${w.like}` : ""}.`}</p>
      {hidden.length > 0 && <table id="hidden"><caption>Nodes without a sensor, by the model</caption><tbody>{hidden.map(([n, v]) => <tr key={n}><th scope="row">{n}</th><td class="num">{v.value_C.toFixed(2)} ± {v.half_K.toFixed(2)} °C</td></tr>)}</tbody></table>}
      {w.assumed.length > 0 && <p class="soft">Assumed: {w.assumed.map((a) => nice(a).replace(/\.$/, "")).join("; ")}.</p>}{w.unused && <p class="soft">{nice(w.unused)}.</p>}
    </div>
  );
}

function Shown({ l }: { l: Look }) {
  const own = l.channels.find((c) => c.name === form.value.channel) ?? l.channels.find((c) => c.name === l.slowest) ?? l.channels[0]!, declined = l.channels.map((c) => [c.name, foreseen(c, l)] as const).filter(([, f]) => f && f.final === null && !f.open);
  return (
    <>
      <div id="bench-verdict"><p class="verdict" data-word={l.verdict.word}><strong>{MARKS[l.verdict.word]} {l.verdict.word}</strong> {nice(l.verdict.text)}<br />{ends(own, foreseen(own, l), l)}</p></div>
      <Advice w={l.watch} />
      <p class="keys"><span><i style={{ borderTopColor: "var(--ink)" }} />readings</span><span><i style={{ borderTopColor: "var(--accent)", borderTopStyle: "dashed" }} />forecast, with its interval as a fan or as a bar at its end</span>{zoom.value && <button type="button" onClick={() => { zoom.value = null; void look(true); }}>Show all</button>}</p>
      <div id="bench-result" class="sensors">{l.channels.map((c) => <Tile key={c.name} c={c} l={l} />)}</div>
      <div class="scroll" tabIndex={0} role="group" aria-label="Channels"><table id="channels"><caption>Channels; faulty readings and silences are gaps in the curves, hatched at the foot of the chart</caption><thead><tr>{["Channel", "Latest [°C]", "Rate [K/h]", "Settled", "Ends at [°C]", "Gaps"].map((t, k) => <th key={t} scope="col" class={[1, 2, 4].includes(k) ? "num" : ""}>{t}</th>)}</tr></thead>
        <tbody>{l.channels.map((c) => { const f = foreseen(c, l); return <tr key={c.name} data-channel={c.name}><th scope="row">{c.name}</th><td class="num">{c.latest === null ? "–" : c.latest.toFixed(2)}</td><td class="num">{c.rate === null ? "–" : `${c.rate >= 0 ? "+" : ""}${c.rate.toFixed(2)} ± ${c.error!.toFixed(2)}`}</td><td>{`${MARKS[c.verdict]}\u00a0${c.verdict}`}{c.since !== null && ` since\u00a0${hour(c.since).replace(" ", "\u00a0")}`}{c.why && `: ${c.why}`}</td><td class="num">{f && f.final !== null ? `${f.final.toFixed(2)} (${f.low.toFixed(2)} to ${f.high.toFixed(2)})` : f ? "declined" : "–"}</td><td>{gaps(c)}</td></tr>; })}</tbody></table></div>
      {declined.length > 0 && <details><summary>Forecasts that were declined</summary><ul id="declined" class="detail">{declined.map(([n, f]) => <li key={n}>{n}: {nice(f!.declined)}</li>)}</ul></details>}
      <ul id="bench-notes" class="detail">{[l.synthetic ? "Synthetic data: no reading here was measured." : "", ...l.notes].filter(Boolean).map((n) => <li key={n}>{n}</li>)}</ul>
    </>
  );
}

// what each column is: by its name or the record at first, by what is chosen here from then on
function Columns() {
  const { columns: all, roles } = columns.value, used = bound.value ?? found.value?.watch.bound ?? {};
  if (!all) return null;
  const named = Object.entries(roles ?? {}), known: Offered = named.length ? ["node", "boundary", "load"].map((r) => [r, named.filter(([, role]) => role === r).map(([n]) => n)]) : [];
  const taken = (name: string, to: Binding | null) => {
    const next = { ...used };
    if (to) next[name] = to; else delete next[name];
    bound.value = next; found.value = null; void look(true);
  };
  return (
    <details id="watch-columns" open={!found.value || Boolean(found.value.watch.unused)}><summary>Columns of the log</summary>
      <div class="scroll" tabIndex={0} role="group" aria-label="Columns of the log"><table><caption>{known.length ? "What each column is, in the names of the model" : "Which columns are temperatures"}</caption>
        <thead><tr><th scope="col">Column</th><th scope="col" class="num">Range</th><th scope="col">Unit</th><th scope="col">Looks like</th><th scope="col">Is</th></tr></thead>
        <tbody>{all.map((c) => { const b = used[c.name]; return <Row key={c.name} column={c} bound={typeof b === "string" ? { node: b } : b} known={known.length ? known : [["node", [c.name]]]} taken={async (to) => taken(c.name, to)} />; })}</tbody></table></div>
      {bound.value && <button type="button" onClick={() => { bound.value = null; found.value = null; void look(true); }}>As the log names them</button>}
    </details>
  );
}

export function Watch() {
  const l = found.value, quiet = l && l.age > Math.max(10, 3 * l.step);
  useEffect(() => { if (opened.value) void look(true); return () => clearTimeout(timer); }, []);
  return (
    <main class="two" id="curves" tabIndex={-1}><Form />
      <section aria-labelledby="bench-title">
        <h2 id="bench-title" data-quiet={quiet || undefined}>{l ? `${l.file}: ${l.rows} rows over ${hour(l.end - l.begin)}; ${quiet ? `has not grown for ${l.age < 120 ? `${Math.round(l.age)} s` : `${shown(l.age / 60, 3)} min`}` : "growing"}` : opened.value ? "Waiting" : "No log is open"}</h2>
        {l ? <Shown l={l} /> : waits.value && <div id="bench-verdict"><p class="verdict" data-word="too early"><strong>… waiting</strong> {waits.value}</p></div>}
        <Columns />
      </section>
    </main>
  );
}
