// The text of the deck in an editor; loaded when its pane is opened. What is typed goes to the server, which takes it where it is a deck.
import { HighlightStyle, StreamLanguage, syntaxHighlighting } from "@codemirror/language";
import { toml } from "@codemirror/legacy-modes/mode/toml";
import { lintGutter, setDiagnostics, type Diagnostic } from "@codemirror/lint";
import { tags } from "@lezer/highlight";
import { EditorView, basicSetup } from "codemirror";
import type { Fault } from "./server";

const COLOURS = HighlightStyle.define([
  { tag: tags.comment, color: "var(--soft)", fontStyle: "italic" }, { tag: tags.string, color: "var(--string)" },
  { tag: [tags.propertyName, tags.definition(tags.propertyName)], color: "var(--ink)" }, { tag: [tags.atom, tags.bool, tags.number], color: "var(--accent)" }, { tag: tags.bracket, color: "var(--ink)" },
]);

export interface Pane { show(text: string, faults: Fault[]): void; close(): void }

export function open(host: HTMLElement, typed: (text: string) => void): Pane {
  let timer = 0, own = "";
  const editor = new EditorView({
    parent: host,
    extensions: [
      basicSetup, StreamLanguage.define(toml), syntaxHighlighting(COLOURS), lintGutter(), EditorView.lineWrapping,
      EditorView.contentAttributes.of({ "aria-label": "Text of the deck (TOML)" }),
      EditorView.updateListener.of((update) => {
        if (!update.docChanged || update.transactions.some((t) => t.isUserEvent("server"))) return;
        clearTimeout(timer);
        timer = window.setTimeout(() => { own = editor.state.doc.toString(); typed(own); }, 350);
      }),
    ],
  });
  return {
    show(text, faults) {
      const now = editor.state.doc.toString(), refused = faults.some((f) => f.severity === "error");
      // what was typed and refused stays, and so does what is typed at this moment
      if (now !== text && (!now || (!refused && (now === own || !editor.hasFocus)))) editor.dispatch({ changes: { from: 0, to: now.length, insert: text }, userEvent: "server" });
      const lines = editor.state.doc.lines;
      const marks: Diagnostic[] = faults.filter((f) => f.line && f.line <= lines).map((f) => {
        const { from, to } = editor.state.doc.line(f.line!);
        return { from, to, severity: f.severity === "error" ? "error" : f.severity === "warning" ? "warning" : "info", message: f.message };
      });
      editor.dispatch(setDiagnostics(editor.state, marks));
    },
    close() { clearTimeout(timer); editor.destroy(); },
  };
}
