// A log: dropped or chosen, looked at, its columns bound to nodes, boundaries and loads; what a fit may find is ticked here.
import { useRef, useState } from "preact/hooks";
import { nice, shown, upload, type Binding, type Column } from "./server";
import { begin, command, draft, job, told } from "./state";

export async function dropped(files: FileList | null | undefined) {
  const file = files?.[0];
  if (!file) return;
  const stored = await told(() => upload(file.name, file));
  if (stored) await command({ do: "log", file: stored.file });
}

const ROLES: [string, string][] = [["node", "nodes"], ["boundary", "needs"], ["load", "loads"], ["command", "loads"]];

// what a column may be: its role, and the names that it may be bound to
export type Offered = [string, string[]][];
export function Row({ column, bound, known, taken, stated = false }: { column: Column; bound: Binding | undefined; known: Offered; taken: (to: Binding | null) => void; stated?: boolean }) {
  const role = ROLES.find(([r]) => bound?.[r])?.[0], unit = useRef<HTMLInputElement>(null), full = useRef<HTMLInputElement>(null), exact = useRef<HTMLInputElement>(null), sensor = role === "node" || role === "boundary";
  const value = role ? `${role}:${bound![role]}` : "", percent = (bound?.unit ?? column.unit) === "%" || column.guess === "duty";
  const bind = (to: string) => {
    const [kind, ...rest] = to.split(":"), own = unit.current?.value.trim() || (column.assumed ? column.unit : ""), watts = full.current?.value.trim(), error = exact.current?.value.trim();
    const kept = Object.fromEntries(Object.entries(bound ?? {}).filter(([k]) => !ROLES.some(([r]) => r === k) && k !== "full_scale" && k !== "unit" && k !== "accuracy"));
    taken(to ? { ...kept, [kind!]: rest.join(":"), ...(own ? { unit: own } : {}), ...(kind === "load" && percent && watts ? { full_scale: /\[/.test(watts) ? watts : `${watts} [W]` } : {}), ...(error ? { accuracy: /\[/.test(error) ? error : `${error} [K]` } : {}) } : null);
  };
  const heats = ["power", "duty"].includes(column.guess), open = column.guess === "ignored";
  const offered = known.filter(([r]) => open || (heats ? r === "load" || (column.guess === "duty" && r === "command") : r === "node" || r === "boundary"));
  return (
    <tr data-column={column.name}>
      <th scope="row" draggable onDragStart={(e) => e.dataTransfer?.setData("text/x-column", column.name)} title="Drag to a node, or choose at the right">{column.name}</th>
      <td class="num">{shown(column.low)} … {shown(column.high)}</td>
      <td>{column.assumed || !column.unit ? <input ref={unit} class="unit" type="text" aria-label={`Unit of ${column.name}`} defaultValue={bound?.unit ?? column.unit} placeholder="unit" onChange={() => value && bind(value)} /> : nice(column.unit)}</td>
      <td class="soft">{column.guess}: {column.why}</td>
      <td><select aria-label={`${column.name} is`} value={value} onChange={(e) => bind(e.currentTarget.value)}>
        <option value="">not used</option>
        {offered.flatMap(([r, names]) => names.map((n) => <option key={`${r}:${n}`} value={`${r}:${n}`}>{r} {n}</option>))}
      </select>{stated && sensor && <label class="soft" title="Standard deviation of its constant error: half of a stated ± 1 K. The fit then finds an offset."> ± <input ref={exact} class="unit" type="text" data-accuracy={column.name} aria-label={`Accuracy of ${column.name} in kelvin`} defaultValue={bound?.accuracy?.replace(/ ?\[K\]$/, "") ?? ""} placeholder="exact" onChange={() => bind(value)} /> K</label>}{percent && heats && <label class="soft"> 100 % is <input ref={full} class="unit" type="text" data-full={column.name} aria-label={`Power of ${column.name} at 100 %`} defaultValue={bound?.full_scale?.replace(/ ?\[W\]$/, "") ?? ""} placeholder="watts" onChange={() => role === "load" && bind(value)} /> W</label>}</td>
    </tr>
  );
}

export function Log() {
  const state = draft.value!, log = state.log, [over, setOver] = useState(false);
  const ticked = state.parameters.filter((p) => p.free).map((p) => p.path);
  const running = job.value.ended === false, bound = log ? Object.keys(log.channels).length : 0;
  const exact = Object.entries(log?.channels ?? {}).filter(([, b]) => typeof b === "string" || ((b.node || b.boundary) && !b.accuracy)).map(([name]) => name);
  return (
    <div class="log">
      <div class={`drop ${over ? "over" : ""}`} onDragOver={() => setOver(true)} onDragLeave={() => setOver(false)} onDrop={() => setOver(false)}>
        <label>Drop a log here, or <input id="log-file" type="file" onChange={(e) => dropped(e.currentTarget.files)} /></label>
        {state.logs.length > 0 && <label>or one of the folder <select id="log-known" value="" onChange={(e) => e.currentTarget.value && command({ do: "log", file: e.currentTarget.value })}><option value="">…</option>{state.logs.map((l) => <option key={l} value={l}>{l}</option>)}</select></label>}
      </div>
      {log && <>
        <p>{log.file}: {log.rows} rows{log.others > 0 && `, ${log.others} more records in the campaign`}. {log.problem && <strong class="bad">{log.problem}</strong>}{[...log.questions, ...log.notes].map((q) => <span key={q} class="soft"> {q}</span>)}</p>
        <div class="scroll" tabIndex={0} role="group" aria-label="Columns of the log"><table id="columns"><caption>Columns: drag a name to a node on the canvas, or choose what it is</caption>
          <thead><tr><th scope="col">Column</th><th scope="col" class="num">Range</th><th scope="col">Unit</th><th scope="col">Looks like</th><th scope="col">Is</th></tr></thead>
          <tbody>{log.columns.filter((c) => c.guess !== "time").map((c) => { const b = log.channels[c.name]; return <Row key={c.name} stated column={c} bound={typeof b === "string" ? { node: b } : b} known={ROLES.map(([r, table]) => [r, state.elements.filter((e) => e.table === table).map((e) => e.name)])} taken={(to) => void command({ do: "bind", channels: { [c.name]: to } })} />; })}</tbody></table></div>
      </>}
      {exact.length > 0 && <p class="soft" id="exact">No accuracy is stated for {exact.join(", ")}: a fit takes {exact.length > 1 ? "them" : "it"} as exact, and offsets of sensors then go into the values. State ± in kelvin.</p>}
      {Object.entries(state.held).length > 0 && <p class="held">No column is {Object.entries(state.held).map(([n, v]) => <label key={n}><strong>{n}</strong>: held at <input type="text" data-held={n} aria-label={`Temperature of ${n} for the whole log`} inputMode="decimal" value={v.replace(/ ?\[degC\]$/, "")} onChange={(e) => { const t = e.currentTarget.value.trim(); void command({ do: "hold", name: n, value: !t || t.includes("[") ? t : `${t} [degC]` }); }} /> °C </label>)}</p>}
      {state.inherited.length > 0 && <details id="inherited" open={state.inherited.length < 6}><summary>{state.inherited[0]!.path ? `${state.inherited.length} values come from stages below` : "Values come from stages below"}</summary><ul class="detail">{state.inherited.map((v) => <li key={v.path}>{v.path && <strong>{v.path} </strong>}{nice(v.words)}</li>)}</ul></details>}
      <fieldset id="free"><legend>A fit finds</legend>{state.parameters.map((p) => (
        <label class="tick" key={p.path}><input type="checkbox" checked={p.free} data-path={p.path} onChange={(e) => command({ do: "free", paths: e.currentTarget.checked ? [...ticked, p.path] : ticked.filter((t) => t !== p.path) })} /> {p.path} <span class="soft">{nice(p.text)}</span></label>
      ))}{!state.parameters.length && <span class="soft">Nothing to find yet.</span>}</fieldset>
      <div class="bar"><button id="run" type="button" disabled={running} onClick={() => begin("run")}>Run</button><button id="fit" type="button" class="main" disabled={running || !(bound || state.inherited.length) || !ticked.length} onClick={() => begin("fit")}>Fit {ticked.length || ""}</button>
        <span class="soft">{state.missing > 0 && `${state.missing} values are numbers of the palette and not yours (red). `}{!bound && "Without a log a run is five hours in a room of 24 °C."}</span></div>
    </div>
  );
}
