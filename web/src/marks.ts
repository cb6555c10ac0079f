// What is drawn on a chart beside its curves: phases, limits that hold for some time, gaps, ends of forecasts; words where they hide nothing.
import type uPlot from "uplot";
import { css, type Line } from "./plot";

export interface Phase { name: string; cycle: number; kind: string; from: number; to: number; rule: string; slowest: string }
export interface Limit { value: number; side: "upper" | "lower"; state: string; from: number; to: number; label: string }
export interface Flag { x: number; y: number; bad: boolean; text: string }
export interface End { x: number; from: number; value: number; low: number; high: number; colour: string; label: string }
export interface Marks { phases?: Phase[]; limits?: Limit[]; levels?: { value: number; label: string }[]; flags?: Flag[]; gaps?: [number, number][]; ends?: End[] }
export const PHASES: Record<string, string> = { way: "on the way", wait: "waiting for the unit", stay: "dwell", off: "switched off" };
const STROKES: Record<string, number[]> = { operating: [], "non-operating": [8, 4], "start-up": [2, 3] }, SIZE = 8;

function hatch(g: CanvasRenderingContext2D, kind: string, colour: string): CanvasPattern {
  const tile = document.createElement("canvas"), r = devicePixelRatio || 1;
  tile.width = tile.height = SIZE * r;
  const t = tile.getContext("2d")!;
  t.scale(r, r); t.strokeStyle = t.fillStyle = colour; t.lineWidth = 1.2;
  if (kind === "way" || kind === "off") { t.beginPath(); t.moveTo(-1, 9); t.lineTo(9, -1); t.stroke(); }
  if (kind === "off") { t.beginPath(); t.moveTo(-1, -1); t.lineTo(9, 9); t.stroke(); }
  if (kind === "wait") for (const [x, y] of [[2, 2], [6, 6]] as const) { t.beginPath(); t.arc(x, y, 1.2, 0, 7); t.fill(); }
  if (kind === "stay") { t.globalAlpha = 0.55; t.fillRect(0, 0, SIZE, SIZE); }
  return g.createPattern(tile, "repeat")!;
}
export function swatch(kind: string): string {
  const made = document.createElement("canvas");
  made.width = 26; made.height = 12;
  const g = made.getContext("2d")!, colour = css("--soft");
  g.fillStyle = hatch(g, kind, colour); g.fillRect(0, 0, 26, 12); g.strokeStyle = colour; g.strokeRect(0.5, 0.5, 25, 11);
  return made.toDataURL();
}

export const under = (marks: Marks) => (u: uPlot) => {
  const g = u.ctx, { left, top, width, height } = u.bbox, r = devicePixelRatio || 1, x = (t: number) => u.valToPos(t, "x", true);
  g.save(); g.beginPath(); g.rect(left, 0, width, top + height); g.clip();
  for (const p of marks.phases ?? []) {
    const a = x(p.from), w = Math.max(x(p.to) - a, 0.5);
    g.fillStyle = hatch(g, p.kind, css("--soft")); g.fillRect(a, 0, w, 9 * r);
    if (p.kind === "off") { g.globalAlpha = 0.1; g.fillStyle = css("--soft"); g.fillRect(a, top, w, height); g.globalAlpha = 1; }
  }
  for (const [a, b] of marks.gaps ?? []) { g.fillStyle = hatch(g, "off", css("--warn")); g.globalAlpha = 0.6; g.fillRect(x(a), top + height - 9 * r, Math.max(x(b) - x(a), 3 * r), 9 * r); g.globalAlpha = 1; }
  g.restore();
};

