// A chart of time series on a canvas: lines and points, axes, a cursor, zoom by dragging, back by a double click.
// Drawn by hand because a redraw of a dozen sensors must end within a frame or two; see the decision note on the studio.
const ROOM = { left: 54, right: 10, top: 8, bottom: 40 };

export class Chart {
  // host: an element; labels: { x, y }; onCursor(x): called with the time under the pointer
  constructor(host, labels, onCursor = () => {}) {
    Object.assign(this, { host, labels, onCursor, series: [], hidden: new Set(), zoom: null, cursor: null, drag: null });
    this.canvas = document.createElement("canvas");
    this.tip = Object.assign(document.createElement("div"), { className: "tip", hidden: true });
    host.replaceChildren(this.canvas, this.tip);
    new ResizeObserver(() => this.draw()).observe(host);
    this.canvas.addEventListener("pointermove", (e) => this.point(e));
    this.canvas.addEventListener("pointerleave", () => { this.tip.hidden = true; });
    this.canvas.addEventListener("pointerdown", (e) => { this.drag = { from: e.offsetX, to: e.offsetX }; this.canvas.setPointerCapture(e.pointerId); });
    this.canvas.addEventListener("pointerup", () => this.released());
    this.canvas.addEventListener("dblclick", () => { this.zoom = null; this.draw(); });
  }

  // series: [{ name, x: Float64Array, y: Float64Array, kind: "line" | "points" | "dots", colour }]
  set(series) { this.series = series; this.draw(); }
  shown() { return this.series.filter((s) => !this.hidden.has(s.name)); }

  ranges() {
    let x0 = Infinity, x1 = -Infinity, y0 = Infinity, y1 = -Infinity;
    for (const s of this.shown()) for (let k = 0; k < s.x.length; k++) { const v = s.x[k]; if (v < x0) x0 = v; if (v > x1) x1 = v; }
    if (this.zoom) [x0, x1] = this.zoom;
    for (const s of this.shown()) for (let k = 0; k < s.x.length; k++) { if (s.x[k] < x0 || s.x[k] > x1) continue; const v = s.y[k]; if (v < y0) y0 = v; if (v > y1) y1 = v; }
    if (!(x1 > x0)) [x0, x1] = [0, 1];
    if (!(y1 >= y0)) [y0, y1] = [0, 1];
    const pad = (y1 - y0 || 1) * 0.05;
    return { x0, x1, y0: y0 - pad, y1: y1 + pad };
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.host, scale = window.devicePixelRatio || 1;
    if (!width || !height) return;
    if (this.canvas.width !== Math.round(width * scale) || this.canvas.height !== Math.round(height * scale)) {
      this.canvas.width = Math.round(width * scale); this.canvas.height = Math.round(height * scale);
      this.canvas.style.width = `${width}px`; this.canvas.style.height = `${height}px`;
    }
    const g = this.canvas.getContext("2d"), style = getComputedStyle(this.host), r = this.ranges();
    const inner = { w: width - ROOM.left - ROOM.right, h: height - ROOM.top - ROOM.bottom };
    this.toX = (v) => ROOM.left + ((v - r.x0) / (r.x1 - r.x0)) * inner.w;
    this.toY = (v) => ROOM.top + (1 - (v - r.y0) / (r.y1 - r.y0)) * inner.h;
    this.fromX = (p) => r.x0 + ((p - ROOM.left) / inner.w) * (r.x1 - r.x0);
    g.setTransform(scale, 0, 0, scale, 0, 0);
    g.clearRect(0, 0, width, height);
    this.axes(g, r, inner, style);
    g.save(); g.beginPath(); g.rect(ROOM.left, ROOM.top, inner.w, inner.h); g.clip();
    for (const kind of ["points", "dots", "line"]) for (const s of this.shown()) if (s.kind === kind) this.trace(g, s, r);
    if (this.cursor !== null) { g.strokeStyle = style.color; g.lineWidth = 1; g.setLineDash([4, 3]); g.beginPath(); g.moveTo(this.toX(this.cursor), ROOM.top); g.lineTo(this.toX(this.cursor), ROOM.top + inner.h); g.stroke(); g.setLineDash([]); }
    if (this.drag) { g.globalAlpha = 0.15; g.fillStyle = style.color; g.fillRect(this.drag.from, ROOM.top, this.drag.to - this.drag.from, inner.h); }
    g.restore();
  }

