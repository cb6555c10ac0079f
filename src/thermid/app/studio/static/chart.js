// A chart of time series on a canvas: lines and points, axes, a cursor, zoom by dragging, keys, marks of limits and phases.
// Drawn by hand because a redraw of a dozen sensors must end within a frame or two; see the decision note on the studio.
import { axes } from "/static/axes.js";
import { studio } from "/static/page.js";
import { drawMarks, drawUnder, reach } from "/static/marks.js";
const ROOM = { left: 54, right: 10, top: 8, bottom: 40 };

export class Chart {
  // host: an element; labels: { x, y }; onCursor(x): the time under the pointer; onWindow([from, to] or null): what is shown changed
  constructor(host, labels, onCursor = () => {}, onWindow = () => {}) {
    Object.assign(this, { host, labels, onCursor, onWindow, series: [], marks: {}, hidden: new Set(), zoom: null, cursor: null, drag: null, due: 0 });
    this.canvas = document.createElement("canvas");
    this.tip = Object.assign(document.createElement("div"), { className: "tip", hidden: true });
    host.replaceChildren(this.canvas, this.tip);
    host.tabIndex = 0;
    new ResizeObserver(() => this.draw()).observe(host);
    this.canvas.addEventListener("pointermove", (e) => this.point(e));
    this.canvas.addEventListener("pointerleave", () => { this.tip.hidden = true; });
    this.canvas.addEventListener("pointerdown", (e) => { this.drag = { from: e.offsetX, to: e.offsetX, pan: e.shiftKey && this.zoom ? [...this.zoom] : null }; this.canvas.setPointerCapture(e.pointerId); });
    this.canvas.addEventListener("pointerup", () => this.released());
    this.canvas.addEventListener("dblclick", () => this.look(null));
    host.addEventListener("keydown", (e) => this.key(e));
  }

  // series: [{ name, x, y: Float64Array, kind: "line" | "points" | "dots", colour, dash, wide }]; a gap in y is NaN
  set(series, marks = {}) { this.series = series; this.marks = marks; this.draw(); }
  shown() { return this.series.filter((s) => !this.hidden.has(s.name)); }
  look(zoom, told = true) { this.zoom = zoom; this.draw(); if (told) this.onWindow(zoom); }
  draw() { if (!this.due) this.due = requestAnimationFrame(() => { this.due = 0; this.paint(); }); } // one redraw a frame, however often asked

  whole() {
    let x0 = Infinity, x1 = -Infinity;
    for (const s of this.shown()) if (s.x.length) { x0 = Math.min(x0, s.x[0]); x1 = Math.max(x1, s.x[s.x.length - 1]); }
    if (this.marks.until > x1) x1 = this.marks.until;
    return x1 > x0 ? [x0, x1] : [0, 1];
  }
  ranges() {
    const [x0, x1] = this.zoom || this.whole();
    let y0 = Infinity, y1 = -Infinity;
    for (const s of this.shown()) for (let k = 0; k < s.x.length; k++) { if (s.x[k] < x0 || s.x[k] > x1) continue; const v = s.y[k]; if (v < y0) y0 = v; if (v > y1) y1 = v; }
    [y0, y1] = reach(this.marks, y0, y1);
    if (!(y1 >= y0)) [y0, y1] = [0, 1];
    const pad = (y1 - y0 || 1) * 0.06;
    return { x0, x1, y0: y0 - pad, y1: y1 + pad };
  }

  paint() {
    const begun = performance.now();
    this.redraw();
    studio.frames.push(performance.now() - begun);
    if (studio.frames.length > 2000) studio.frames.splice(0, 1000);
  }
  redraw() {
    const { clientWidth: width, clientHeight: height } = this.host, scale = window.devicePixelRatio || 1;
    if (!width || !height) return;
    if (this.canvas.width !== Math.round(width * scale) || this.canvas.height !== Math.round(height * scale)) {
      this.canvas.width = Math.round(width * scale); this.canvas.height = Math.round(height * scale);
      this.canvas.style.width = `${width}px`; this.canvas.style.height = `${height}px`;
    }
    const g = this.canvas.getContext("2d"), style = getComputedStyle(this.host), r = this.ranges();
    const top = ROOM.top + (this.marks.phases?.length ? 18 : 0), inner = { x: ROOM.left, y: top, w: width - ROOM.left - ROOM.right, h: height - top - ROOM.bottom };
    this.toX = (v) => inner.x + ((v - r.x0) / (r.x1 - r.x0)) * inner.w;
    this.toY = (v) => inner.y + (1 - (v - r.y0) / (r.y1 - r.y0)) * inner.h;
    this.fromX = (p) => r.x0 + ((p - inner.x) / inner.w) * (r.x1 - r.x0);
    g.setTransform(scale, 0, 0, scale, 0, 0);
    g.clearRect(0, 0, width, height);
    drawUnder(g, this, inner, style);
    axes(g, r, inner, style, this.labels, this);
    g.save(); g.beginPath(); g.rect(inner.x, inner.y, inner.w, inner.h); g.clip();
    for (const kind of ["points", "dots", "line"]) for (const s of this.shown()) if (s.kind === kind) this.trace(g, s, r);
    drawMarks(g, this, inner, style);
    if (this.cursor !== null) { g.strokeStyle = style.color; g.lineWidth = 1; g.setLineDash([4, 3]); g.beginPath(); g.moveTo(this.toX(this.cursor), inner.y); g.lineTo(this.toX(this.cursor), inner.y + inner.h); g.stroke(); g.setLineDash([]); }
    if (this.drag && !this.drag.pan) { g.globalAlpha = 0.15; g.fillStyle = style.color; g.fillRect(this.drag.from, inner.y, this.drag.to - this.drag.from, inner.h); }
    g.restore();
  }

