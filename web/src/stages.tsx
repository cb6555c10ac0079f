// The stages of a campaign: where each stands in a word and a mark, what the open one takes and hands on, verdicts, levels, swaps.
import { signal } from "@preact/signals";
import { ask, nice, shown } from "./server";
import { busy, current, desk, open, project, runStage, stage, tried, type Stage } from "./project";

const SAYS: Record<string, string> = { new: "not run yet", stale: "stale: run again", waiting: "waits for one below", failed: "✗ CANNOT BE READ" };
const MANY = 14, find = signal("");
interface Plan { part: string; old: string; new: string; freed: string[]; tests: string[]; text: string; stages: { name: string; action: string; why: string }[] }
const plan = signal<Plan | string>("");

function words(x: Stage, state: string): string {
  if (state === "running") return "running …";
  if (state !== "done") return x.says ?? SAYS[state] ?? state;
  if (x.standing) return `${x.usable ? "?" : "✗"} ${x.told.stage !== x.name ? `RESTS ON ${x.told.stage}: ` : ""}${x.standing.toUpperCase()}${x.told.accepted ? " (accepted)" : ""}`;
  if (x.open) return "? NOT JUDGED";
  return Object.keys(x.sensors).length ? `✓ RMSE to ${shown(Math.max(...Object.values(x.sensors)), 2)} K` : "values by hand";
}

export function Stages() {
  const p = project.value!, many = p.stages.length > MANY, word = find.value.trim().toLowerCase();
  if (p.kind === "deck") return null;
  const seen = p.stages.filter((x) => !many || x.name === stage.value || x.name.toLowerCase().includes(word) || x.state === word || x.standing === word);
  const counts = new Map<string, number>();
  for (const x of p.stages) counts.set(x.standing || x.state, (counts.get(x.standing || x.state) ?? 0) + 1);
  return (
    <nav class="stages" aria-label="Stages of the campaign">
      {many && <div><label>Find a stage <input id="find-stage" type="search" placeholder="name or state" value={find.value} onInput={(e) => { find.value = e.currentTarget.value; }} /></label>
        <p id="stage-count" class="soft" role="status">{p.stages.length} stages: {[...counts].map(([k, n]) => `${n} ${k}`).join(", ")}{word && `; ${seen.length} shown`}</p></div>}
      <ol id="stages">{seen.map((x) => {
        const state = p.job.ended === false && p.job.what === "run" && p.job.stage === x.name ? "running" : x.state, told = state === "done" && x.standing;
        return <li key={x.name}><button type="button" data-stage={x.name} data-state={state} data-standing={told || undefined} data-open={(state === "done" && !x.standing && Boolean(x.open)) || undefined} data-rests={(told && x.told.stage !== x.name) || undefined}
          aria-current={x.name === stage.value} title={x.because || x.open || x.why || state} onClick={() => { if (x.name !== stage.value || !desk.value) void open(x.name); }}><span>{x.name}</span><small>{words(x, state)}</small></button></li>;
      })}</ol>
    </nav>
  );
}

export function StageDetail() {
  const p = project.value!, x = current.value;
  if (!x || p.kind === "deck") return null;
  const above = p.stages.filter((y) => y.below.includes(x.name)).map((y) => y.name), undone = x.below.filter((n) => p.stages.find((y) => y.name === n)?.state !== "done");
  const stands = x.state === "done" ? (x.usable ? "Done" : "Done, but do not use its values") : ["new", "waiting"].includes(x.state) ? "Not run yet" : x.state === "failed" ? "Cannot be read" : `${x.state[0]!.toUpperCase()}${x.state.slice(1)}: ${x.why}`;
  return (
    <div id="stage-detail" class="bar">
      <button type="button" id="run-stage" disabled={busy.value} onClick={runStage}>Run {x.name}{undone.length ? ` and ${undone.join(", ")} below it` : x.state === "done" ? " again" : ""}</button>
      <span class="soft grow">{nice(`${stands}.${x.below.length ? ` Takes values of ${x.below.join(", ")}.` : ""}${above.length ? ` Hands its own to ${above.join(", ")}.` : ""}`)}</span>
      {x.standing && <p class="verdict clamp" tabIndex={0} data-word={x.usable ? "not decided" : "passed a limit"}><span><strong>{x.usable ? "?" : "✗"}</strong> {nice(`${x.because}.`)}</span></p>}
      {!x.standing && x.open && <p class="verdict" data-word="not decided"><strong>? not judged</strong> {nice(`${x.open}.`)}</p>}
      {x.verdicts.map((v) => <details key={v.record} class="detail judged" data-verdict={v.record}><summary>{nice(v.text.split("\n")[0]!)}</summary><pre tabIndex={0}>{nice(v.text)}</pre></details>)}
    </div>
  );
}

