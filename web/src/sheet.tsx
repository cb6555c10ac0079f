// The property sheet: every value of what is chosen with its unit and where it comes from; what nobody gave yet is red.
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { nice, type Element, type Field } from "./server";
import { arm, chosen, command, draft, element, focusName } from "./state";
import { Typed, useTyped, Why } from "./typed";
import { free } from "./canvas";

const plain = (name: string) => name.replaceAll("_", " ");

function Value({ of, field }: { of: Element; field: Field }) {
  const { text: number, setText: setNumber, why, sent } = useTyped(field.number, [of.table, of.name, field.unit, field.missing].join()), [source, setSource] = useState(field.missing ? "" : field.source);
  // the field keeps the focus while what it shows is another
  useEffect(() => { setSource(field.missing ? "" : field.source); }, [of.table, of.name, field.source, field.missing]);
  const keys = [of.table, of.name, field.name];
  const write = (value: string, unit: string, from: string) => {
    const [, bare, own] = /^\s*([-+0-9.eE]+)\s*([^\[\]]*?)\s*$/.exec(value) ?? [];
    void sent(command({ do: "set", keys, value: bare ? `${bare} [${own || unit}]` : value, source: from }), value);
  };
  const id = `field-${field.name}`;
  if (field.law) return <div class="field"><span>{plain(field.name)}</span><span class="soft">a law or table; edit it in the text</span></div>;
  return (
    <div class={`field ${field.missing ? "lacking" : ""}`}>
      <label for={id}>{plain(field.name)}{field.missing && <em> not given yet</em>}</label>
      <input id={id} type="text" inputMode="decimal" autocomplete="off" value={number} aria-invalid={why ? "true" : undefined} aria-describedby={[why && `${id}-why`, (field.low || field.spread) && `${id}-range`].filter(Boolean).join(" ") || undefined} onInput={(e) => setNumber(e.currentTarget.value)}
        onChange={(e) => write(e.currentTarget.value, field.unit, source)} onKeyDown={(e) => { if (e.key === "Enter" && field.missing && number === field.number) write(number, field.unit, source); }} />
      <select aria-label={`Unit of ${plain(field.name)}`} value={field.unit} onChange={(e) => write(number, e.currentTarget.value, source)}>{field.units.map((u) => <option key={u} value={u}>{u === "1" ? "–" : nice(u)}</option>)}</select>
      <select aria-label={`Source of ${plain(field.name)}`} value={source} onChange={(e) => { setSource(e.currentTarget.value); if (number) write(number, field.unit, e.currentTarget.value); }}>
        <option value="">no source</option>{draft.value?.sources.map((s) => <option key={s} value={s}>{s}</option>)}
      </select>
      <Why id={`${id}-why`} why={why} now={field.number && `${field.number} ${field.expression || field.unit === "1" ? "" : field.unit}`.trim()} />
      {(field.low || field.spread) && <span id={`${id}-range`} class="soft range">{[field.low && `${nice(field.low)} to ${nice(field.high)}`, field.spread && (field.spread === "range" ? "its range" : `± ${nice(field.spread)}`)].filter(Boolean).join(", ")}</span>}
    </div>
  );
}