export const over = (marks: Marks, lines: Line[]) => (u: uPlot) => {
  const g = u.ctx, { left, top, width, height } = u.bbox, r = devicePixelRatio || 1, X = (t: number) => u.valToPos(t, "x", true), Y = (v: number) => u.valToPos(v, "y", true), right = left + width, foot = top + height;
  const taken: [number, number, number][] = [], bad = css("--bad"), ink = css("--ink");
  g.save(); g.beginPath(); g.rect(left, top, width, height); g.clip();
  g.font = `${12 * r}px system-ui, sans-serif`; g.textAlign = "left"; g.textBaseline = "middle";
  const clear = (x: number, y: number, w: number) => {
    if (taken.some(([a, b, c]) => Math.abs(b - y) < 15 * r && x < a + c && x + w > a)) return 1e4;
    let n = 0;
    for (const l of lines) for (let k = 0; k < l.x.length; k++) { const at = X(l.x[k]!); if (at > x - 4 && at < x + w + 4 && Math.abs(Y(l.y[k]!) - y) < 12 * r) n++; }
    return n;
  };
  // where a label hides the least: beside its place, further right, above or below
  const label = (text: string, x0: number, y0: number, colour: string) => {
    const w = g.measureText(text).width + 6 * r;
    let best: [number, number] = [x0, y0], least = Infinity;
    for (const off of [11, -11, 26, -26]) for (let n = 0; n <= 10 && least > 2 * n; n++) {
      const x = Math.min(Math.max(left + 2, x0 + n / 10 * Math.max(right - w - x0, 0)), right - w - 2), y = y0 + off * r;
      if (y < top + 8 * r || y > foot - 8 * r) continue;
      const hides = clear(x, y, w) + 2 * n; // far from its place it says less
      if (hides < least) { least = hides; best = [x, y]; }
    }
    taken.push([...best, w]);
    g.globalAlpha = 0.85; g.fillStyle = css("--paper"); g.fillRect(best[0], best[1] - 8 * r, w, 15 * r); g.globalAlpha = 1;
    g.fillStyle = colour; g.fillText(text, best[0] + 3 * r, best[1]);
  };
  const stroke = (colour: string, w: number, dashes: number[], points: [number, number][]) => { g.strokeStyle = colour; g.lineWidth = w * r; g.setLineDash(dashes.map((d) => d * r)); g.beginPath(); points.forEach(([x, y], k) => (k ? g.lineTo(x, y) : g.moveTo(x, y))); g.stroke(); g.setLineDash([]); };
  for (const l of marks.limits ?? []) {
    const y = Y(l.value), a = Math.max(X(l.from), left), b = Math.min(Math.max(X(l.to), a + 8), right);
    if (b < left || a > right) continue;
    stroke(bad, 1.6, STROKES[l.state] ?? [], [[a, y], [b, y]]);
    for (let x = a + 4 * r; x < b; x += 14 * r) stroke(bad, 0.8, [], [[x, y], [x + 5 * r, y + (l.side === "upper" ? -6 : 6) * r]]); // on the forbidden side
    if (l.label) label(l.label, a + 4 * r, y, bad);
  }
  for (const l of marks.levels ?? []) { const y = Y(l.value); stroke(ink, 1, [1, 3], [[left, y], [right, y]]); label(l.label, right, y, ink); }
  for (const e of marks.ends ?? []) {
    const x = X(e.x), a = Y(e.low), b = Y(e.high);
    stroke(e.colour, 2, [], [[x, a], [x, b]]); for (const y of [a, b]) stroke(e.colour, 2, [], [[x - 5 * r, y], [x + 5 * r, y]]);
    stroke(e.colour, 1.2, [5, 4], [[X(e.from), Y(e.value)], [x, Y(e.value)]]);
    label(e.label, x - 40 * r, Math.min(a, b) - 12 * r, ink);
  }
  for (const f of marks.flags ?? []) {
    const x = X(f.x), y = Y(f.y), c = f.bad ? bad : ink;
    g.strokeStyle = c; g.lineWidth = 2 * r; g.beginPath(); g.arc(x, y, 7 * r, 0, 7); g.stroke();
    if (f.bad) { stroke(c, 2, [], [[x - 4 * r, y - 4 * r], [x + 4 * r, y + 4 * r]]); stroke(c, 2, [], [[x + 4 * r, y - 4 * r], [x - 4 * r, y + 4 * r]]); }
    label(f.text, x + 12 * r, y + 8 * r, c);
  }
  g.restore();
};
