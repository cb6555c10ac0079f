// Correlate: a tile for every sensor, the worst first; the map at the time of the cursor, the values, and all of it as tables.
import { signal, useComputed } from "@preact/signals";
import { useEffect, useMemo, useRef } from "preact/hooks";
import { Plot, colour, css, dash, hour, nearest, scheme, zoomed, type Line } from "./plot";
import { ask, nice, shown, type Curve } from "./server";
import { at, choose, chosen, cursor, desk, diff, drawn, folded, given, look, misfit, order, picture, pin, pinFile, pinned, project, refresh, run, runs, stage, status, time, tried, values, valueOf, whole, zoom, type Desk } from "./project";
import { StageDetail, Levels } from "./stages";
import { Found, Tuning, Values, findValue } from "./values";

const wide = signal(false); // whether the map has the whole page
const kelvin = (v: number | null | undefined) => (v === null || v === undefined ? "–" : (Math.abs(v) < 0.0005 ? 0 : v).toFixed(3));
const hover = (t: number) => { cursor.value = t; };
const value = (list: ArrayLike<number>, v: ArrayLike<number>, t: number) => (list.length ? v[nearest(list, t)]! : NaN);

function Readout({ c }: { c: Curve }) {
  const t = cursor.value;
  if (t === null) return <span class="readout">{c.measured?.length ? `RMSE ${shown(c.rmse, 3)} K, ${shown(misfit(c), 2)} σ` : `to ${shown(Math.max(...c.simulated), 4)} °C`}</span>;
  const s = value(c.times, c.simulated, t), m = c.measured?.length ? value(c.seen!, c.measured, t) : NaN;
  return <span class="readout">{hour(t)}: {Number.isFinite(m) ? `measured ${m.toFixed(2)}, simulated ${s.toFixed(2)}, residual ${(m - s).toFixed(2)} K` : `${s.toFixed(2)} °C`}</span>;
}

function Tile({ name, worst }: { name: string; worst: boolean }) {
  const curve = useComputed(() => runs.value[run.value]?.curves.find((c) => c.name === name)), other = useComputed(() => pinned.value?.runs[run.value]?.curves), c = curve.value;
  const k = runs.value[run.value]?.curves.findIndex((x) => x.name === name) ?? 0, a = other.value?.[k], tint = scheme.value;
  const lines = useMemo<Line[]>(() => {
    if (!c) return [];
    const out: Line[] = [];
    if (c.measured?.length) out.push({ x: c.seen!, y: c.measured, kind: "points", colour: css("--soft") }, { x: c.apart!, y: c.left!, kind: "line", colour: css("--accent"), width: 1, strip: true });
    if (a) out.push({ x: a.times, y: a.simulated, kind: "line", colour: css("--warn"), width: 1.5, dash: [2, 3] });
    return [...out, { x: c.times, y: c.simulated, kind: "line", colour: css("--accent"), width: 2 }];
  }, [c?.simulated, c?.left, c?.measured, a, tint]);
  if (!c) return null;
  return (
    <figure class="tile" data-tile={name} data-worst={worst || undefined}>
      <figcaption><div class="head"><strong>{name}</strong>{c.node !== name && <span class="soft"> {c.node}</span>}</div><Readout c={c} /></figcaption>
      <Plot lines={lines} label={`${name}: ${c.measured?.length ? "measured, simulated and residual" : "simulated"} over time`} sigma={c.measured?.length ? c.sigma || 0 : undefined} window={zoom.value} onWindow={look} onTime={hover} />
    </figure>
  );
}

// what the run is given: powers, and temperatures of boundaries
function Track() {
  const all = given.value, powers = all.filter((c) => c.node.startsWith("W ")), rooms = all.filter((c) => !c.node.startsWith("W ")), tint = scheme.value;
  const [own, unit, words] = powers.length ? [powers, "W", "powers"] : [rooms, "°C", "boundaries"];
  const lines = useMemo<Line[]>(() => own.map((c, k) => ({ x: c.times, y: c.simulated, kind: "line", colour: colour(k), dash: dash(k) })), [all, tint]);
  if (!own.length) return null;
  return (
    <figure class="tile track" data-track>
      <figcaption><strong>{words}</strong> <span class="keys">{own.slice(0, 8).map((c, k) => <span key={c.name}><i style={{ borderTopColor: colour(k) }} />{c.name}</span>)}{own.length > 8 && ` and ${own.length - 8} more`}</span>{powers.length > 0 && rooms.map((c) => <span key={c.name} class="soft"> · {c.name} {shown(value(c.times, c.simulated, cursor.value ?? time.value), 4)} °C</span>)}</figcaption>
      <Plot lines={lines} unit={unit} label={`${words} over time`} window={zoom.value} onWindow={look} onTime={hover} reach={unit === "W" ? [0] : []} />
    </figure>
  );
}

