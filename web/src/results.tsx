// What a run or a fit gave: values, warnings first, and a chart for each sensor.
import { useMemo, useState } from "preact/hooks";
import { Plot, css, scheme, type Line } from "./plot";
import { nice, shown, type Curve } from "./server";
import { begin, command, job } from "./state";

export function Tile({ curve: c }: { curve: Curve }) {
  const [zoom, setZoom] = useState<[number, number] | null>(null), tint = scheme.value;
  const lines = useMemo<Line[]>(() => [
    ...(c.measured ? [{ x: c.seen!, y: c.measured, kind: "line", colour: css("--soft"), width: 3 } as const] : []),
    { x: c.times, y: c.simulated, kind: "line", colour: css("--accent"), dash: [6, 3] },
  ], [c.measured, c.simulated, tint]);
  return (
    <figure class="tile" data-sensor={c.name}>
      <figcaption>{c.name}{c.rmse !== undefined && c.measured && <> · RMSE {shown(c.rmse, 3)} K</>}</figcaption>
      <Plot lines={lines} label={`${c.name} over time`} window={zoom} onWindow={setZoom} />
    </figure>
  );
}

// what a fit found of the clocks of its records, in the words of the command
export const Clocks = ({ found = {} }: { found?: Record<string, string> }) => <>{Object.entries(found).map(([name, words]) => <p key={name} class="clock">{name}: <strong>{nice(words)}</strong></p>)}</>;

export function Results() {
  const { result, what } = job.value;
  if (job.value.ended === false) return <p>{what === "fit" ? `Fitting: ${job.value.evaluations ?? 0} runs, RMS ${shown(job.value.rms, 3)}` : "Running"} …</p>;
  if (!result?.runs) return <p class="soft">Nothing was run yet. <button type="button" onClick={() => begin("run")}>Run</button></p>;
  const fitted = Object.entries(result.fitted ?? {});
  return (
    <div class="results" data-what={what}>
      {what === "fit" && <section aria-label="What the fit found">
        {(result.warnings ?? []).map((w) => <p key={w} class="warning">{nice(w)}</p>)}
        <table id="fitted"><caption>Found by the fit, with its standard error</caption><thead><tr><th scope="col">Value</th><th scope="col" class="num">Found</th><th scope="col" class="num">±</th><th scope="col">Unit</th></tr></thead>
          <tbody>{fitted.map(([path, v]) => <tr key={path} data-path={path} data-value={v.value}><th scope="row">{path}</th><td class="num">{shown(v.value, 5)}</td><td class="num">{shown(v.error, 2)}</td><td>{nice(v.unit)}</td></tr>)}</tbody></table>
        <Clocks found={result.clocks} />
        <button id="take-fit" type="button" class="main" onClick={() => command({ do: "take fit" })}>Take these values into the model</button>
      </section>}
      <p class="soft key"><span class="measured">— measured</span> <span class="simulated">- - simulated</span>{what === "run" && " with the values as they are"}</p>
      <div class="tiles">{result.runs.flatMap((r) => r.curves.map((c) => <Tile key={`${r.name}/${c.name}`} curve={c} />))}</div>
    </div>
  );
}
