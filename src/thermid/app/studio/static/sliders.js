// One track for each number of the decks; those that the stage fits first, the others grouped by part and found by a search.
import { at, make, shown, studio, typed, unitOf, wrong } from "/static/page.js";
import { s } from "/static/state.js";

let moved = () => {}, held = () => {}, settled = () => {};
// moved: values changed; held: a state to come back to; settled: the hand left the slider
export function slidersTell(a, b, c) { [moved, held, settled] = [a, b, c]; }

const track = (x, v) => (x.log ? Math.log(v / x.low) / Math.log(x.high / x.low) : (v - x.low) / (x.high - x.low));
const fromTrack = (x, t) => (x.log ? x.low * (x.high / x.low) ** t : x.low + t * (x.high - x.low));

export function drawSliders() {
  const groups = new Map();
  for (const x of s.desk.sliders) {
    const cut = x.path.lastIndexOf("."), part = s.desk.parts.filter((p) => x.path.startsWith(`${p}.`)).pop() || s.desk.title;
    const key = x.free ? "Fitted by this stage" : cut < 0 ? s.desk.title : part;
    groups.set(key, [...(groups.get(key) || []), x]);
  }
  // the tracks of a group are made when it is first opened: a campaign of fifty parts has hundreds of them
  at("sliders").replaceChildren(...[...groups].map(([name, list]) => {
    const open = list[0].free || groups.size === 1 || s.desk.sliders.length < 12, box = make("details", { open }, make("summary", { text: `${name} (${list.length})` }));
    box.list = list;
    if (open) fill(box); else box.addEventListener("toggle", () => fill(box), { once: true });
    return box;
  }));
  filter();
}
function fill(box) { if (box.querySelector(".slider")) return; box.append(...box.list.map(slider)); }

function slider(x) {
  const id = `s-${x.path}`, value = s.values[x.path] ?? x.value;
  const range = make("input", { type: "range", id, min: 0, max: 1, step: 0.001, value: track(x, value), "aria-valuetext": `${shown(value)} ${unitOf(x)}` });
  const number = make("input", { type: "number", step: "any", min: x.low, max: x.high, value: typed(value), "aria-label": unitOf(x) ? `${x.path} in ${unitOf(x)}` : x.path });
  const box = make("div", { class: "slider", "data-slider": x.path });
  const tick = make("input", { type: "checkbox", "aria-label": `let the fit move ${x.path}`, onchange: () => (tick.checked ? s.ticked.add(x.path) : s.ticked.delete(x.path)) });
  tick.checked = s.ticked.has(x.path);
  // an error belongs to the value that a fit found, and to no other
  const words = make("span"), say = (v) => { words.textContent = `${unitOf(x)}${x.error === null || v !== (x.found ?? x.value) ? "" : ` ± ${shown(x.error, 2)}`}  (${shown(x.low, 3)} to ${shown(x.high, 3)})`; };
  say(value);
  const set = (v) => { s.values = { ...s.values, [x.path]: v }; range.value = track(x, v); number.value = typed(v); say(v); range.setAttribute("aria-valuetext", `${shown(v)} ${unitOf(x)}`); box.classList.toggle("moved", v !== x.value); moved(); };
  range.addEventListener("input", () => { studio.begun = performance.now(); if (!range.held) { range.held = true; held(); } set(fromTrack(x, Number(range.value))); });
  range.addEventListener("change", () => { range.held = false; settled(); });
  number.addEventListener("change", () => { const v = number.value === "" ? NaN : Number(number.value); if (!(v >= x.low && v <= x.high)) { wrong(`${x.path}: ${number.value || "that"} is no number from ${shown(x.low)} to ${shown(x.high)} ${unitOf(x)}.`); number.value = typed(s.values[x.path] ?? x.value); return; } wrong(null); held(); studio.begun = performance.now(); set(v); settled(); });
  box.classList.toggle("moved", value !== x.value);
  box.append(make("div", { class: "name" }, tick, make("label", { for: id, text: x.path, title: [x.source, x.note, x.also.length ? `moves ${x.also.join(", ")} too` : ""].filter(Boolean).join("; ") })), range,
    make("div", { class: "value" }, number, words));
  return box;
}

export function filter() {
  const word = at("find").value.trim().toLowerCase();
  for (const group of document.querySelectorAll("#sliders details")) {
    const some = word === "" || group.list.some((x) => x.path.toLowerCase().includes(word));
    group.hidden = !some;
    if (word && some) { fill(group); group.open = true; }
    for (const box of group.querySelectorAll(".slider")) box.hidden = word !== "" && !box.dataset.slider.toLowerCase().includes(word);
  }
}
at("find").addEventListener("input", filter);