function Tiles() {
  const names = order.value, all = runs.value[run.value]?.curves ?? [], host = useRef<HTMLDivElement>(null), seen = names.filter((n) => all.some((c) => c.name === n));
  return <div class="sensors" id="tiles" ref={host} data-count={seen.length} onPointerLeave={() => { cursor.value = null; }}>{seen.map((n, k) => <Tile key={`${stage.value} ${run.value} ${n}`} name={n} worst={k === 0} />)}<Track /></div>;
}

function Picture() {
  const box = useRef<HTMLDivElement>(null), d = drawn.value, now = desk.value!;
  useEffect(() => {
    if (!box.current || !d) return;
    box.current.innerHTML = d.svg; // made by the server, every text in it escaped, and no script may run here
    const svg = box.current.querySelector("svg")!;
    const { width, height } = svg.viewBox.baseVal;
    [svg.style.minWidth, svg.style.minHeight] = [`${0.87 * width}px`, `${0.87 * height}px`]; // letters that can be read
    for (const n of box.current.querySelectorAll("[data-path]")) if (chosen.value && (n as HTMLElement).dataset.path === chosen.value) n.classList.add("chosen");
  }, [d, chosen.value, wide.value]);
  const fold = (part: string) => { const next = new Set(folded.value); if (next.has(part)) next.delete(part); else next.add(part); folded.value = next; void picture(); };
  const pick = (e: Event) => {
    const target = e.target as Element, part = target.closest<HTMLElement>("[data-part]"), path = target.closest<HTMLElement>("[data-path]");
    if (path) { chosen.value = path.dataset.path!; if (now.sliders.some((x) => x.path.startsWith(`${chosen.value}.`))) findValue(chosen.value); } else if (part) fold(part.dataset.part!);
  };
  const own = now.sliders.filter((x) => x.path.startsWith(`${chosen.value}.`));
  return (
    <section id="model" class={wide.value ? "whole" : ""} aria-label="Map" onKeyDown={(e) => { if (e.key === "Escape") wide.value = false; }}>
      <div class="bar"><label class="grow">Map at <input id="time" type="range" min="0" max={whole.value[1]} step="any" value={time.value} aria-valuetext={hour(time.value)} onInput={(e) => at(Number(e.currentTarget.value))} /><output id="time-text">{hour(time.value)}</output></label>
        {now.parts.length > 0 && <label>Fold <select id="fold" value="" onChange={(e) => { const to = e.currentTarget.value; e.currentTarget.value = ""; if (to === " all") { folded.value = new Set(now.parts.filter((p) => !p.includes("."))); void picture(); } else if (to === " none") { folded.value = new Set(); void picture(); } else if (to) fold(to); }}>
          <option value="">{folded.value.size ? `${folded.value.size} of ${now.parts.length}` : "…"}</option><option value=" all">all</option><option value=" none">none</option>{now.parts.map((p) => <option key={p} value={p}>{folded.value.has(p) ? "unfold" : "fold"} {p}</option>)}</select></label>}<button type="button" id="map-whole" aria-pressed={wide.value} onClick={() => { wide.value = !wide.value; }}>{wide.value ? "Back" : "Whole page"}</button></div>
      <div id="picture" class="picture" tabIndex={0} role="group" aria-label="Map of the model: temperatures, and heat from node to node. Its numbers are in the tables below." ref={box} onClick={pick} />
      <div id="detail" class="detail" aria-live="polite">{chosen.value && <><strong>{chosen.value}</strong>{own.length ? <ul>{own.map((x) => <li key={x.path}>{x.path} = {shown(valueOf(x))} {x.unit === "1" ? "" : nice(x.unit)}; {x.source || "no source given"}{x.note && `; ${nice(x.note)}`}</li>)}</ul> : <p>Its values are derived from others, or zero.</p>}</>}</div>
    </section>
  );
}

