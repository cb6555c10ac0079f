// What the server says and takes. Every command returns the whole state of the draft, so that the page never has a state of its own.
export interface Field { name: string; number: string; unit: string; units: string[]; expression: boolean; source: string; given: boolean; law: boolean; missing: boolean; low: string; high: string; spread: string }
export interface Element { table: string; name: string; shape: string; ends: string[]; fields: Field[]; sensor: boolean; logged?: string; schedule?: Record<"on" | "off" | "share", string> | null; use?: string; bind?: Record<string, unknown> }
export interface Shape { name: string; words: string; key: string; table: string; ends: number }
export interface Fault { severity: string; code: string; message: string; where: string; line: number | null }
export interface Column { name: string; key?: string; unit: string; assumed: boolean; open: boolean; roles: string[]; used?: string[]; guess: string; why: string; low?: number; high?: number }
export type Binding = Record<string, string>;
export interface Log { record: string; file: string; channels: Record<string, Binding | string>; columns: Column[]; rows: number; problem: string; sampling?: { length: number } | null; questions: string[]; notes: string[] }
export interface Use { name: string; file: string; use: "fit" | "held out" | "joined"; limit?: string; host?: string; offset?: string }
export interface Parameter { path: string; text: string; free: boolean }
export interface Refused { where: string; why: string }
export interface Draft {
  file: string; title: string; text: string; notice: string; elements: Element[]; others: Record<string, number>;
  places: Record<string, [number, number]>; palette: Shape[]; sources: string[]; faults: Fault[]; undo: number; redo: number;
  unsaved: string[]; changed: string[]; log: Log | null; records: Use[]; logs: string[]; parameters: Parameter[]; decks: string[]; missing: number;
  stages: string[]; stage: string; inherited: { path: string; words: string }[]; held: Record<string, string>; refused?: Fault; typed?: string; made?: string; table?: string;
}
export interface Curve { name: string; node: string; times: Float32Array; simulated: Float32Array; seen?: Float32Array; measured?: Float32Array; apart?: Float32Array; left?: Float32Array; rmse?: number | null; bias?: number | null; largest?: number | null; count?: number; sigma?: number | null }
export interface Result {
  runs?: { name: string; curves: Curve[] }[]; fitted?: Record<string, { value: number; unit: string; error: number | null }>; warnings?: string[]; clocks?: Record<string, string>;
  standing?: { word?: string; standing?: string; text?: string };
}
export interface Job { what?: string; ended?: boolean; error?: string; evaluations?: number; rms?: number; seconds?: number; result?: Result }
export interface Conditions { runs: string[]; boundaries: Record<string, number>; loads: string[]; hours: number; finishes: string[] }
export interface Compared { curves?: { node: string; times: Float32Array; temperatures: Float32Array; after: Float32Array; after_times: Float32Array }[]; changes: string[]; refused?: string; surfaces?: string[] }
export interface Front { folder: string; files: { file: string; kind: string; title: string }[]; waiting: string[]; examples: { name: string; shows: string; fetched: boolean }[]; recent: string[]; open: string | null }

const GONE = "The studio does not answer: it was ended. Start it again and open the address that it prints; edits that were not saved come back.";

export async function ask<T>(path: string, body?: unknown): Promise<T> {
  const how = body === undefined ? {} : { method: "POST", headers: { "content-type": "application/json", "x-thermid-studio": "1" }, body: JSON.stringify(body) };
  return read<T>(await fetch(`/api/${path}`, how).catch(() => { throw new Error(GONE); }));
}

export async function upload(name: string, data: Blob): Promise<{ file: string }> {
  const how = { method: "POST", headers: { "x-thermid-studio": "1" }, body: data };
  return read(await fetch(`/api/draft/log/${encodeURIComponent(name)}`, how).catch(() => { throw new Error(GONE); }));
}

// a refusal says where; a job that failed says its error in its state, and is an answer
async function read<T>(answer: Response): Promise<T> {
  const found = JSON.parse(await answer.text(), (_, v) => (typeof v?.f4 === "string" ? numbers(v.f4, 4) : typeof v?.f8 === "string" ? numbers(v.f8, 8) : v));
  if (found.error && "where" in found) throw Object.assign(new Error(found.where && !found.error.includes(found.where) ? `${found.where}: ${found.error}` : found.error), { where: found.where, why: found.error });
  return found as T;
}

// arrays come as bytes, little endian as every browser has them; a node may be called f4 too, and has a number
function numbers(text: string, size: 4 | 8): Float32Array | Float64Array {
  const letters = atob(text), bytes = new Uint8Array(letters.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = letters.charCodeAt(k); // twenty times as fast as Uint8Array.from
  return size === 4 ? new Float32Array(bytes.buffer) : new Float64Array(bytes.buffer);
}

// units and signs that files write in plain letters
export const nice = (text: string) => text.replaceAll("+-", "±").replaceAll("^2", "²").replaceAll("^3", "³").replace(/\bdegC\b/g, "°C");
export function shown(v: number | null | undefined, digits = 4): string {
  if (v === null || v === undefined || !Number.isFinite(v)) return "–";
  return String(Number(v.toPrecision(digits)));
}
