// What the page knows: the draft as the server has it, and what is chosen in the page.
import { batch, computed, signal } from "@preact/signals";
import { ask, type Draft, type Element, type Job, type Refused, type Shape } from "./server";

export const draft = signal<Draft | null>(null);
export const chosen = signal(""); // "table/name"
export const tool = signal<{ shape: Shape; ends: string[] } | null>(null);
export const job = signal<Job>({});
export const error = signal(""), refused = signal<Refused>({ where: "", why: "" });
export const diff = signal<{ diff: string; files: string[] } | null>(null);
export const pane = signal<"log" | "text" | "check" | "results" | "if">("log");
export const focusName = signal(0); // raised where the sheet's name field is to have the focus
export const errors: string[] = [];

export const idOf = (e: Element) => `${e.table}/${e.name}`;
export const element = computed(() => draft.value?.elements.find((e) => idOf(e) === chosen.value) ?? null);
export const nodes = computed(() => draft.value?.elements.filter((e) => ["nodes", "needs", "submodels"].includes(e.table)) ?? []);

let last: Promise<unknown> = Promise.resolve(), waiting = 0;
export const idle = () => draft.value !== null && waiting === 0;

// commands go one after the other: each is about the state that the one before has left
export function told<T>(make: () => Promise<T>): Promise<T | null> {
  waiting++;
  const next = last.then(async () => {
    try {
      const out = await make();
      error.value = "";
      return out;
    } catch (e) {
      say(e);
      return null;
    } finally { waiting--; }
  });
  last = next;
  return next;
}

export function say(e: unknown) {
  const { message, where = "", why = "" } = e as Error & Partial<Refused>;
  error.value = String(message ?? e); refused.value = { where, why };
}

export async function command(body: Record<string, unknown>): Promise<Draft | null> {
  const made = await told(() => ask<Draft>("edit", body));
  if (made) take(made);
  return made;
}

// what was chosen stays chosen under its new name, so that its sheet, and the focus in it, stay too
export function take(made: Draft) {
  const known = (id: string) => made.elements.some((e) => idOf(e) === id), renamed = `${made.table}/${made.made}`;
  batch(() => {
    draft.value = made;
    if (chosen.value && !known(chosen.value)) chosen.value = known(renamed) ? renamed : "";
  });
}

export async function add(shape: Shape, ends: string[] = [], place?: [number, number]) {
  const made = await command({ do: "add", shape: shape.name, ends, ...(place ? { x: place[0], y: place[1] } : {}), use: shape.name === "submodel" ? (draft.value?.decks[0] ?? "") : "" });
  if (!made?.made) return;
  chosen.value = `${shape.name === "sensor" ? "nodes" : made.table}/${made.made}`;
  if (shape.table !== "sensors") focusName.value++;
}

// chooses an entry of the palette; `from` is the node that has the focus where a key was pressed
export function arm(shape: Shape, place: [number, number], from = "") {
  if (shape.ends === 0) { tool.value = null; void add(shape, [], place); return; }
  tool.value = { shape, ends: [] };
  if (from) pick(from);
}

// takes a node as the next end of what is being joined
export function pick(node: string) {
  const armed = tool.value;
  if (!armed || armed.ends.includes(node)) return;
  const ends = [...armed.ends, node];
  if (ends.length < armed.shape.ends) { tool.value = { ...armed, ends }; return; }
  tool.value = null;
  void add(armed.shape, ends);
}

export async function watch() {
  while (true) {
    const now = await told(() => ask<Job>("built"));
    job.value = now ?? {}; // of a studio that does not answer nothing is known to run
    if (!now) return;
    if (now.ended !== false) break;
    await new Promise((r) => setTimeout(r, 150));
  }
  if (job.value.error) error.value = job.value.error;
  else if (job.value.result) pane.value = "results";
}

export async function begin(what: "run" | "fit") {
  const now = await told(() => ask<Job>(`draft/${what}`, {}));
  if (now) { job.value = now; await watch(); }
}

export const compare = async () => { diff.value = await told(() => ask<{ diff: string; files: string[] }>("draft/difference", {})); };
export async function save() {
  const made = await told(() => ask<Draft>("draft/save", { diff: diff.value?.diff ?? "" }));
  diff.value = null;
  if (made) take(made);
}

window.addEventListener("error", (e) => errors.push(e.message));
window.addEventListener("unhandledrejection", (e) => errors.push(String(e.reason)));
