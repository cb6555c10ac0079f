// The canvas: nodes as cards, what joins them as lines. Pan, zoom, drag and connect; everything by keys too.
import { useEffect, useRef, useState } from "preact/hooks";
import { nice, shown, type Element } from "./server";
import { add, arm, chosen, command, draft, focusName, idOf, nodes, pick, tool } from "./state";

const W = 152, H = 64, STEP = 8;
type Point = [number, number];
interface View { x: number; y: number; k: number }
interface Drag { kind: "pan" | "move" | "join"; node: string; from: Point; at: Point; moved: boolean }

export const view = { current: { x: 0, y: 0, k: 1 } as View, size: [800, 500] as Point };
// the card that an end is on: a node, or the part that it belongs to, whose instances are numbered
const top = (end: string) => { const first = end.split(".")[0] ?? end, whole = first.replace(/(_\d+)+$/, ""); return first in (draft.value?.places ?? {}) ? first : whole; };
const isDrawn = (e: Element) => e.ends.length === 2 && e.ends.every((end) => top(end) in (draft.value?.places ?? {}));
export const hidden = () => draft.value?.elements.filter((e) => ["conductors", "surfaces"].includes(e.table) && !isDrawn(e)) ?? [];

// where a new node has room: the middle of what is in view, then beside it
export function free(): Point {
  const places = Object.values(draft.value?.places ?? {}), { x, y, k } = view.current;
  const middle: Point = [x + view.size[0] / k / 2, y + view.size[1] / k / 2];
  for (let ring = 0; ring < 40; ring++) for (let side = 0; side < 8; side++) {
    const at: Point = [middle[0] + ring * (W + 120) * Math.round(Math.cos(side * Math.PI / 4)), middle[1] + ring * (H + 56) * Math.round(Math.sin(side * Math.PI / 4))];
    if (places.every((p) => Math.abs(p[0] - at[0]) > W + 24 || Math.abs(p[1] - at[1]) > H + 24)) return at;
  }
  return middle;
}

function edgeOf(at: Point, to: Point): Point {
  const dx = to[0] - at[0], dy = to[1] - at[1];
  if (!dx && !dy) return at;
  const s = Math.min(W / 2 / Math.abs(dx || 1e-9), H / 2 / Math.abs(dy || 1e-9));
  return [at[0] + dx * s, at[1] + dy * s];
}

// a point of a line from p over m, its middle, to q
function along(p: Point, m: Point, q: Point, t: number): Point {
  const at = (i: 0 | 1) => (1 - t) ** 2 * p[i] + 2 * t * (1 - t) * (2 * m[i] - (p[i] + q[i]) / 2) + t * t * q[i];
  return [at(0), at(1)];
}

const given = (e: Element) => e.fields.filter((f) => f.given && !["area", "htc"].includes(f.name) || (f.given && e.fields.filter((g) => g.given).length === 1));
const rounded = (text: string) => (Number.isFinite(Number(text)) ? shown(Number(text)) : text);
const cut = (text: string, most: number) => (text.length > most ? `${text.slice(0, most - 1)}…` : text);
const valueOf = (e: Element) => e.logged || given(e).map((f) => (f.law ? "by a law" : `${rounded(f.number)}${f.expression || f.unit === "1" ? "" : ` ${nice(f.unit)}`}`)).join(", ");
const turns = (e: Element) => (e.schedule?.on ? ", in turns" : "");
const lacking = (e: Element) => given(e).some((f) => f.missing);
// what nobody gave yet beside the value that is shown
const wanting = (e: Element) => e.fields.filter((f) => f.missing && !given(e).includes(f)).map((f) => `${f.name}?`).join(" ");