  trace(g, s, r) {
    g.globalAlpha = s.kind === "points" ? 0.45 : s.faint ? 0.6 : 1;
    g.fillStyle = g.strokeStyle = s.colour;
    if (s.kind === "points") { for (let k = 0; k < s.x.length; k++) if (s.x[k] >= r.x0 && s.x[k] <= r.x1) g.fillRect(this.toX(s.x[k]) - 1.2, this.toY(s.y[k]) - 1.2, 2.4, 2.4); g.globalAlpha = 1; return; }
    g.lineWidth = s.wide ? 3 : s.thin ? 1 : 1.8; g.setLineDash(s.kind === "dots" ? [2, 4] : s.dash || []); g.lineJoin = s.thin || s.x.length > 400 ? "bevel" : "round"; g.beginPath(); // round joins of a noisy line cost most of a redraw
    let down = false;
    for (let k = 0; k < s.x.length; k++) {
      if (Number.isNaN(s.y[k])) { down = false; continue; }
      if (s.x[k + 1] < r.x0 || s.x[k - 1] > r.x1) continue;
      const x = this.toX(s.x[k]), y = this.toY(s.y[k]);
      down ? g.lineTo(x, y) : g.moveTo(x, y); down = true;
    }
    g.stroke(); g.setLineDash([]); g.globalAlpha = 1;
  }

  point(e) {
    if (!this.fromX) return;
    if (this.drag) {
      this.drag.to = e.offsetX;
      if (this.drag.pan) { const by = this.fromX(this.drag.from) - this.fromX(e.offsetX); this.zoom = this.drag.pan.map((v) => v + by); }
      this.draw();
      return;
    }
    const x = this.fromX(e.offsetX);
    let best = null;
    for (const s of this.shown()) {
      if (s.kind === "points" || !s.x.length) continue;
      const k = nearestIn(s.x, x), d = Math.abs(this.toY(s.y[k]) - e.offsetY);
      if (!best || d < best.d) best = { d, s, k };
    }
    if (!best) return;
    this.tip.hidden = !(best.d <= 60);
    this.tip.textContent = `${best.s.name}: ${best.s.y[best.k].toFixed(2)} at ${best.s.x[best.k].toFixed(2)} h`;
    this.tip.style.left = `${Math.max(0, Math.min(e.offsetX + 12, this.host.clientWidth - this.tip.offsetWidth - 4))}px`;
    this.tip.style.top = `${Math.max(e.offsetY - 30, 0)}px`;
    this.onCursor(x);
  }

  released() {
    const drag = this.drag;
    this.drag = null;
    if (drag?.pan) this.look(this.zoom);
    else if (drag && Math.abs(drag.to - drag.from) > 8) this.look([this.fromX(Math.min(drag.from, drag.to)), this.fromX(Math.max(drag.from, drag.to))]);
    else this.draw();
  }

  // arrows pan, + and - zoom, 0 or Escape shows all
  key(e) {
    const [a, b] = this.zoom || this.whole(), span = b - a, whole = this.whole();
    const ways = { ArrowLeft: [a - span / 5, b - span / 5], ArrowRight: [a + span / 5, b + span / 5], "+": [a + span / 4, b - span / 4], "=": [a + span / 4, b - span / 4], "-": [a - span / 2, b + span / 2] };
    if (e.key === "0" || e.key === "Escape") { if (this.zoom) this.look(null); return; }
    if (!(e.key in ways) || e.ctrlKey || e.metaKey) return;
    e.preventDefault();
    const [c, d] = ways[e.key];
    this.look(d - c >= whole[1] - whole[0] ? null : [Math.max(c, whole[0]), Math.min(d, whole[1])]);
  }
}

function nearestIn(list, v) {
  let low = 0, high = list.length - 1;
  while (high - low > 1) { const mid = (low + high) >> 1; list[mid] < v ? (low = mid) : (high = mid); }
  return Math.abs(list[low] - v) < Math.abs(list[high] - v) ? low : high;
}