  trace(g, s, r) {
    g.globalAlpha = s.kind === "points" ? 0.45 : 1;
    g.fillStyle = g.strokeStyle = s.colour;
    if (s.kind === "points") { for (let k = 0; k < s.x.length; k++) if (s.x[k] >= r.x0 && s.x[k] <= r.x1) g.fillRect(this.toX(s.x[k]) - 1.2, this.toY(s.y[k]) - 1.2, 2.4, 2.4); g.globalAlpha = 1; return; }
    g.lineWidth = s.thin ? 1 : 2; g.setLineDash(s.kind === "dots" ? [2, 4] : []); g.lineJoin = "round"; g.beginPath();
    for (let k = 0; k < s.x.length; k++) { const x = this.toX(s.x[k]), y = this.toY(s.y[k]); k ? g.lineTo(x, y) : g.moveTo(x, y); }
    g.stroke(); g.setLineDash([]);
  }

  axes(g, r, inner, style) {
    g.font = "12px system-ui, sans-serif"; g.fillStyle = style.color; g.lineWidth = 1; g.textBaseline = "middle";
    const edge = style.getPropertyValue("--edge") || "#ccc";
    for (const [ticks, across] of [[ticksOf(r.x0, r.x1, inner.w / 90), false], [ticksOf(r.y0, r.y1, inner.h / 45), true]]) {
      for (const v of ticks.at) {
        g.strokeStyle = edge; g.beginPath();
        if (across) { const y = this.toY(v); g.moveTo(ROOM.left, y); g.lineTo(ROOM.left + inner.w, y); g.textAlign = "right"; g.fillText(v.toFixed(ticks.digits), ROOM.left - 6, y); }
        else { const x = this.toX(v); g.moveTo(x, ROOM.top); g.lineTo(x, ROOM.top + inner.h); g.textAlign = "center"; g.fillText(v.toFixed(ticks.digits), x, ROOM.top + inner.h + 12); }
        g.stroke();
      }
    }
    g.textAlign = "center"; g.fillText(this.labels.x, ROOM.left + inner.w / 2, ROOM.top + inner.h + 30);
    g.save(); g.translate(11, ROOM.top + inner.h / 2); g.rotate(-Math.PI / 2); g.fillText(this.labels.y, 0, 0); g.restore();
  }

  point(e) {
    if (!this.fromX) return;
    if (this.drag) { this.drag.to = e.offsetX; this.draw(); return; }
    const x = this.fromX(e.offsetX);
    let best = null;
    for (const s of this.shown()) {
      if (s.kind === "points" || !s.x.length) continue;
      const k = nearestIn(s.x, x), d = Math.abs(this.toY(s.y[k]) - e.offsetY);
      if (!best || d < best.d) best = { d, s, k };
    }
    if (!best) return;
    this.tip.hidden = best.d > 60;
    this.tip.textContent = `${best.s.name}: ${best.s.y[best.k].toFixed(2)} at ${best.s.x[best.k].toFixed(2)} h`;
    this.tip.style.left = `${Math.min(e.offsetX + 12, this.host.clientWidth - 190)}px`;
    this.tip.style.top = `${Math.max(e.offsetY - 30, 0)}px`;
    this.onCursor(x);
  }

  released() {
    const drag = this.drag;
    this.drag = null;
    if (drag && Math.abs(drag.to - drag.from) > 8) this.zoom = [this.fromX(Math.min(drag.from, drag.to)), this.fromX(Math.max(drag.from, drag.to))];
    this.draw();
  }
}

function nearestIn(list, v) {
  let low = 0, high = list.length - 1;
  while (high - low > 1) { const mid = (low + high) >> 1; list[mid] < v ? (low = mid) : (high = mid); }
  return Math.abs(list[low] - v) < Math.abs(list[high] - v) ? low : high;
}

function ticksOf(from, to, about) {
  const rough = (to - from) / Math.max(2, about), base = 10 ** Math.floor(Math.log10(rough));
  const step = base * ([1, 2, 5].find((m) => m * base >= rough) || 10), at = [];
  for (let v = Math.ceil(from / step) * step; v <= to + step * 1e-9; v += step) at.push(v);
  return { at, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}
