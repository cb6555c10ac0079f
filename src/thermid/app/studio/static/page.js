// What every part of the page needs: elements, numbers as text, words from the server, errors in words.
export const at = (id) => document.getElementById(id);
export const studio = (window.studio = { latencies: [], errors: [], frames: [] });
const COLOURS = ["#0072b2", "#d55e00", "#007a5a", "#b0509c", "#8a6d00", "#3f7fbf", "#a3201d", "#5b6b7a", "#6a4fb3", "#2e8b8b", "#b36b00", "#7a3b3b"];
const LIGHT = ["#6db3ee", "#ff9a55", "#4fc79b", "#e39ad3", "#d6b73f", "#9cc7f2", "#ff9b94", "#a9b4c1", "#b7a3f0", "#6fd0d0", "#e0a24a", "#d99a9a"];
const DASHES = [[], [9, 3], [3, 3], [12, 3, 3, 3]];
const dark = matchMedia("(prefers-color-scheme: dark)");

export const colour = (k) => (dark.matches ? LIGHT : COLOURS)[k % COLOURS.length];
export const dash = (k) => DASHES[Math.floor(k / COLOURS.length) % DASHES.length]; // the thirteenth line has the first colour and another stroke
// a number with some digits that count and no power of ten from 1e-5 to 1e6
export function shown(v, digits = 4) {
  if (v === null || v === undefined || !Number.isFinite(Number(v))) return "–";
  const x = Number(v), size = Math.abs(x);
  if (size === 0) return "0";
  if (size < 1e-5 || size >= 1e6) { const [m, e] = x.toExponential(digits - 1).split("e"); return `${bare(m)}·10${[...String(Number(e))].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] || "⁻").join("")}`; }
  return bare(x.toFixed(Math.max(0, digits - 1 - Math.floor(Math.log10(size)))));
}
const bare = (text) => (text.includes(".") ? text.replace(/\.?0+$/, "") : text);
export const typed = (v) => String(Number(Number(v).toPrecision(5))); // for a field that is read back
export const hour = (t) => (t < 3600 ? `${shown(t / 60, 3)} min` : `${shown(t / 3600, 3)} h`);
// units and signs that terminals write in plain letters
export const nice = (text) => text.replaceAll("^2", "²").replaceAll("^3", "³").replaceAll("^-1", "⁻¹").replace(/\bdegC\b/g, "°C").replaceAll("+- ", "± ").replaceAll("+/-", "±").replaceAll(" .. ", " to ");
export const unitOf = (x) => (x.unit === "1" ? "" : nice(x.unit));
// plain loops: these run over every point at every movement of a slider
export function hours(list) { const out = new Float64Array(list.length); for (let k = 0; k < list.length; k++) out[k] = list[k] / 3600; return out; }

export function make(tag, attributes = {}, ...inside) {
  const node = document.createElement(tag);
  for (const [k, v] of Object.entries(attributes)) k === "text" ? (node.textContent = v) : k.startsWith("on") ? node.addEventListener(k.slice(2), v) : v === false || node.setAttribute(k, v === true ? "" : v);
  node.append(...inside);
  return node;
}
export const row = (head, ...cells) => make("tr", {}, make("th", { scope: "row", text: head }), ...cells.map((c) => make("td", typeof c === "string" ? { text: c } : { class: "num", text: c === null ? "–" : c.toFixed(1) })));

// arrays come as bytes, little endian as every browser has them
function unpacked(text, kind) { const plain = atob(text), out = new Uint8Array(plain.length); for (let k = 0; k < plain.length; k++) out[k] = plain.charCodeAt(k); return new kind(out.buffer); }
export async function ask(path, body) {
  const how = body === undefined ? {} : { method: "POST", headers: { "content-type": "application/json", "x-thermid-studio": "1" }, body: JSON.stringify(body) };
  const answer = await fetch(path, how).catch(() => { throw new Error("The studio does not answer: it was ended. Start it again, under the same port, and open the address that it prints; moved sliders come back."); });
  const found = JSON.parse(await answer.text(), (_, v) => (v && v.f4 !== undefined ? unpacked(v.f4, Float32Array) : v && v.f8 !== undefined ? unpacked(v.f8, Float64Array) : v));
  if (found.error) throw new Error(found.where && !found.error.includes(found.where) ? `${found.where}: ${found.error}` : found.error);
  return found;
}
export function wrong(error) { const box = at("error"); box.hidden = !error; box.textContent = error ? nice(String(error.message || error)) : ""; }
export async function tried(make) { try { wrong(null); return await make(); } catch (error) { wrong(error); return null; } }

// the legend of a chart: a button for each curve that shows or hides it
export function legend(host, names, charts) {
  host.replaceChildren(...names.map((name, k) => {
    const line = make("i", { style: `border-top-color:${colour(k)};border-top-style:${["solid", "dashed", "dotted", "double"][Math.floor(k / COLOURS.length) % 4]}` });
    const flip = (e) => { for (const chart of charts) { chart.hidden.has(name) ? chart.hidden.delete(name) : chart.hidden.add(name); chart.draw(); } e.currentTarget.setAttribute("aria-pressed", String(!charts[0].hidden.has(name))); };
    return make("button", { type: "button", "aria-pressed": String(!charts[0].hidden.has(name)), "data-curve": name, onclick: flip }, line, make("span", { text: name }));
  }));
}
dark.addEventListener("change", () => document.dispatchEvent(new Event("recolour")));
window.addEventListener("error", (e) => studio.errors.push(e.message));
window.addEventListener("unhandledrejection", (e) => studio.errors.push(String(e.reason)));
