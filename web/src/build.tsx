// Build: palette, canvas, sheet; below them the log, the text, what check says and what a run gave.
import { render } from "preact";
import { useEffect, useLayoutEffect, useRef } from "preact/hooks";
import { Canvas, free, hidden, letter } from "./canvas";
import { dropped, Log } from "./log";
import { Results } from "./results";
import { ask, type Draft, type Fault } from "./server";
import { Sheet } from "./sheet";
import { arm, chosen, command, compare, diff, draft, error, errors, idle, job, pane, save, take, told, tool } from "./state";
import type { Pane } from "./text";
import { WhatIf } from "./whatif";

const PANES: [typeof pane.value, string][] = [["log", "Log and fit"], ["text", "Text"], ["check", "Check"], ["results", "Results"], ["if", "What if"]];

function Text() {
  const host = useRef<HTMLDivElement>(null), editor = useRef<Pane | null>(null), state = draft.value!;
  const faults: Fault[] = state.refused ? [state.refused] : state.faults;
  useEffect(() => {
    let gone = false;
    void import("./text").then((m) => { if (gone) return; editor.current = m.open(host.current!, (text) => void command({ do: "text", text })); const at = draft.value!; editor.current.show(at.typed ?? at.text, at.refused ? [at.refused] : at.faults); });
    return () => { gone = true; editor.current?.close(); editor.current = null; };
  }, []);
  useEffect(() => editor.current?.show(state.typed ?? state.text, faults), [state]);
  return <>
    {state.refused && <p class="bad" role="status" id="refused">{state.refused.line ? `Line ${state.refused.line}: ` : ""}{state.refused.message} The model stays as it was, and nothing else is edited before it is mended. <button id="drop-text" type="button" onClick={() => command({ do: "drop text" })}>Drop what was typed</button></p>}
    <div ref={host} class="editor" id="text" />
  </>;
}

function Check() {
  const state = draft.value!;
  if (!state.faults.length) return <p>`thermid check` finds nothing.</p>;
  return <ul id="faults">{state.faults.map((f, k) => <li key={k} class={f.severity}><strong>{f.severity}</strong> {f.line && `line ${f.line}: `}{f.message}</li>)}</ul>;
}

function Saving() {
  const box = useRef<HTMLDialogElement>(null), shown = diff.value;
  useLayoutEffect(() => { if (shown) box.current?.showModal(); else box.current?.close(); }, [shown]);
  return (
    <dialog ref={box} aria-labelledby="diff-title" onClose={() => { diff.value = null; }}>
      <h2 id="diff-title">Save {shown?.files.join(", ")}</h2>
      <pre id="diff" tabIndex={0}>{shown?.diff.split("\n").map((l, k) => <span key={k} class={l.startsWith("+") ? "plus" : l.startsWith("-") ? "minus" : ""}>{`${l}\n`}</span>)}</pre>
      <div class="bar"><button id="write" type="button" class="main" autofocus onClick={save}>Write</button><button type="button" onClick={() => { diff.value = null; }}>Cancel</button></div>
    </dialog>
  );
}

function keys(e: KeyboardEvent) {
  const field = (e.target as Element).closest("input, select, textarea, .cm-editor, dialog") as HTMLElement | null, key = e.key.toLowerCase();
  if (e.ctrlKey && key === "s") { e.preventDefault(); void compare(); return; }
  if (e.key === "Escape" && !document.querySelector("dialog[open]")) { tool.value = null; document.getElementById("canvas")?.focus(); return; }
  if (field && !(field instanceof HTMLInputElement && field.type === "checkbox")) return;
  if (e.ctrlKey && (key === "z" || key === "y")) { e.preventDefault(); void command({ do: key === "y" || e.shiftKey ? "redo" : "undo" }); return; }
  if (e.key === "Delete" && chosen.value) { const at = chosen.value.indexOf("/"); void command({ do: "remove", keys: [chosen.value.slice(0, at), chosen.value.slice(at + 1)] }); return; }
  if (letter(e)) e.preventDefault();
}

