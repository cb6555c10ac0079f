// What a run or a fit gave: values, warnings first, and a chart for each sensor.
import { nice, shown, type Curve } from "./server";
import { begin, command, job } from "./state";

const WIDE = 420, HIGH = 170, LEFT = 46, FOOT = 26;

function ticks(low: number, high: number, wanted: number): number[] {
  const raw = (high - low || 1) / wanted, scale = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 2.5, 5, 10].map((s) => s * scale).find((s) => s >= raw)!;
  const out = [];
  for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) out.push(Number(v.toPrecision(10)));
  return out.length > 1 ? out : [low, high];
}

export function Tile({ curve }: { curve: Curve }) {
  const sets = [curve.simulated, curve.measured].filter(Boolean) as Float32Array[];
  let low = Infinity, high = -Infinity;
  for (const set of sets) for (const v of set) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
  if (high - low < 0.2) { low -= 0.1; high += 0.1; }
  const first = curve.times[0] ?? 0, end = Math.max(curve.times[curve.times.length - 1] ?? 1, curve.seen?.[curve.seen.length - 1] ?? 0), hours = end - first > 7200, unit = hours ? 3600 : 60;
  const x = (t: number) => LEFT + (WIDE - LEFT - 8) * (t - first) / (end - first || 1), y = (v: number) => 6 + (HIGH - FOOT - 6) * (high - v) / (high - low);
  const line = (ts: Float32Array, vs: Float32Array) => { let d = "", pen = "M"; for (let k = 0; k < ts.length; k++) { const v = vs[k]!; if (!Number.isFinite(v)) { pen = "M"; continue; } d += `${pen}${x(ts[k]!).toFixed(1)} ${y(v).toFixed(1)}`; pen = "L"; } return d; };
  return (
    <figure class="tile" data-sensor={curve.name}>
      <figcaption>{curve.name}{curve.rmse !== undefined && curve.measured && <> · RMSE {shown(curve.rmse, 3)} K</>}</figcaption>
      <svg viewBox={`0 0 ${WIDE} ${HIGH}`} role="img" aria-label={`${curve.name}: ${shown(low)} to ${shown(high)} °C over ${shown((end - first) / unit, 3)} ${hours ? "h" : "min"}`}>
        {ticks(low, high, 4).map((v) => <g key={v}><line class="grid" x1={LEFT} x2={WIDE - 8} y1={y(v)} y2={y(v)} /><text x={LEFT - 5} y={y(v) + 4} text-anchor="end">{v}</text></g>)}
        {ticks(first / unit, end / unit, 5).map((t) => <text key={t} x={x(t * unit)} y={HIGH - 8} text-anchor="middle">{t}</text>)}
        <text x={WIDE - 8} y={HIGH - FOOT + 2} text-anchor="end" class="soft">{hours ? "h" : "min"} · °C</text>
        {curve.seen && curve.measured && <path class="measured" d={line(curve.seen, curve.measured)} />}
        <path class="simulated" d={line(curve.times, curve.simulated)} />
      </svg>
    </figure>
  );
}

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
        <button id="take-fit" type="button" class="main" onClick={() => command({ do: "take fit" })}>Take these values into the model</button>
      </section>}
      <p class="soft key"><span class="measured">— measured</span> <span class="simulated">- - simulated</span>{what === "run" && " with the values as they are"}</p>
      <div class="tiles">{result.runs.flatMap((r) => r.curves.map((c) => <Tile key={`${r.name}/${c.name}`} curve={c} />))}</div>
    </div>
  );
}