export function Sheet() {
  const one = element.value, state = draft.value, name = useRef<HTMLInputElement>(null), wanted = focusName.value;
  // before the page is painted: a letter that is typed at once belongs to the name, and adds nothing
  useLayoutEffect(() => { if (wanted) { name.current?.focus(); name.current?.select(); } }, [wanted]);
  if (!one || !state) return <p class="soft">Choose a node or a line to see its values.</p>;
  const place = state.places[one.name], keys = [one.table, one.name], shown = one.fields.filter((f) => f.given), rest = one.fields.filter((f) => !f.given);
  const heat = one.fields.some((f) => f.name === "mass" && f.given) ? "mass" : one.shape === "massless" ? "massless" : "capacitance";
  const loads = state.elements.filter((l) => l.table === "loads" && l.ends[0] === one.name);
  return (
    <form onSubmit={(e) => e.preventDefault()}>
      <div class="field wide"><label for="sheet-name">name of this {one.shape}</label><Typed id="sheet-name" box={name} now={one.name} of={one.table} send={async (to) => (to.trim() === one.name ? state : command({ do: "rename", keys, name: to }))} /></div>
      {one.ends.length > 0 && <p class="soft">{one.table === "submodels" ? "bound to" : one.table === "loads" ? "into" : "between"} {one.ends.join(" and ")}</p>}
      {shown.map((f) => <Value key={f.name} of={one} field={f} />)}
      {one.table === "nodes" && <div class="field wide"><label for="sheet-heat">stores heat by</label><select id="sheet-heat" value={heat} onChange={(e) => command({ do: "stored", name: one.name, how: e.currentTarget.value })}>
        <option value="capacitance">capacitance</option><option value="mass">mass and specific heat</option><option value="massless">nothing (massless)</option></select></div>}
      {one.table !== "nodes" && rest.length > 0 && <details><summary>{rest.length} more that may be given</summary>{rest.map((f) => <Value key={f.name} of={one} field={f} />)}</details>}
      {one.table === "nodes" && <label class="tick"><input type="checkbox" checked={one.sensor} onChange={(e) => command({ do: "sensor", name: one.name, on: e.currentTarget.checked })} /> sensor: its temperature is measured or judged</label>}
      {one.schedule && <Schedule of={one} />}
      {one.table === "submodels" && <Part of={one} />}
      {loads.map((l) => <button type="button" key={l.name} onClick={() => { chosen.value = `loads/${l.name}`; focusName.value++; }}>load {l.name}</button>)}
      {place && <details><summary>place</summary><div class="field"><label for="sheet-x">x, y</label>
        <input id="sheet-x" type="number" step="8" value={place[0]} onChange={(e) => command({ do: "move", name: one.name, x: Number(e.currentTarget.value), y: place[1] })} />
        <input aria-label="y" type="number" step="8" value={place[1]} onChange={(e) => command({ do: "move", name: one.name, x: place[0], y: Number(e.currentTarget.value) })} /></div></details>}
      <div class="bar">
        {place && state.palette.filter((s) => s.ends > 0 && s.name !== "sensor").length > 0 && <label>Join by <select id="join" value="" onChange={(e) => { const s = state.palette.find((p) => p.name === e.currentTarget.value); e.currentTarget.value = ""; if (s) arm(s, free(), one.name); }}>
          <option value="">…</option>{state.palette.filter((s) => s.ends > 0 && s.name !== "sensor").map((s) => <option key={s.name} value={s.name}>{s.name}</option>)}</select></label>}
        <button type="button" id="take-away" onClick={() => command({ do: "remove", keys })}>Remove</button>
      </div>
    </form>
  );
}

// on and off in turns, from the start of a run: the schedule of a load, the fan of a surface
function Schedule({ of }: { of: Element }) {
  const now = of.schedule!, timed = (v: string) => (!v.trim() || v.includes("[") ? v : `${v.trim()} [min]`);
  const write = (more: Partial<typeof now>) => command({ do: "schedule", keys: [of.table, of.name], ...now, ...more });
  const field = (key: "on" | "off", words: string) => <div class="field"><label for={`schedule-${key}`}>{words}</label><Typed id={`schedule-${key}`} inputMode="decimal" disabled={key === "off" && !now.on} now={now[key].replace(/ ?\[min\]$/, "")} of={of.name} send={(v) => write({ [key]: timed(v) })} /><span class="soft">min</span></div>;
  return (
    <details open={Boolean(now.on)}><summary id="schedule">{of.table === "surfaces" ? "schedule of its fan" : "schedule"}</summary>
      {field("on", "on for")}{field("off", "then off for")}
      <div class="field"><label for="schedule-share">left while off</label><Typed id="schedule-share" inputMode="decimal" disabled={!now.on} now={now.share} of={of.name} placeholder="0" send={(share) => write({ share })} /><span class="soft">of 1</span></div>
    </details>
  );
}

function Part({ of }: { of: Element }) {
  const state = draft.value!, bind = of.bind ?? {};
  return (
    <>
      <div class="field wide"><label for="part-use">deck</label><select id="part-use" value={of.use} onChange={(e) => command({ do: "use part", name: of.name, deck: e.currentTarget.value })}>{state.decks.map((d) => <option key={d} value={d}>{d}</option>)}</select></div>
      {Object.entries(bind).map(([need, node]) => (
        <div class="field wide" key={need}><label for={`need-${need}`}>{need} is</label><select id={`need-${need}`} value={String(node)} onChange={(e) => command({ do: "bind part", keys: [of.name, "bind", need], node: e.currentTarget.value })}>
          {state.elements.filter((n) => n.table === "nodes" || n.table === "needs").map((n) => <option key={n.name} value={n.name}>{n.name}</option>)}</select></div>
      ))}
    </>
  );
}
