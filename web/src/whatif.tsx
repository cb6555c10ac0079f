// What if: the run again with another ambient, power, duration, start or gas; what was changed stands beside the result.
import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Tile } from "./results";
import { ask, nice, shown, type Compared, type Conditions, type Refused } from "./server";
import { command, draft, error, refused, told } from "./state";
import { OneOf } from "./typed";

const conditions = signal<Conditions | null>(null), result = signal<Compared | null>(null);
const asked = signal<{ boundaries: Record<string, string>; factors: Record<string, string>; duration: string; start: string; gas: string }>({ boundaries: {}, factors: {}, duration: "", start: "", gas: "air" });
const finish = signal(""), lacking = signal(""), wrong = signal<Refused | null>(null);

const highest = (v: Float32Array) => v.reduce((a, b) => Math.max(a, b), -Infinity);

async function run(more: Record<string, string> = {}) {
  const a = asked.value, in_ = (v: string, unit: string) => (v.trim() && Number.isFinite(Number(v)) ? `${v} [${unit}]` : v.trim()), kept = (o: Record<string, string>) => Object.entries(o).filter(([, v]) => v.trim());
  const body = {
    boundaries: Object.fromEntries(kept(a.boundaries).map(([k, v]) => [k, in_(v, "degC")])), factors: Object.fromEntries(kept(a.factors)),
    duration: in_(a.duration, "h"), start: in_(a.start, "degC"), gas: a.gas, ...more,
  };
  result.value = await told(() => ask<Compared>("draft/compare", body));
  wrong.value = result.value ? null : refused.value;
}

export function WhatIf() {
  const c = conditions.value, a = asked.value, r = result.value, set = (more: Partial<typeof a>) => { asked.value = { ...a, ...more }; };
  useEffect(() => { result.value = null; void told(() => ask<Conditions>("conditions")).then((made) => { conditions.value = made; lacking.value = error.value; finish.value ||= made?.finishes[0] ?? ""; }); }, [draft.value?.text, draft.value?.log?.record]);
  if (!c) return <p class="soft" id="if-lacking">{lacking.value && `No run yet: ${nice(lacking.value)}`}</p>;
  return (
    <div class="whatif">
      <form onSubmit={(e) => { e.preventDefault(); void run(); }}>
        {Object.entries(c.boundaries).map(([n, v]) => <label key={n}>{n} <OneOf of={`boundaries.${n}`} refused={wrong.value} inputMode="decimal" data-boundary={n} placeholder={shown(v)} now={a.boundaries[n] ?? ""} send={(to) => set({ boundaries: { ...a.boundaries, [n]: to } })} /> °C</label>)}
        {c.loads.map((n) => <label key={n}>{n} × <OneOf of={`factors.${n}`} refused={wrong.value} inputMode="decimal" data-factor={n} placeholder="1" now={a.factors[n] ?? ""} send={(to) => set({ factors: { ...a.factors, [n]: to } })} /></label>)}
        <label>duration <OneOf of=", duration" refused={wrong.value} id="if-duration" inputMode="decimal" placeholder={shown(c.hours)} now={a.duration} send={(duration) => set({ duration })} /> h</label>
        <label>start <OneOf of=", start" refused={wrong.value} id="if-start" inputMode="decimal" placeholder="as it is" now={a.start} send={(start) => set({ start })} /> °C</label>
        <label>gas <select id="if-gas" value={a.gas} onChange={(e) => set({ gas: e.currentTarget.value })}><option value="air">as it is</option><option value="vacuum">vacuum</option><option value="printed">without, as printed</option></select></label>
        <button id="if-run" class="main" type="submit">Run</button>
      </form>
      {r?.refused && <div class="refusal" id="if-refused"><p class="bad">{r.refused}</p>
        <label>Finish of {r.surfaces?.join(", ")} <select id="if-finish" value={finish.value} onChange={(e) => { finish.value = e.currentTarget.value; }}>{c.finishes.map((f) => <option key={f} value={f}>{f}</option>)}</select></label>
        <div class="bar"><button id="if-give" type="button" onClick={async () => { if (await command({ do: "finish", surfaces: r.surfaces, finish: finish.value })) await run(); }}>Give it in the deck</button>
          <button id="if-split" type="button" onClick={() => run({ split: finish.value })}>Split with it, for this run alone</button>
          <button id="if-printed" type="button" onClick={() => { set({ gas: "printed" }); void run({ gas: "printed" }); }}>As printed: an upper bound</button></div></div>}
      {r && !r.refused && <ul id="changes">{r.changes.map((w) => <li key={w}>{nice(w.replace(/[[\]]/g, ""))}</li>)}{!r.changes.length && <li>nothing was changed</li>}</ul>}
      {r?.curves && <><p class="soft key"><span class="measured">— as it is</span> <span class="simulated">- - with the changes</span></p>
        <div class="scroll" tabIndex={0} role="group" aria-label="Peaks and ends"><table id="peaks"><caption>Highest temperature and that at the end, °C</caption><thead><tr><th scope="col">Node</th><th scope="col" class="num">highest</th><th scope="col" class="num">as it is</th><th scope="col" class="num">at the end</th><th scope="col" class="num">as it is</th></tr></thead>
          <tbody>{r.curves.map((k) => <tr key={k.node}><th scope="row">{k.node}</th>{[highest(k.after), highest(k.temperatures), k.after.at(-1)!, k.temperatures.at(-1)!].map((v, i) => <td key={i} class="num">{v.toFixed(2)}</td>)}</tr>)}</tbody></table></div>
        <div class="tiles">{r.curves.map((k) => <Tile key={k.node} curve={{ name: k.node, node: k.node, times: k.after_times, simulated: k.after, seen: k.times, measured: k.temperatures }} />)}</div></>}
    </div>
  );
}
