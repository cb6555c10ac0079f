// What lies on a chart beside its curves: phases of a profile, limits by state, levels, bands, the worst place, gaps, a forecast.
// None of it by colour alone: phases have hatches and a name, limits a stroke by state and a label, places a ring and words.
export const STROKES = { operating: [], "non-operating": [8, 4], "start-up": [2, 3] };
const HATCH = { way: "/", wait: ".", stay: "", off: "x" };
export const PHASES = { way: "on the way", wait: "waiting for the unit", stay: "dwell", off: "switched off" };

// the range that marks ask for: limits and levels that are drawn must be seen
export function reach(marks, y0, y1) {
  for (const v of marks.values || []) if (Number.isFinite(v)) { y0 = Math.min(y0, v); y1 = Math.max(y1, v); }
  return [y0, y1];
}

function hatch(g, kind, colour) {
  const tile = document.createElement("canvas"); tile.width = tile.height = 8;
  const t = tile.getContext("2d"); t.strokeStyle = t.fillStyle = colour; t.lineWidth = 1.2;
  if (kind === "/" || kind === "x") { t.beginPath(); t.moveTo(-1, 9); t.lineTo(9, -1); t.stroke(); }
  if (kind === "x") { t.beginPath(); t.moveTo(-1, -1); t.lineTo(9, 9); t.stroke(); }
  if (kind === ".") for (const [x, y] of [[2, 2], [6, 6]]) { t.beginPath(); t.arc(x, y, 1.2, 0, 7); t.fill(); }
  if (kind === "") { t.globalAlpha = 0.55; t.fillRect(0, 0, 8, 8); }
  return g.createPattern(tile, "repeat");
}
export function swatch(kind, colour) {
  const made = document.createElement("canvas"); made.width = 26; made.height = 12;
  const g = made.getContext("2d"); g.fillStyle = hatch(g, HATCH[kind], colour); g.fillRect(0, 0, 26, 12); g.strokeStyle = colour; g.strokeRect(0.5, 0.5, 25, 11);
  return made;
}

export function drawUnder(g, chart, inner, style) {
  const { phases = [], bands = [], gaps = [] } = chart.marks, soft = style.getPropertyValue("--soft");
  g.save(); g.beginPath(); g.rect(inner.x, 0, inner.w, inner.y + inner.h); g.clip();
  const fills = Object.fromEntries(Object.entries(HATCH).map(([k, h]) => [k, hatch(g, h, soft)]));
  let cycle = null;
  for (const p of phases) {
    const x = chart.toX(p.from), w = Math.max(chart.toX(p.to) - x, 0.5);
    if (x > inner.x + inner.w || x + w < inner.x) continue;
    g.fillStyle = fills[p.kind]; g.fillRect(x, inner.y - 16, w, 12);
    if (p.kind === "off") { g.globalAlpha = 0.1; g.fillStyle = soft; g.fillRect(x, inner.y, w, inner.h); g.globalAlpha = 1; }
    if (p.cycle !== cycle) { cycle = p.cycle; g.strokeStyle = soft; g.lineWidth = 1; g.beginPath(); g.moveTo(x, inner.y - 16); g.lineTo(x, inner.y - 2); g.stroke(); }
  }
  g.strokeStyle = soft; if (phases.length) g.strokeRect(inner.x + 0.5, inner.y - 16, inner.w - 1, 12);
  for (const b of bands) {
    g.globalAlpha = 0.22; g.fillStyle = b.colour; g.beginPath();
    b.x.forEach((t, k) => { const x = chart.toX(t), y = chart.toY(b.y[k] + b.half[k]); k ? g.lineTo(x, y) : g.moveTo(x, y); });
    for (let k = b.x.length - 1; k >= 0; k--) g.lineTo(chart.toX(b.x[k]), chart.toY(b.y[k] - b.half[k]));
    g.fill(); g.globalAlpha = 1;
  }
  const crossed = hatch(g, "x", style.getPropertyValue("--warn"));
  for (const [a, b] of gaps) { const x = chart.toX(a); g.globalAlpha = 0.5; g.fillStyle = crossed; g.fillRect(x, inner.y + inner.h - 9, Math.max(chart.toX(b) - x, 3), 9); g.globalAlpha = 1; }
  g.restore();
}

