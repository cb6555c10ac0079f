// Axes of a chart: round numbers, a grid, titles with units.
export function axes(g, r, inner, style, labels, chart) {
  g.font = "12px system-ui, sans-serif"; g.fillStyle = style.color; g.lineWidth = 1; g.textBaseline = "middle";
  const edge = style.getPropertyValue("--edge") || "#ccc";
  for (const [ticks, across] of [[ticksOf(r.x0, r.x1, inner.w / 90), false], [ticksOf(r.y0, r.y1, inner.h / 32), true]]) {
    for (const v of ticks.at) {
      g.strokeStyle = edge; g.globalAlpha = 0.7; g.beginPath();
      const text = (Math.abs(v) < 1e-12 ? 0 : v).toFixed(ticks.digits);
      if (across) { const y = chart.toY(v); g.moveTo(inner.x, y); g.lineTo(inner.x + inner.w, y); g.stroke(); g.globalAlpha = 1; g.textAlign = "right"; g.fillText(text, inner.x - 6, y); }
      else { const x = chart.toX(v); g.moveTo(x, inner.y); g.lineTo(x, inner.y + inner.h); g.stroke(); g.globalAlpha = 1; g.textAlign = "center"; g.fillText(text, x, inner.y + inner.h + 12); }
    }
  }
  g.textAlign = "center"; g.fillText(labels.x, inner.x + inner.w / 2, inner.y + inner.h + 30);
  g.save(); g.translate(11, inner.y + inner.h / 2); g.rotate(-Math.PI / 2); g.fillText(labels.y, 0, 0); g.restore();
}

function ticksOf(from, to, about) {
  const rough = (to - from) / Math.max(2, about), base = 10 ** Math.floor(Math.log10(rough));
  const step = base * ([1, 2, 5].find((m) => m * base >= rough) || 10), at = [];
  for (let v = Math.ceil(from / step) * step; v <= to + step * 1e-9; v += step) at.push(v);
  return { at, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}
