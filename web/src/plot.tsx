// Curves over time by uPlot: axes with units, a cursor that all of a page share, zoom by dragging and by keys, a strip of residuals.
import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import { shown } from "./server";

export interface Line { x: ArrayLike<number>; y: ArrayLike<number>; kind: "line" | "points" | "band"; colour: string; width?: number; dash?: number[]; strip?: boolean; half?: ArrayLike<number>; low?: ArrayLike<number>; high?: ArrayLike<number> }
type Pair = [number, number];
interface Shown { x: Pair; y: Pair; data: Pair; rest: number; unit: number }
interface Props {
  lines: Line[]; label: string; unit?: string; sigma?: number; reach?: number[]; until?: number; window?: Pair | null; busy?: boolean;
  onWindow?: (w: Pair | null) => void; onTime?: (t: number) => void; over?: (u: uPlot, s: Shown) => void; under?: (u: uPlot, s: Shown) => void;
}

const STRIP = 0.3; // part of the height that residuals have
const dark = matchMedia("(prefers-color-scheme: dark)");
export const scheme = signal(dark.matches);
export const frames: number[] = []; // how long redraws took [ms]
dark.addEventListener("change", () => { scheme.value = dark.matches; });
const colours = new Map<string, string>();
export function css(name: string): string {
  const key = `${name}${scheme.peek()}`;
  if (!colours.has(key)) colours.set(key, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  return colours.get(key)!;
}
const LIGHT = ["#0072b2", "#b34700", "#007a5a", "#b0509c", "#8a6d00", "#3f7fbf", "#a3201d", "#5b6b7a", "#6a4fb3", "#2e8b8b"], DARK = ["#6db3ee", "#ff9a55", "#4fc79b", "#e39ad3", "#d6b73f", "#9cc7f2", "#ff9b94", "#a9b4c1", "#b7a3f0", "#6fd0d0"];
export const colour = (k: number) => (scheme.value ? DARK : LIGHT)[k % LIGHT.length]!;
export const dash = (k: number) => [[], [9, 3], [3, 3], [12, 3, 3, 3]][Math.floor(k / LIGHT.length) % 4]!;

export function ticks(low: number, high: number, wanted: number): number[] {
  const raw = (high - low || 1) / Math.max(wanted, 1), scale = 10 ** Math.floor(Math.log10(raw)), steps = [1, 2, 2.5, 5, 10].map((s) => s * scale);
  const from = (step: number) => { const out = []; for (let v = Math.ceil(low / step - 1e-9) * step; v <= high + 1e-9 * step; v += step) out.push(Number(v.toPrecision(10))); return out; };
  // the step that is asked for, or the next finer one that shows two values at least
  for (let k = steps.findIndex((s) => s >= raw); k >= 0; k--) { const out = from(steps[k]!); if (out.length > 1) return out; }
  return [low, high];
}
export const hour = (t: number) => (Math.abs(t) < 3600 ? `${shown(t / 60, 3)} min` : `${shown(t / 3600, 3)} h`);
export function nearest(list: ArrayLike<number>, v: number): number {
  let low = 0, high = list.length - 1;
  while (high - low > 1) { const mid = (low + high) >> 1; if (list[mid]! < v) low = mid; else high = mid; }
  return Math.abs(list[low]! - v) < Math.abs(list[high]! - v) ? low : high;
}

function ranges(p: Props): Shown {
  let x0 = Infinity, x1 = -Infinity, low = Infinity, high = -Infinity, rest = 2 * (p.sigma || 0);
  for (const l of p.lines) if (l.x.length) { x0 = Math.min(x0, l.x[0]!); x1 = Math.max(x1, l.x[l.x.length - 1]!); }
  if (p.until !== undefined) x1 = Math.max(x1, p.until);
  if (!(x1 > x0)) [x0, x1] = [0, 1];
  if (p.window) [x0, x1] = p.window;
  const meet = (v: number) => { if (v < low) low = v; if (v > high) high = v; };
  for (const l of p.lines) for (let k = 0; k < l.x.length; k++) {
    if (l.x[k]! < x0 || l.x[k]! > x1) continue;
    const v = l.y[k]!;
    if (!(v === v)) continue;
    if (l.strip) { if (v > rest) rest = v; else if (-v > rest) rest = -v; continue; }
    meet(v);
    if (l.low) { meet(l.low[k]!); meet(l.high![k]!); }
  }
  for (const v of p.reach ?? []) if (Number.isFinite(v)) meet(v);
  if (!(high >= low)) [low, high] = [0, 1];
  const pad = Math.max(0.05 * (high - low), 0.05);
  [low, high] = [low - pad, high + pad];
  const foot = p.sigma === undefined ? low : low - (high - low) * STRIP / (1 - STRIP) * 1.12;
  return { x: [x0, x1], y: [foot, high], data: [low, high], rest: 1.15 * (rest || 0.1), unit: x1 - x0 > 7200 ? 3600 : 60 };
}

function trace(u: uPlot, line: Line, s: Shown) {
  const g = u.ctx, r = devicePixelRatio || 1, scale = line.strip ? "r" : "y", n = line.x.length;
  const ax = u.valToPos(s.x[0], "x", true), bx = (u.valToPos(s.x[1], "x", true) - ax) / (s.x[1] - s.x[0]);
  const a = u.valToPos(0, scale, true), b = u.valToPos(1, scale, true) - a, X = (t: number) => ax + (t - s.x[0]) * bx, Y = (v: number) => a + v * b;
  g.strokeStyle = g.fillStyle = line.colour;
  if (line.kind === "points") {
    const size = 2.4 * r;
    g.globalAlpha = 0.6;
    for (let k = 0; k < n; k++) { const t = line.x[k]!; if (t >= s.x[0] && t <= s.x[1]) g.fillRect(X(t) - size / 2, Y(line.y[k]!) - size / 2, size, size); }
    g.globalAlpha = 1;
    return;
  }
  g.beginPath();
  if (line.kind === "band") {
    for (let k = 0; k < n; k++) { const x = X(line.x[k]!), y = Y(line.high![k]!); if (k) g.lineTo(x, y); else g.moveTo(x, y); }
    for (let k = n - 1; k >= 0; k--) g.lineTo(X(line.x[k]!), Y(line.low![k]!));
    g.globalAlpha = 0.2; g.fill(); g.globalAlpha = 1;
    return;
  }
  let down = false;
  for (let k = 0; k < n; k++) {
    const v = line.y[k]!;
    if (!(v === v)) { down = false; continue; }
    if (line.x[k + 1]! < s.x[0] || line.x[k - 1]! > s.x[1]) continue;
    if (down) g.lineTo(X(line.x[k]!), Y(v)); else g.moveTo(X(line.x[k]!), Y(v));
    down = true;
  }
  g.lineWidth = (line.width ?? 1.8) * r; g.lineJoin = "bevel"; g.setLineDash((line.dash ?? []).map((d) => d * r)); g.stroke(); g.setLineDash([]);
}

// everything on a canvas is drawn by uPlot's order of things: axes, what lies under, the lines, what lies over
function options(host: HTMLElement, now: { p: Props; s: Shown }): uPlot.Options {
  let begun = 0;
  const ink = () => css("--soft"), grid = { stroke: () => css("--edge"), width: 1 }, font = "11px system-ui, sans-serif", mark = { show: false };
  const strip = now.p.sigma !== undefined, path = (u: uPlot, k: number) => { const g = u.ctx, b = u.bbox; g.save(); g.beginPath(); g.rect(b.left, b.top, b.width, b.height); g.clip(); trace(u, now.p.lines[k - 1]!, now.s); g.restore(); return null; };
  const axis = { stroke: ink, font, grid, ticks: mark };
  const digits = (v: number, all: number[]) => { const step = all.length > 1 ? Math.abs(all[1]! - all[0]!) : 1; return v.toFixed(Math.max(0, Math.min(4, -Math.floor(Math.log10(step) + 1e-9) + (step / 10 ** Math.floor(Math.log10(step)) === 2.5 ? 1 : 0)))); };
  return {
    mode: 2, width: host.clientWidth, height: host.clientHeight, legend: { show: false }, padding: [15, strip ? 0 : 20, 0, 0],
    scales: { x: { time: false, auto: false, range: (_, a, b) => [a, b] }, y: { auto: false, range: (_, a, b) => [a, b] }, r: { auto: false, range: (_, a, b) => [a, b] } },
    series: [{}, ...now.p.lines.map(() => ({ facets: [{ scale: "x", auto: false }, { scale: "y", auto: false }], paths: path }))] as uPlot.Series[],
    axes: [
      { ...axis, scale: "x", size: 20, gap: 3, splits: () => { const d = now.s.unit; return ticks(now.s.x[0] / d, now.s.x[1] / d, host.clientWidth / 80).map((v) => v * d); }, values: (_, all) => all.map((v, k) => `${shown(v / now.s.unit, 4)}${k === all.length - 1 ? (now.s.unit === 3600 ? " h" : " min") : ""}`) },
      { ...axis, scale: "y", size: 42, gap: 4, splits: () => ticks(...now.s.data, host.clientHeight * (strip ? 1 - STRIP : 1) / 45), values: (_, all) => all.map((v) => digits(v, all)) },
      ...(strip ? [{ ...axis, scale: "r", side: 1 as const, size: 34, gap: 3, splits: () => { const m = ticks(0, now.s.rest, 2).filter((v) => v > 0 && v <= now.s.rest)[0]!; return [-m, 0, m]; }, values: (_: uPlot, all: number[]) => all.map((v) => shown(v, 2)) }] : []),
    ],
    cursor: {
      y: false, points: { show: false }, sync: { key: "time", scales: ["x", null] }, drag: { x: Boolean(now.p.onWindow), y: false, setScale: false },
      bind: { dblclick: () => () => { now.p.onWindow?.(null); return null; } },
    },
    hooks: {
      drawClear: [(u) => { begun = performance.now(); now.p.under?.(u, now.s); }],
      drawAxes: [(u) => {
        const g = u.ctx, r = devicePixelRatio || 1, { left, top, width } = u.bbox;
        g.fillStyle = css("--soft"); g.font = `${11 * r}px system-ui, sans-serif`; g.textBaseline = "alphabetic"; g.textAlign = "right"; g.fillText(now.p.unit ?? "°C", left - 4 * r, top - 5 * r);
        if (!strip) return;
        const y = (v: number) => u.valToPos(v, "r", true), sigma = now.p.sigma || 0;
        g.textAlign = "left"; g.fillText("K", left + width + 4 * r, y(now.s.rest) - 9 * r);
        g.fillStyle = css("--accent"); g.globalAlpha = 0.13; g.fillRect(left, y(2 * sigma), width, y(-2 * sigma) - y(2 * sigma)); g.globalAlpha = 1;
      }],
      draw: [(u) => { now.p.over?.(u, now.s); frames.push(performance.now() - begun); if (frames.length > 2000) frames.splice(0, 1000); }],
      setSelect: [(u) => { if (u.select.width > 6) now.p.onWindow?.([u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")]); u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false); }],
      setCursor: [(u) => { if (u.cursor.event && u.cursor.left! >= 0) now.p.onTime?.(u.posToVal(u.cursor.left!, "x")); }],
    },
  };
}

export function Plot(p: Props) {
  const host = useRef<HTMLDivElement>(null), made = useRef<uPlot | null>(null), now = useRef({ p, s: ranges(p) });
  now.current.p = p; now.current.s = ranges(p);
  const show = () => {
    const u = made.current, s = now.current.s;
    if (!u) return;
    // the strip has the lower part of the height: its scale goes on above it
    const top = s.rest * (2 / (STRIP * 0.92) - 1);
    u.batch(() => {
      u.setData([null, ...now.current.p.lines.map((l) => [l.x, l.y])] as unknown as uPlot.AlignedData, false);
      u.setScale("x", { min: s.x[0], max: s.x[1] }); u.setScale("y", { min: s.y[0], max: s.y[1] }); u.setScale("r", { min: -s.rest, max: top });
    });
  };
  const key = `${p.lines.length} ${p.sigma !== undefined} ${scheme.value}`;
  useEffect(() => {
    const box = host.current!, u = made.current = new uPlot(options(box, now.current), [null, ...p.lines.map((l) => [l.x, l.y])] as unknown as uPlot.AlignedData, box);
    show();
    const watch = new ResizeObserver(() => { if (box.clientWidth && box.clientHeight) u.setSize({ width: box.clientWidth, height: box.clientHeight }); });
    watch.observe(box);
    return () => { watch.disconnect(); u.destroy(); made.current = null; };
  }, [key]);
  useEffect(show, [p.lines, p.window, p.sigma, p.over, p.under]);
  const keys = (e: KeyboardEvent) => {
    const [a, b] = now.current.s.x, whole = ranges({ ...now.current.p, window: null }).x, to = zoomed(e.key, [a, b], whole);
    if (to === undefined || e.ctrlKey || e.metaKey || !p.onWindow) return;
    e.preventDefault();
    p.onWindow(to);
  };
  return <div class="plot" ref={host} tabIndex={0} role="application" aria-label={`${p.label}. ${p.onWindow ? "Arrows move, plus and minus zoom, 0 shows all." : ""}`} onKeyDown={keys} />;
}

// the stretch that a key asks for; null is all of it
export function zoomed(key: string, [a, b]: Pair, whole: Pair): Pair | null | undefined {
  if (key === "0" || key === "Escape") return null;
  const span = b - a, ways: Record<string, Pair> = { ArrowLeft: [a - span / 5, b - span / 5], ArrowRight: [a + span / 5, b + span / 5], "+": [a + span / 4, b - span / 4], "=": [a + span / 4, b - span / 4], "-": [a - span / 2, b + span / 2] };
  const to = ways[key];
  if (!to) return undefined;
  return to[1] - to[0] >= whole[1] - whole[0] ? null : [Math.max(to[0], whole[0]), Math.min(to[1], whole[1])];
}