// Where the label of a limit hides the least: beside its left end, further right, or on its other side; no label lies on another.
function freest(chart, inner, taken, width, x0, y, side) {
  const into = side === "upper" ? 10 : -10, last = inner.x + inner.w - width - 2;
  let best = [x0 + 4, y + into], least = Infinity;
  for (const up of [y + into, y - into]) for (let n = 0; n <= 12; n++) {
    const x = x0 + 4 + (n / 12) * Math.max(last - x0 - 4, 0);
    if (up < inner.y + 8 || up > inner.y + inner.h - 8) continue;
    let hidden = taken.some((t) => Math.abs(t.y - up) < 15 && x < t.x + t.w && x + width > t.x) ? 1e4 : 0;
    for (const s of chart.shown()) for (let k = 0; k < s.x.length; k++) { const at = chart.toX(s.x[k]); if (at > x - 4 && at < x + width + 4 && Math.abs(chart.toY(s.y[k]) - up) < 12) hidden++; }
    if (hidden < least) { least = hidden; best = [x, up]; }
    if (!hidden) return best;
  }
  return best;
}

export function drawMarks(g, chart, inner, style) {
  const { limits = [], levels = [], flags = [], ends = [] } = chart.marks, bad = style.getPropertyValue("--bad"), taken = [];
  g.font = "12px system-ui, sans-serif";
  const label = (text, x, y, colour, right) => {
    const w = g.measureText(text).width + 6;
    let at = Math.min(Math.max(right ? x - w : x, inner.x + 1), inner.x + inner.w - w - 1), up = Math.min(Math.max(y, inner.y + 8), inner.y + inner.h - 8);
    for (let n = 0; n < 8 && taken.some((t) => Math.abs(t.y - up) < 15 && at < t.x + t.w && at + w > t.x); n++) up += up > inner.y + inner.h / 2 ? -15 : 15;
    taken.push({ x: at, y: up, w });
    g.globalAlpha = 0.85; g.fillStyle = style.getPropertyValue("--paper"); g.fillRect(at, up - 8, w, 15); g.globalAlpha = 1;
    g.fillStyle = colour; g.textAlign = "left"; g.textBaseline = "middle"; g.fillText(text, at + 3, up);
  };
  for (const l of limits) {
    const y = chart.toY(l.value), x0 = Math.max(chart.toX(l.from), inner.x), x1 = Math.min(Math.max(chart.toX(l.to), x0 + 8), inner.x + inner.w);
    if (x1 < inner.x || x0 > inner.x + inner.w) continue;
    g.strokeStyle = bad; g.lineWidth = 1.6; g.setLineDash(STROKES[l.state] || []); g.beginPath(); g.moveTo(x0, y); g.lineTo(x1, y); g.stroke(); g.setLineDash([]);
    g.lineWidth = 0.8; g.beginPath(); // short strokes on the forbidden side
    for (let x = x0 + 4; x < x1; x += 14) { g.moveTo(x, y); g.lineTo(x + 5, y + (l.side === "upper" ? -6 : 6)); }
    g.stroke();
    if (l.label) label(l.label, ...freest(chart, inner, taken, g.measureText(l.label).width + 6, x0, y, l.side), bad);
  }
  for (const l of levels) { const y = chart.toY(l.value); g.strokeStyle = style.color; g.lineWidth = 1; g.setLineDash([1, 3]); g.beginPath(); g.moveTo(inner.x, y); g.lineTo(inner.x + inner.w, y); g.stroke(); g.setLineDash([]); label(l.label, inner.x + inner.w, y, style.color, true); }
  for (const e of ends) {
    const x = chart.toX(e.x), y = chart.toY(e.value), a = chart.toY(e.low), b = chart.toY(e.high);
    g.strokeStyle = e.colour; g.lineWidth = 2; g.beginPath(); g.moveTo(x, a); g.lineTo(x, b); g.moveTo(x - 5, a); g.lineTo(x + 5, a); g.moveTo(x - 5, b); g.lineTo(x + 5, b); g.stroke();
    g.setLineDash([5, 4]); g.lineWidth = 1.2; g.beginPath(); g.moveTo(chart.toX(e.from), y); g.lineTo(x, y); g.stroke(); g.setLineDash([]);
    label(e.label, x + 6, Math.min(a, b) - 12, style.color, true);
  }
  for (const f of flags) {
    const x = chart.toX(f.x), y = chart.toY(f.y);
    g.strokeStyle = f.bad ? bad : style.color; g.lineWidth = 2; g.beginPath(); g.arc(x, y, 7, 0, 7); g.stroke();
    if (f.bad) { g.beginPath(); g.moveTo(x - 4, y - 4); g.lineTo(x + 4, y + 4); g.moveTo(x + 4, y - 4); g.lineTo(x - 4, y + 4); g.stroke(); }
    label(f.text, x + 12, y + 18, f.bad ? bad : style.color, x > inner.x + inner.w * 0.6);
  }
}