function Tables({ now }: { now: Desk }) {
  const all = runs.value[run.value]?.curves ?? [], t = drawn.value?.table, row = (n: string, v: number, digits: number) => <tr key={n}><th scope="row">{n}</th><td class="num">{v.toFixed(digits)}</td></tr>;
  return (
    <details id="tables"><summary>Tiles and map as tables</summary>
      <div class="scroll" tabIndex={0} role="group" aria-label="Metrics per sensor"><table id="metrics"><caption>{now.measured ? "Residuals (measured less simulated) of all readings; RMSE is their root mean square" : "Nothing was measured"}</caption>
        <thead><tr><th scope="col">Sensor</th><th scope="col">Node</th><th scope="col" class="num">RMSE [K]</th><th scope="col" class="num">in σ</th><th scope="col" class="num">Mean [K]</th><th scope="col" class="num">Largest [K]</th></tr></thead>
        <tbody>{all.map((c) => <tr key={c.name} data-sensor={c.name} data-worst={c.name === order.value[0] || undefined}><th scope="row">{c.name}</th><td>{c.node}</td><td class="num">{kelvin(c.rmse)}</td><td class="num">{c.measured?.length ? shown(misfit(c), 2) : "–"}</td><td class="num">{kelvin(c.bias)}</td><td class="num">{kelvin(c.largest)}</td></tr>)}</tbody></table></div>
      {t && <div class="scroll tables" tabIndex={0} role="group" aria-label="The map as tables">
        <table id="map-temperatures"><caption>Temperatures at {hour(time.value)} [°C]</caption><tbody>{Object.entries(t.temperatures).map(([n, v]) => row(n, v, 2))}</tbody></table>
        <table id="map-heat"><caption>Heat from the first end to the second [W]</caption><tbody>{Object.entries(t.flows).map(([n, v]) => row(n, v, 4))}</tbody></table>
        <table id="map-powers"><caption>Powers [W]</caption><tbody>{Object.entries(t.powers).map(([n, v]) => row(n, v, 4))}</tbody></table></div>}
    </details>
  );
}

function verdict(now: Desk): [string, string] {
  const { state, because } = now.standing, said = project.value!.kind !== "deck" || ["credible", "unjudged"].includes(state) ? "" : `${state === "not credible" || state === "failed" ? "✗" : "?"} ${state}: ${because}. `;
  const c = (runs.value[run.value]?.curves ?? []).find((x) => x.name === order.value[0]), free = now.sliders.filter((x) => x.free), moved = now.sliders.filter((x) => valueOf(x) !== (x.found ?? x.value)).length;
  const known = free.filter((x) => x.error !== null && valueOf(x) === (x.found ?? x.value));
  const worst = !c ? "" : c.measured?.length ? `Worst sensor: ${c.name}, RMSE ${kelvin(c.rmse)} K (${shown(misfit(c), 2)} of its noise). ` : `Hottest: ${runs.value[run.value]!.curves.map((x) => [x.name, Math.max(...x.simulated)] as const).sort((a, b) => b[1] - a[1]).slice(0, 1).map(([n, v]) => `${n}, ${v.toFixed(1)} °C`).join()}. `;
  return [said, `${worst}${!now.measured ? "Nothing was measured." : known.length ? `${known.length} of ${now.sliders.length} values fitted.` : `None of ${free.length} values stands as a fit found it.`}${moved ? ` ${moved} moved.` : ""}`];
}

function Difference() {
  if (!diff.value) return null;
  const close = () => { diff.value = ""; };
  return (
    <section class="difference" aria-label="What is changed in the deck"><pre class="diff" tabIndex={0}>{diff.value.split("\n").map((l, k) => <span key={k} class={l.startsWith("+") ? "plus" : l.startsWith("-") ? "minus" : ""}>{`${l}\n`}</span>)}</pre>
      <div class="bar"><button type="button" id="write-now" class="main" autofocus onClick={() => tried(async () => { const got = await ask<{ file: string }>("write", { stage: desk.value!.title, values: values.value, diff: diff.value }); close(); status.value = `Written: ${got.file}.`; })}>Write</button><button type="button" onClick={close}>Cancel</button></div></section>
  );
}

