// A field that the server may refuse: what was typed stays, marked with the reason and what is in force, until it is mended.
import type { RefObject } from "preact";
import { useId, useState } from "preact/hooks";
import { nice, type Refused } from "./server";
import { error } from "./state";

// `now` is what is in force, of `of`: what was typed belongs to the two, and is not shown with others
export function useTyped(now: string, of: string) {
  const key = `${of}\n${now}`, [typed, setTyped] = useState<{ key: string; text: string; why: string } | null>(null), mine = typed?.key === key ? typed : null;
  const text = mine?.text ?? now, why = mine?.why ?? "", setText = (t: string) => setTyped({ key, text: t, why });
  const sent = async (answer: Promise<unknown>, as = text) => { const made = await answer; setTyped(made === null ? { key, text: as, why: error.value } : null); };
  return { text, setText, why, sent };
}

export const Why = ({ id, why, now }: { id: string; why: string; now?: string }) => (why ? <span id={id} class="why bad" role="status">{nice(why)}{now !== undefined && ` In force: ${now ? nice(now) : "nothing"}.`}</span> : null);

interface Input { id?: string; class?: string; inputMode?: "decimal"; disabled?: boolean; placeholder?: string; "aria-label"?: string; [data: `data-${string}`]: string }
// one of several fields that are sent together: it is marked where the answer refuses what is in it
export function OneOf({ of, refused, now, send, on = "input", ...more }: Input & { of: string; refused: Refused | null; now: string; send: (text: string) => void; on?: "input" | "change" }) {
  const id = useId(), why = refused?.where.endsWith(of) ? refused.why : "", take = (e: { currentTarget: HTMLInputElement }) => send(e.currentTarget.value);
  return <><input type="text" autocomplete="off" {...more} value={now} aria-invalid={why ? "true" : undefined} aria-describedby={why ? id : undefined} {...(on === "input" ? { onInput: take } : { onChange: take })} /><Why id={id} why={why} /></>;
}
export function Typed({ now, of = "", unit = "", send, box, ...more }: Input & { now: string; of?: string; unit?: string; box?: RefObject<HTMLInputElement | null>; send: (text: string) => Promise<unknown> }) {
  const { text, setText, why, sent } = useTyped(now, of), id = useId();
  return <>
    <input ref={box} type="text" autocomplete="off" {...more} value={text} aria-invalid={why ? "true" : undefined} aria-describedby={why ? id : undefined} onInput={(e) => setText(e.currentTarget.value)} onChange={(e) => void sent(send(e.currentTarget.value), e.currentTarget.value)} />
    <Why id={id} why={why} now={now && `${now} ${unit}`.trim()} />
  </>;
}