export function Canvas() {
  const host = useRef<SVGSVGElement>(null);
  const [box, setBox] = useState<View>(view.current);
  const [drag, setDrag] = useState<Drag | null>(null);
  // events may come faster than drawings: what is dragged is read from here, and drawn from the state
  const held = useRef<Drag | null>(null);
  const hold = (d: Drag | null) => { held.current = d; setDrag(d); };
  const state = draft.value;
  view.current = box;
  const fit = () => {
    const all = Object.values(draft.value?.places ?? {}), [w, h] = view.size;
    if (!all.length) { setBox({ x: -w / 2, y: -h / 2, k: 1 }); return; }
    const xs = all.map((p) => p[0]), ys = all.map((p) => p[1]);
    const x0 = Math.min(...xs) - W, x1 = Math.max(...xs) + W, y0 = Math.min(...ys) - H - 16, y1 = Math.max(...ys) + H + 16;
    const k = Math.min(1.2, w / (x1 - x0), h / (y1 - y0));
    setBox({ x: (x0 + x1 - w / k) / 2, y: (y0 + y1 - h / k) / 2, k });
  };
  const zoom = (by: number, at: Point = [view.size[0] / 2, view.size[1] / 2]) => setBox((b) => {
    const k = Math.min(3, Math.max(0.15, b.k * by));
    return { x: b.x + at[0] / b.k - at[0] / k, y: b.y + at[1] / b.k - at[1] / k, k };
  });
  useEffect(() => {
    const svg = host.current!, watch = new ResizeObserver(() => {
      const [wide, high] = view.size, [w, h] = view.size = [svg.clientWidth, svg.clientHeight];
      if (Math.abs(w / wide - 1) > 0.3) fit(); else setBox((b) => ({ ...b, x: b.x + (wide - w) / 2 / b.k, y: b.y + (high - h) / 2 / b.k })); // the middle stays
    });
    view.size = [svg.clientWidth, svg.clientHeight];
    watch.observe(svg);
    fit();
    // a wheel that is taken as a zoom must not scroll the page too
    const wheel = (e: WheelEvent) => { e.preventDefault(); zoom(e.deltaY < 0 ? 1.15 : 1 / 1.15, [e.offsetX, e.offsetY]); };
    svg.addEventListener("wheel", wheel, { passive: false });
    return () => { watch.disconnect(); svg.removeEventListener("wheel", wheel); };
  }, []);
  if (!state) return null;

  const at = (name: string): Point => (drag?.kind === "move" && drag.node === name ? moved(drag, state.places[name]!) : state.places[name] ?? [0, 0]);
  const here = (e: PointerEvent): Point => { const r = host.current!.getBoundingClientRect(); return [box.x + (e.clientX - r.left) / box.k, box.y + (e.clientY - r.top) / box.k]; };
  const moved = (d: Drag, from: Point): Point => [from[0] + d.at[0] - d.from[0], from[1] + d.at[1] - d.from[1]];
  const under = (p: Point) => nodes.value.find((n) => { const q = state.places[n.name]!; return Math.abs(p[0] - q[0]) < W / 2 && Math.abs(p[1] - q[1]) < H / 2; })?.name ?? "";

  function down(e: PointerEvent, kind: Drag["kind"], node = "") {
    if (e.button !== 0) return;
    e.stopPropagation();
    host.current!.setPointerCapture(e.pointerId);
    const p = here(e);
    hold({ kind, node, from: p, at: p, moved: false });
  }
  function move(e: PointerEvent) {
    const drag = held.current;
    if (!drag) return;
    const p = here(e), far = drag.moved || Math.hypot(p[0] - drag.from[0], p[1] - drag.from[1]) * box.k > 4;
    if (drag.kind === "pan" && far) setBox({ ...box, x: box.x - p[0] + drag.from[0], y: box.y - p[1] + drag.from[1] });
    hold({ ...drag, at: drag.kind === "pan" ? drag.from : p, moved: far });
  }
  function up(e: PointerEvent) {
    const drag = held.current;
    if (!drag) return;
    hold(null);
    const p = here(e);
    if (drag.kind === "join") {
      const other = under(p), shape = tool.value?.shape.ends === 2 ? tool.value.shape : state!.palette.find((s) => s.name === "conduction")!;
      tool.value = null;
      if (other && other !== drag.node) void add(shape, [drag.node, other]);
    } else if (drag.kind === "move" && drag.moved) {
      const [x, y] = moved({ ...drag, at: p }, state!.places[drag.node]!);
      void command({ do: "move", name: drag.node, x, y });
    } else if (drag.kind === "move") hit(drag.node);
    else if (!drag.moved) { chosen.value = ""; tool.value = null; }
  }
  function hit(node: string) {
    if (tool.value) { pick(node); return; }
    const found = nodes.value.find((n) => n.name === node);
    if (found) chosen.value = idOf(found);
    (host.current!.querySelector(`[data-node="${CSS.escape(node)}"]`) as SVGElement | null)?.focus();
  }

  function keys(e: KeyboardEvent) {
    const focused = (document.activeElement as SVGElement | null)?.dataset.node ?? "";
    const way = ({ ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] } as Record<string, Point>)[e.key];
    if (way && e.altKey && focused) { const p = state!.places[focused]!; void command({ do: "move", name: focused, x: p[0] + way[0] * 4 * STEP, y: p[1] + way[1] * 4 * STEP }); }
    else if (way && e.shiftKey) setBox({ ...box, x: box.x + way[0] * 64 / box.k, y: box.y + way[1] * 64 / box.k });
    else if (way) next(focused, way);
    else if ((e.key === "Enter" || e.key === " ") && focused) { const joins = tool.value; hit(focused); if (!joins && e.key === "Enter") focusName.value++; }
    else if (e.key === "+" || e.key === "=") zoom(1.2);
    else if (e.key === "-") zoom(1 / 1.2);
    else if (e.key === "0") fit();
    else return;
    e.preventDefault();
  }
  // the nearest node in a direction; without a focus the first one
  function next(from: string, way: Point) {
    const p = state!.places[from], all = nodes.value.filter((n) => n.name !== from);
    const cost = (n: Element) => { const q = state!.places[n.name]!, dx = q[0] - p![0], dy = q[1] - p![1], along = dx * way[0] + dy * way[1]; return along <= 0 ? Infinity : along + 2 * Math.abs(dx * way[1] + dy * way[0]); };
    const to = p ? all.filter((n) => cost(n) < Infinity).sort((a, b) => cost(a) - cost(b))[0] : all[0];
    if (to) (host.current!.querySelector(`[data-node="${CSS.escape(to.name)}"]`) as SVGElement).focus();
  }
  function drop(e: DragEvent) {
    const column = e.dataTransfer?.getData("text/x-column");
    if (!column) return;
    e.preventDefault();
    e.stopPropagation();
    const r = host.current!.getBoundingClientRect(), node = under([box.x + (e.clientX - r.left) / box.k, box.y + (e.clientY - r.top) / box.k]);
    const found = nodes.value.find((n) => n.name === node), one = state!.log?.columns.find((c) => c.name === column);
    if (!found || !one) return;
    const heat = ["power", "duty"].includes(one.guess) ? state!.elements.find((l) => l.table === "loads" && top(l.ends[0] ?? "") === node) : undefined;
    const role = heat ? { [one.guess === "duty" ? "command" : "load"]: heat.name } : found.table === "needs" ? { boundary: node } : { node };
    void command({ do: "bind", channels: { [one.key ?? column]: { ...role, ...(one.assumed && one.unit ? { unit: one.unit } : {}) } } });
  }

  const drawn = state.elements.filter((e) => (e.table === "conductors" || e.table === "surfaces") && isDrawn(e));
  const beside = new Map<string, number>(), parts = [...Array(19).keys()].map((k) => (k + 1) / 20);
  const bound = Object.values(state.log?.channels ?? {}).map((b) => (typeof b === "string" ? b : b.node ?? b.boundary ?? ""));
  return (
    <div class="canvas">
      <svg ref={host} role="group" aria-label="Canvas of the model. Arrows go from node to node, Alt and arrows move one, letters of the palette add." tabindex={0} id="canvas"
        class={tool.value ? "armed" : ""} onPointerDown={(e) => down(e, "pan")} onPointerMove={move} onPointerUp={up} onKeyDown={keys} onDragOver={(e) => e.preventDefault()} onDrop={drop}>
        <g transform={`scale(${box.k}) translate(${-box.x} ${-box.y})`}>
          {drawn.map((e) => {
            const a = at(top(e.ends[0]!)), b = at(top(e.ends[1]!)), pair = [...e.ends].map(top).sort().join("|"), k = beside.get(pair) ?? 0;
            beside.set(pair, k + 1);
            const p = edgeOf(a, b), q = edgeOf(b, a), side = (k % 2 ? -1 : 1) * Math.ceil(k / 2) * 44, len = Math.hypot(q[0] - p[0], q[1] - p[1]) || 1;
            const over = (off: number): Point => [(p[0] + q[0]) / 2 - (q[1] - p[1]) / len * off, (p[1] + q[1]) / 2 + (q[0] - p[0]) / len * off];
            // a line under a card would seem to end at it: it bends around
            const others = nodes.value.filter((n) => !e.ends.map(top).includes(n.name)).map((n) => at(n.name));
            const clear = (m: Point) => parts.every((t) => { const [x, y] = along(p, m, q, t); return others.every((o) => Math.abs(o[0] - x) > W / 2 + 6 || Math.abs(o[1] - y) > H / 2 + 6); });
            const mid = [0, 64, -64, 112, -112, 160, -160].map((more) => over(side + more)).find(clear) ?? over(side);
            const d = `M${p[0]} ${p[1]} Q${2 * mid[0] - (p[0] + q[0]) / 2} ${2 * mid[1] - (p[1] + q[1]) / 2} ${q[0]} ${q[1]}`, id = idOf(e);
            return (
              <g key={id} class={`wire ${e.shape} ${chosen.value === id ? "chosen" : ""} ${lacking(e) ? "lacking" : ""}`} tabindex={0} role="button" aria-pressed={chosen.value === id} aria-label={`${e.shape} ${e.name}, ${e.ends.join(" to ")}, ${valueOf(e)}`} data-wire={e.name}
                onPointerDown={(v) => { v.stopPropagation(); chosen.value = id; }} onKeyDown={(v) => { if (v.key === "Enter" || v.key === " ") { chosen.value = id; focusName.value++; v.preventDefault(); v.stopPropagation(); } }}>
                <path class="hit" d={d} /><path class="line" d={d} /><text x={mid[0]} y={mid[1] - 6} class="label">{valueOf(e).split(", ")[0] || e.name}</text><text x={mid[0]} y={mid[1] + 15} class={`label small ${wanting(e) ? "wanting" : ""}`}>{(wanting(e) || e.shape) + turns(e)}</text>
              </g>
            );
          })}
          {state.elements.filter((e) => e.table === "submodels").flatMap((e) => e.ends.map((end) => { const p = at(e.name), q = at(top(end)); return <path key={`${e.name}${end}`} class="bound" d={`M${p[0]} ${p[1]} L${q[0]} ${q[1]}`} />; }))}
          {drag?.kind === "join" && drag.moved && <path class="new" d={`M${at(drag.node)[0]} ${at(drag.node)[1]} L${drag.at[0]} ${drag.at[1]}`} />}
          {nodes.value.map((n) => {
            const [x, y] = at(n.name), id = idOf(n), heats = state.elements.filter((l) => l.table === "loads" && top(l.ends[0] ?? "") === n.name);
            const low = n.table === "submodels" ? n.use : n.table === "needs" ? "boundary" : valueOf(n) || "massless";
            return (
              <g key={id} transform={`translate(${x} ${y})`} class={`node ${n.shape} ${chosen.value === id ? "chosen" : ""} ${tool.value?.ends.includes(n.name) ? "picked" : ""} ${lacking(n) ? "lacking" : ""}`} tabindex={0} role="button" data-node={n.name}
                aria-pressed={chosen.value === id} aria-label={`${n.shape} ${n.name}, ${low}${heats.length ? `, loads ${heats.map((l) => `${l.name} ${valueOf(l)}`).join(", ")}` : ""}`} onPointerDown={(e) => down(e, "move", n.name)}>
                <rect x={-W / 2} y={-H / 2} width={W} height={H} rx={n.shape === "boundary" ? H / 2 : 8} />
                <text y={heats.length ? -10 : -2} class="name">{cut(n.name, 18)}</text><text y={heats.length ? 5 : 15} class="value">{low}</text>
                {heats.map((l, k) => <text key={l.name} y={20 + 13 * k} class={`heat ${lacking(l) ? "lacking" : ""}`} data-load={l.name} onPointerDown={(e) => { e.stopPropagation(); chosen.value = idOf(l); }}>{cut(`→ ${l.name} ${valueOf(l)}${turns(l)}`, 24)}<title>{`${l.name} ${valueOf(l)}${turns(l)}`}</title></text>)}
                {(n.sensor || bound.includes(n.name)) && <text x={W / 2 - 14} y={-H / 2 + 16} class="sensor">◉<title>{bound.includes(n.name) ? "has a column of the log" : "is measured or judged"}</title></text>}
                <circle class="handle" cx={W / 2} r={7} onPointerDown={(e) => down(e, "join", n.name)}><title>Drag to another node to join them</title></circle>
              </g>
            );
          })}
        </g>
      </svg>
      {!nodes.value.length && <p class="empty">Choose a mass in the palette, or press M. Then a boundary (B), and what joins them.</p>}
      <div class="zoom" role="group" aria-label="Zoom"><button type="button" aria-label="Zoom in" onClick={() => zoom(1.25)}>+</button><button type="button" aria-label="Zoom out" onClick={() => zoom(0.8)}>−</button><button type="button" onClick={fit}>Fit</button></div>
    </div>
  );
}

// letters of the palette, wherever the focus is but in a field
export function letter(e: KeyboardEvent): boolean {
  const shape = draft.value?.palette.find((s) => s.key === e.key.toLowerCase());
  if (!shape || e.ctrlKey || e.altKey || e.metaKey) return false;
  arm(shape, free(), (document.activeElement as SVGElement | null)?.dataset?.node ?? "");
  return true;
}
