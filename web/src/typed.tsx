// A field that the server may refuse: what was typed stays, marked with the reason and what is in force, until it is mended.
import type { RefObject } from "preact";
import { useEffect, useId, useState } from "preact/hooks";
import { nice } from "./server";
import { error } from "./state";

// `now` is what is in force, of `of`; where either is another, what was typed is gone
export function useTyped(now: string, of: string) {
  const [text, setText] = useState(now), [why, setWhy] = useState("");
  useEffect(() => { setText(now); setWhy(""); }, [of, now]);
  const sent = async (answer: Promise<unknown>) => { const made = await answer; setWhy(made === null ? error.value : ""); return made; };
  return { text, setText, why, sent };
}

export const Why = ({ id, why, now }: { id: string; why: string; now: string }) => (why ? <span id={id} class="why bad" role="status">{nice(why)} In force: {now ? nice(now) : "nothing"}.</span> : null);

interface Input { id?: string; class?: string; inputMode?: "decimal"; disabled?: boolean; placeholder?: string; "aria-label"?: string; [data: `data-${string}`]: string }
export function Typed({ now, of = "", unit = "", send, box, ...more }: Input & { now: string; of?: string; unit?: string; box?: RefObject<HTMLInputElement | null>; send: (text: string) => Promise<unknown> }) {
  const { text, setText, why, sent } = useTyped(now, of), id = useId();
  return <>
    <input ref={box} type="text" autocomplete="off" {...more} value={text} aria-invalid={why ? "true" : undefined} aria-describedby={why ? id : undefined} onInput={(e) => setText(e.currentTarget.value)} onChange={(e) => void sent(send(e.currentTarget.value))} />
    <Why id={id} why={why} now={now && `${now} ${unit}`.trim()} />
  </>;
}