export function Correlate() {
  const now = desk.value, p = project.value!;
  if (!now) return <main class="correlate bare"><StageDetail /></main>;
  const [loud, plain] = verdict(now), a = pinned.value, zooms = (key: string) => { const to = zoomed(key, zoom.value ?? whole.value, whole.value); if (to !== undefined) void look(to); };
  const deck = () => Object.fromEntries(now.sliders.filter((x) => x.deck !== null && x.deck !== x.value).map((x) => [x.path, x.deck!]));
  return (
    <main class="correlate">
      <section class="middle" id="curves" aria-label={now.measured ? "Measured and simulated" : "Simulated"} tabIndex={-1}>
        <StageDetail />
        <p id="worst" class="verdict" data-word={loud ? (loud.startsWith("✗") ? "passed a limit" : "not decided") : ""}>{loud && <strong>{loud}</strong>}{plain}</p>
        <div class="bar">
          <label>Record <select id="run" value={String(run.value)} onChange={(e) => choose(Number(e.currentTarget.value))}>{now.runs.map((r, k) => <option key={r.name} value={String(k)}>{r.name}</option>)}</select></label>
          <span class="keys"><span class="soft">{now.measured && "▪ measured "}</span><span><i style={{ borderTopColor: "var(--accent)" }} />{a ? "B: as shown" : "simulated"}</span>{a && <span><i class="dotted" style={{ borderTopColor: "var(--warn)" }} />A: {a.label}</span>}</span>
          <label>Compare with <select id="pin" value="" onChange={(e) => { const to = e.currentTarget.value; e.currentTarget.value = ""; if (to.startsWith(" ")) void pinFile(to.slice(1)); else if (to === "now") void pin("what was shown"); else if (to === "fit") void pin(now.fitted ? "the stage's fit" : "the stage's start", {}); else if (to === "deck") void pin("the deck", deck()); else if (to === "none") void pin(""); }}>
            <option value="">{a ? a.label : "…"}</option><option value="now">what is shown now</option><option value="fit">{now.fitted ? "the stage's fit" : "the stage's start"}</option><option value="deck">the deck</option>{p.kept.map((f) => <option key={f} value={` ${f}`}>{f}</option>)}{a && <option value="none">nothing</option>}</select></label>
          <span class="grow" /><span role="group" aria-label="Zoom" class="bar"><button type="button" aria-label="Zoom in" onClick={() => zooms("+")}>+</button><button type="button" aria-label="Zoom out" disabled={!zoom.value} onClick={() => zooms("-")}>−</button><button type="button" aria-label="Earlier" disabled={!zoom.value} onClick={() => zooms("ArrowLeft")}>←</button><button type="button" aria-label="Later" disabled={!zoom.value} onClick={() => zooms("ArrowRight")}>→</button><button type="button" id="zoom-all" disabled={!zoom.value} onClick={() => zooms("0")}>All</button></span>
        </div>
        <Tiles />
      </section>
      <div class="side">
        <Picture />
        <section id="tuning" aria-label="Values">
          <Tuning />
          <form id="save" class="bar" onSubmit={(e) => { e.preventDefault(); const name = String(new FormData(e.currentTarget).get("name")); void tried(async () => { const got = await ask<{ file: string }>("save", { stage: desk.value!.title, values: values.value, name }); status.value = `Saved as results/${got.file}.`; await refresh(); }); }}>
            <label class="grow">Name <input id="save-name" name="name" type="text" defaultValue="by hand" maxLength={60} required /></label><button type="submit">Save values</button>
            <button id="write-back" type="button" onClick={() => tried(async () => { diff.value = (await ask<{ diff: string }>("difference", { stage: desk.value!.title, values: values.value })).diff; })}>Write into the deck …</button></form>
          <Difference /><Found /><Values />
        </section>
        <Tables now={now} /><Levels parts={now.parts} />
      </div>
    </main>
  );
}