async function swap(part: string, deck: string) {
  plan.value = "Working it out …";
  const got = await tried(() => ask<Plan>("swap", { part, deck }));
  plan.value = got ?? "";
  if (!got) return;
  const due = new Set(got.stages.filter((x) => x.action !== "kept").map((x) => x.name));
  project.value = { ...project.value!, stages: project.value!.stages.map((x) => (due.has(x.name) ? { ...x, state: "stale", says: "due after the swap", why: `after ${got.part}: ${got.old} → ${got.new}` } : x)) };
}

export function Levels({ parts }: { parts: string[] }) {
  const p = project.value!, { heads, rows } = p.table, r = plan.value, kind = (k: number) => (k > 2 ? "num" : "text");
  if (p.kind === "deck") return null;
  return (
    <section id="levels" aria-labelledby="levels-title">
      <h2 id="levels-title">Levels</h2>
      {rows.length > 0 && <div class="scroll" tabIndex={0} role="group" aria-label="Coefficients by level"><table id="table"><caption>Heat transfer coefficients by level. Bold: fitted there, with its standard error; plain: fixed there; a dash: not in that model</caption>
        <thead><tr>{heads.map((h, k) => <th key={h} scope="col" class={kind(k)}>{h}</th>)}</tr></thead>
        <tbody>{rows.map((cells) => <tr key={cells.map(([t]) => t).slice(0, 3).join()}>{cells.map(([text, look], k) => (k ? <td key={k} class={`${kind(k)} ${look}`}>{text}</td> : <th key={k} scope="row">{text}</th>))}</tr>)}</tbody></table></div>}
      {parts.length > 0 && <form id="swap" class="bar" aria-label="Swap a part" onSubmit={(e) => { e.preventDefault(); const f = new FormData(e.currentTarget); void swap(String(f.get("part")), String(f.get("deck"))); }}>
        <label>Part <select id="swap-part" name="part">{parts.map((x) => <option key={x} value={x}>{x}</option>)}</select></label><label>New deck <select id="swap-deck" name="deck">{p.decks.map((x) => <option key={x} value={x}>{x}</option>)}</select></label>
        <button type="submit" disabled={busy.value}>What would a swap cost?</button></form>}
      <div id="swap-result" class="detail" aria-live="polite">{typeof r === "string" ? <p class="soft">{r}</p> : <>
        {p.stages.filter((x) => x.standing).map((x) => <p key={x.name} class="warning">{nice(`${x.name}: ${x.because}.`)}</p>)}
        <p>{r.part}: {r.old} → {r.new}. {r.freed.length} values retuned, {r.stages.filter((x) => x.action !== "kept").length} of {r.stages.length} stages due again, {r.tests.length} tests to repeat.</p>
        <ul>{r.stages.map((x) => <li key={x.name} data-action={x.action}>{nice(`${x.name}: ${x.action}, ${x.why}`)}</li>)}</ul><details><summary>In full</summary><pre tabIndex={0}>{nice(r.text)}</pre></details></>}</div>
    </section>
  );
}