function Build() {
  const state = draft.value;
  useEffect(() => {
    const fetched = () => told(() => ask<Draft>("draft")).then((d) => { if (d) take(d); }), again = () => void fetched();
    void fetched().then(() => document.getElementById("canvas")?.focus());
    document.addEventListener("keydown", keys);
    window.addEventListener("focus", again); // what another tab changed meanwhile
    const looks = setInterval(() => { // and what another program does now
      if (!document.hidden && draft.value && !diff.value) void ask<{ changed: string[] }>("draft/changed").then(({ changed }) => { if (String(changed) !== String(draft.value?.changed)) again(); }, () => undefined);
    }, 2000);
    return () => { clearInterval(looks); document.removeEventListener("keydown", keys); window.removeEventListener("focus", again); };
  }, []);
  if (!state) return <main><p role="alert" class="error" hidden={!error.value}>{error.value} <a href="/start">Start page</a></p></main>;
  const armed = tool.value, others: [string, number | string][] = [...Object.entries(state.others), ...(hidden().length ? [[`couplings to parts that are not drawn (${hidden().map((e) => e.name).slice(0, 4).join(", ")})`, hidden().length] as [string, number]] : [])], show = pane.value;
  const worst = state.faults.filter((f) => f.severity === "error").length;
  return (
    <div class="build" data-ready onDragOver={(e) => e.preventDefault()} onDrop={(e) => { e.preventDefault(); void dropped(e.dataTransfer?.files); }}>
      <header>
        <h1>{state.title}</h1><span class="soft">{state.file}{state.unsaved.length > 0 && " · not saved"}</span>
        <nav aria-label="Pages"><a href="/start">Start</a><a href="/build" aria-current="page">Build</a><a href="/">Correlate, Scenarios, Watch</a></nav>
        {state.stages.length > 1 && <label>Stage <select id="stage" value={state.stage} onChange={(e) => { chosen.value = ""; job.value = {}; void command({ do: "stage", name: e.currentTarget.value }); }}>{state.stages.map((s) => <option key={s} value={s}>{s}</option>)}</select></label>}
        <span class="grow" />
        <button id="undo" type="button" disabled={!state.undo} onClick={() => command({ do: "undo" })}>Undo</button><button id="redo" type="button" disabled={!state.redo} onClick={() => command({ do: "redo" })}>Redo</button>
        <button id="save" type="button" class="main" disabled={!state.unsaved.length} onClick={compare}>Save …</button>
      </header>
      <div role="alert" class="error" id="error" hidden={!error.value}>{error.value}</div>
      <div class="banner" role="status" hidden={!state.notice && !state.changed.length}>{state.notice} {state.changed.length > 0 && <>{state.changed.join(", ")} changed on disk since it was opened, and is not overwritten. <button type="button" id="merge" onClick={() => command({ do: "merge" })}>Merge with my edits</button> <button type="button" id="restart" onClick={() => command({ do: "restart" })}>Take the file, drop my edits</button></>}</div>
      <aside class="palette" aria-label="Palette">{state.palette.map((s) => (
        <button key={s.name} type="button" data-shape={s.name} aria-pressed={armed?.shape.name === s.name} title={s.words} disabled={s.name === "submodel" && !state.decks.length} onClick={() => arm(s, free())}><span class={`icon ${s.name}`} aria-hidden="true" />{s.name}<kbd>{s.key.toUpperCase()}</kbd></button>
      ))}</aside>
      <main aria-label="Model">
        <p class="hint" role="status">{armed ? `${armed.shape.name}: ${armed.ends.length ? `from ${armed.ends.join(", ")} to …` : armed.shape.ends === 1 ? "choose a node" : "choose the first node"} (Esc ends it)` : others.length ? `Only in the text: ${others.map(([t, n]) => `${t} (${n})`).join(", ")}` : ""}</p>
        <Canvas />
      </main>
      <aside class="sheet" aria-label="Values"><Sheet /></aside>
      <section class="below" aria-label="Log, text, check, results">
        <div class="tabs" role="group" aria-label="Panes">{PANES.map(([name, words]) => <button key={name} type="button" data-pane={name} aria-pressed={show === name} onClick={() => { pane.value = name; }}>{words}{name === "check" && state.faults.length > 0 && ` (${worst ? `${worst} errors` : state.faults.length})`}</button>)}
          {job.value.ended === false && <button type="button" onClick={() => ask("draft/stop", {})}>Stop</button>}</div>
        <div class="pane" key={show} tabIndex={0} role="region" aria-label={PANES.find(([name]) => name === show)![1]}>{show === "log" ? <Log /> : show === "text" ? <Text /> : show === "check" ? <Check /> : show === "if" ? <WhatIf /> : <Results />}</div>
      </section>
      <Saving />
    </div>
  );
}

render(<Build />, document.body);
Object.assign(window, { studio: { errors, get ready() { return idle(); } } });
