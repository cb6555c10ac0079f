// The model as a picture: folding, what is known of a part that was clicked.
import { ask, at, make, nice, shown, tried, unitOf } from "/static/page.js";
import { filter } from "/static/sliders.js";
import { s } from "/static/state.js";

let drawing = 0;
export async function drawPicture() {
  const mine = ++drawing;
  const found = await tried(() => ask("/api/picture", { stage: s.stage, values: s.values, run: s.run, time: s.time, folded: [...s.folded] }));
  if (!found || mine !== drawing) return;
  at("picture").innerHTML = found.svg; // made by the server, every text in it escaped, and no script may run here
  const svg = at("picture").querySelector("svg");
  const wide = svg.viewBox.baseVal.width;
  svg.style.setProperty("--wide", `${0.7 * wide}px`); svg.style.setProperty("--whole", `${0.85 * wide}px`); svg.style.setProperty("--most", `${1.35 * wide}px`); // a small one neither scrolls sideways nor shouts
  mark();
}
// parts at first folded: with many, all that lie directly in the model, so that one screen holds it
const FEW = 16;
export function foldAtFirst() {
  s.folded = new Set(s.desk.parts.length > FEW ? s.desk.parts.filter((p) => !p.includes(".")) : []);
  at("fold-tools").hidden = s.desk.parts.length <= FEW;
  at("model").classList.toggle("large", s.desk.parts.length > FEW); // a row of its own, in a size that can be read
  at("find-part").value = "";
  chips();
}
function chips() {
  const word = at("find-part").value.trim().toLowerCase(), many = s.desk.parts.length > FEW;
  const seen = s.desk.parts.filter((p) => !many || (word ? p.toLowerCase().includes(word) : !s.folded.has(p) && !p.includes(".")));
  at("part-count").textContent = `${s.desk.parts.length} parts, ${s.folded.size} folded${word ? `; ${seen.length} found` : ""}`;
  at("folds").replaceChildren(...seen.map((p) => make("button", { type: "button", "aria-pressed": String(s.folded.has(p)), "data-fold": p, text: p, title: `fold or unfold ${p}`, onclick: () => fold(p) })));
}
function fold(part) {
  const held = document.activeElement?.dataset?.fold;
  s.folded.has(part) ? s.folded.delete(part) : s.folded.add(part);
  chips();
  if (held) at("folds").querySelector(`[data-fold="${CSS.escape(held)}"]`)?.focus();
  drawPicture();
}
function mark() { for (const n of at("picture").querySelectorAll(".chosen")) n.classList.remove("chosen"); if (s.chosen) for (const n of at("picture").querySelectorAll(`[data-path="${CSS.escape(s.chosen)}"]`)) n.classList.add("chosen"); }
function detail(path) {
  s.chosen = path; mark();
  const own = s.desk.sliders.filter((x) => x.path.startsWith(`${path}.`) || x.path === path);
  const list = own.map((x) => make("li", { text: `${x.path} = ${shown(s.values[x.path] ?? x.value)}${x.error === null || (s.values[x.path] ?? x.value) !== (x.found ?? x.value) ? "" : ` ± ${shown(x.error, 2)}`} ${unitOf(x)}; ${x.source || "no source given"}${x.note ? `; ${nice(x.note)}` : ""}` }));
  at("detail").replaceChildren(make("strong", { text: path }), own.length ? make("ul", {}, ...list) : make("p", { text: "Its values are derived from others, or zero." }));
  if (own.length) { at("find").value = path; filter(); }
}
at("picture").addEventListener("click", (e) => { const part = e.target.closest("[data-part]"), path = e.target.closest("[data-path]"); if (path) detail(path.dataset.path); else if (part) fold(part.dataset.part); });
at("find-part").addEventListener("input", chips);
at("fold-all").addEventListener("click", () => { s.folded = new Set(s.desk.parts.filter((p) => !p.includes("."))); chips(); drawPicture(); });
at("unfold-all").addEventListener("click", () => { s.folded = new Set(); chips(); drawPicture(); });
