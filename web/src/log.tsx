// A log: dropped or chosen, looked at, its columns bound to nodes, boundaries and loads; what a fit may find is ticked here.
import { useState } from "preact/hooks";
import { hour } from "./plot";
import { nice, shown, upload, type Binding, type Column } from "./server";
import { begin, command, draft, job, told } from "./state";
import { Typed, useTyped, Why } from "./typed";

export async function dropped(files: FileList | null | undefined) {
  const file = files?.[0];
  if (!file) return;
  const stored = await told(() => upload(file.name, file));
  if (stored) await command({ do: "log", file: stored.file });
}

const ROLES: [string, string][] = [["node", "nodes"], ["boundary", "needs"], ["load", "loads"], ["command", "loads"]];

const kelvin = (text: string) => (!text.trim() || text.includes("[") ? text.trim() : `${text.trim()} [K]`), number = (text: unknown) => String(text ?? "").replace(/ ?\[[KW]\]$/, "");

// what a column may be: its role, and the names that it may be bound to
export type Offered = [string, string[]][];
export function Row({ column, bound, known, taken, errors = false }: { column: Column; bound: Binding | undefined; known: Offered; taken: (to: Binding | null) => Promise<unknown>; errors?: boolean }) {
  const role = ROLES.find(([r]) => bound?.[r])?.[0], name = column.name, value = role ? `${role}:${bound![role]}` : "", percent = (bound?.unit ?? column.unit) === "%" || column.guess === "duty";
  const unit = useTyped(bound?.unit ?? (column.assumed ? column.unit : ""), name), full = useTyped(number(bound?.full_scale), name), choice = useTyped(value, name);
  const bind = (to: string, more: Binding = {}) => {
    const [kind, ...rest] = to.split(":"), own = unit.text.trim(), watts = full.text.trim(), dropped = [...ROLES.map(([r]) => r), "full_scale", ...(column.open ? ["unit"] : [])];
    const kept = Object.fromEntries(Object.entries(bound ?? {}).filter(([k]) => !dropped.includes(k)));
    return taken(to ? { ...kept, [kind!]: rest.join(":"), ...(column.open && own ? { unit: own } : {}), ...(kind === "load" && percent && watts ? { full_scale: /\[/.test(watts) ? watts : `${watts} [W]` } : {}), ...more } : null);
  };
  const offered = known.filter(([r]) => column.roles.includes(r)).flatMap(([r, names]) => names.map((n) => `${r}:${n}`)), warm = role === "node" || role === "boundary", used = column.used ?? [];
  const error = (kind: "noise" | "accuracy", none: string) => <td>{warm && <Typed class="unit" inputMode="decimal" data-error={`${kind} ${name}`} aria-label={`${kind} of ${name} in K`} now={number(bound![kind])} unit="K" of={name} placeholder={none} send={(t) => bind(value, { [kind]: kelvin(t) })} />}</td>;
  return (
    <tr data-column={name}>
      <th scope="row" draggable onDragStart={(e) => e.dataTransfer?.setData("text/x-column", name)} title="Drag to a node, or choose at the right">{name}</th>
      <td class="num">{column.low !== undefined && `${shown(column.low)} … ${shown(column.high)}`}</td>
      <td>{column.open ? <><input class="unit" type="text" aria-label={`Unit of ${name}`} value={unit.text} placeholder="unit" aria-invalid={unit.why ? "true" : undefined} onInput={(e) => unit.setText(e.currentTarget.value)} onChange={() => value && void unit.sent(bind(value))} /><Why id={`unit ${name}`} why={unit.why} now={bound?.unit ?? ""} /></> : nice(column.unit)}</td>
      <td class="soft">{column.guess}: {nice(column.why)}</td>
      <td>{offered.length > 0 || value ? <select aria-label={`${name} is`} value={value} onChange={(e) => void choice.sent(bind(e.currentTarget.value))}>
        <option value="">not used</option>
        {[...offered, ...(value && !offered.includes(value) ? [value] : [])].map((o) => <option key={o} value={o}>{o.replace(":", " ")}</option>)}
      </select> : used.length === 0 && <span class="soft">cannot be bound</span>}{used.length > 0 && <span> used by {used.join(", ")}</span>}
        {percent && column.roles.includes("load") && <label class="soft"> 100 % is <input class="unit" type="text" data-full={name} aria-label={`Power of ${name} at 100 %`} value={full.text} placeholder="watts" aria-invalid={full.why ? "true" : undefined} onInput={(e) => full.setText(e.currentTarget.value)} onChange={() => role === "load" && void full.sent(bind(value))} /> W</label>}
        <Why id={`use ${name}`} why={choice.why || full.why} now={value.replace(":", " ")} /></td>
      {errors && <>{error("noise", role === "node" ? "1 assumed" : "not given")}{error("accuracy", "exact")}</>}
    </tr>
  );
}

// what the fit does with a log: it uses it, is judged on it, or it is that of another logger of one test
function Uses({ log }: { log: string }) {
  const { records } = draft.value!, mine = records.find((r) => r.name === log)!, hosts = records.filter((r) => r.use !== "joined" && r.name !== log);
  const use = (to: string) => command({ do: "use", record: log, how: to.startsWith("joined") ? "joined" : to, host: to.slice(7) });
  return (
    <div class="bar" id="records">
      <label>Log <select id="record" value={mine.file} onChange={(e) => command({ do: "log", file: e.currentTarget.value })}>{records.map((r) => <option key={r.name} value={r.file}>{r.file}{r.use === "fit" ? "" : `, ${r.use}`}</option>)}</select></label>
      <label><select id="use" aria-label={`What the fit does with ${log}`} value={mine.host ? `joined ${mine.host}` : mine.use} onChange={(e) => use(e.currentTarget.value)}><option value="fit">the fit uses it</option><option value="held out">held out of the fit, which is judged on it</option>{hosts.map((r) => <option key={r.name} value={`joined ${r.name}`}>of the same test as {r.name}, by another logger</option>)}</select></label>
      {mine.use === "joined" && <label>begins <Typed id="offset" class="unit" inputMode="decimal" now={mine.offset!} unit="s" of={log} send={(value) => command({ do: "offset", record: log, value })} /> s after it{mine.offset!.includes(" to ") && "; the fit finds when"}</label>}
      {mine.use === "held out" && <><label>RMSE of each sensor at most <Typed id="limit" class="unit" inputMode="decimal" now={number(mine.limit)} unit="K" of={log} send={(v) => command({ do: "limit", record: log, value: kelvin(v) })} /> K</label><span class="soft">Correlate judges it when the stage was run.</span></>}
      <button id="take-out" type="button" onClick={() => use("none")}>Take it out</button>
    </div>
  );
}

export function Log() {
  const state = draft.value!, log = state.log, [over, setOver] = useState(false);
  const ticked = state.parameters.filter((p) => p.free).map((p) => p.path);
  const running = job.value.ended === false, bound = log ? Object.keys(log.channels).length : 0;
  return (
    <div class="log">
      <div class={`drop ${over ? "over" : ""}`} onDragOver={() => setOver(true)} onDragLeave={() => setOver(false)} onDrop={() => setOver(false)}>
        <label>Drop a log here, or <input id="log-file" type="file" onChange={(e) => dropped(e.currentTarget.files)} /></label>
        {state.logs.length > 0 && <label>or one of the folder <select id="log-known" value="" onChange={(e) => e.currentTarget.value && command({ do: "log", file: e.currentTarget.value })}><option value="">…</option>{state.logs.map((l) => <option key={l} value={l}>{l}</option>)}</select></label>}
      </div>
      {log && <>
        <Uses log={log.record} />
        <p>{log.rows} rows{log.sampling && ` over ${hour(log.sampling.length)}`}. {log.problem && <><strong class="bad">{log.problem}</strong> <label>Its time is <select id="log-time" value="" onChange={(e) => command({ do: "time", record: log.record, column: e.currentTarget.value })}><option value="">…</option>{log.columns.map((c) => <option key={c.name} value={c.name}>{c.name}</option>)}</select></label></>}{[...log.questions, ...log.notes].map((q) => <span key={q} class="soft"> {q}</span>)}</p>
        <div class="scroll" tabIndex={0} role="group" aria-label="Columns of the log"><table id="columns"><caption>Columns: drag a name to a node on the canvas, or choose what it is</caption>
          <thead><tr><th scope="col">Column</th><th scope="col" class="num">Range</th><th scope="col">Unit</th><th scope="col">Looks like</th><th scope="col">Is</th><th scope="col" title="Standard deviation of one reading">Noise [K]</th><th scope="col" title="Standard deviation of its constant error">Accuracy [K]</th></tr></thead>
          <tbody>{log.columns.filter((c) => c.guess !== "time").map((c) => { const key = c.key ?? c.name, b = log.channels[key]; return <Row key={`${log.record} ${c.name}`} errors column={c} bound={typeof b === "string" ? { node: b } : b} known={ROLES.map(([r, table]) => [r, state.elements.filter((e) => e.table === table).map((e) => e.name)])} taken={(to) => command({ do: "bind", channels: { [key]: to } })} />; })}</tbody></table></div>
        {Object.values(log.channels).some((b) => typeof b === "string" || (b.node && !b.noise)) && <p class="soft" id="assumed">Where no noise is given, 1 K is assumed of a reading. An exact thermometer has no constant error.</p>}
      </>}
      {Object.entries(state.held).length > 0 && <p class="held">No column is {Object.entries(state.held).map(([n, v]) => <label key={n}><strong>{n}</strong>: held at <Typed data-held={n} aria-label={`Temperature of ${n} for the whole log`} inputMode="decimal" now={v.replace(/ ?\[degC\]$/, "")} unit="degC" of={n} send={(v) => { const t = v.trim(); return command({ do: "hold", name: n, value: !t || t.includes("[") ? t : `${t} [degC]` }); }} /> °C </label>)}</p>}
      {state.inherited.length > 0 && <details id="inherited" open={state.inherited.length < 6}><summary>{state.inherited[0]!.path ? `${state.inherited.length} values come from stages below` : "Values come from stages below"}</summary><ul class="detail">{state.inherited.map((v) => <li key={v.path}>{v.path && <strong>{v.path} </strong>}{nice(v.words)}</li>)}</ul></details>}
      <fieldset id="free"><legend>A fit finds</legend>{state.parameters.map((p) => (
        <label class="tick" key={p.path}><input type="checkbox" checked={p.free} data-path={p.path} onChange={(e) => command({ do: "free", paths: e.currentTarget.checked ? [...ticked, p.path] : ticked.filter((t) => t !== p.path) })} /> {p.path} <span class="soft">{nice(p.text)}</span></label>
      ))}{!state.parameters.length && <span class="soft">Nothing to find yet.</span>}</fieldset>
      <div class="bar"><button id="run" type="button" disabled={running} onClick={() => begin("run")}>Run</button><button id="fit" type="button" class="main" disabled={running || !(bound || state.inherited.length) || !ticked.length} onClick={() => begin("fit")}>Fit {ticked.length || ""}</button>
        <span class="soft">{state.missing > 0 && `${state.missing === 1 ? "1 value is a number" : `${state.missing} values are numbers`} of the palette and not yours (red). `}{!bound && "Without a log a run is five hours in a room of 24 °C."}</span></div>
    </div>
  );
}
