// The start page: begin a model, open one of the folder, copy an example.
import { render } from "preact";
import { useEffect, useState } from "preact/hooks";
import { ask, type Front } from "./server";

async function go(path: string, body: unknown, wrong: (text: string) => void) {
  try {
    location.assign((await ask<{ page: string }>(path, body)).page);
  } catch (e) { wrong((e as Error).message); }
}

function Start() {
  const [front, setFront] = useState<Front | null>(null);
  const [find, setFind] = useState("");
  const [error, setError] = useState("");
  const load = (path: string, body?: unknown) => ask<Front>(path, body).then(setFront, (e: Error) => setError(e.message));
  useEffect(() => { void load("start"); }, []);
  if (!front) return <main class="start"><p role="alert" class="error" hidden={!error}>{error}</p></main>;
  const hits = front.files.filter((f) => `${f.file} ${f.title}`.toLowerCase().includes(find.toLowerCase()));
  return (
    <main class="start" data-ready>
      <header><h1>thermid studio</h1><p class="soft">Folder: {front.folder}{front.open && <> · open: <a href="/">{front.open}</a></>}</p></header>
      <p role="alert" class="error" hidden={!error}>{error}</p>
      <section aria-labelledby="new-title">
        <h2 id="new-title">New model</h2>
        <form class="bar" onSubmit={(e) => { e.preventDefault(); void go("new", { name: (e.currentTarget.elements.namedItem("name") as HTMLInputElement).value }, setError); }}>
          <label class="grow">Name <input id="new-name" name="name" type="text" required maxLength={60} autofocus placeholder="box of two boards" /></label>
          <button id="new" class="main" type="submit">New model</button>
        </form>
        <p class="soft">Masses, couplings and loads by mouse or keys; drop a log on it, fit, save. Nothing is written before you save.</p>
      </section>
      <section aria-labelledby="open-title">
        <h2 id="open-title">Open</h2>
        <label>Find <input type="search" value={find} onInput={(e) => setFind(e.currentTarget.value)} placeholder="file or title" /></label>
        <ul class="files" id="files">{hits.map((f) => (
          <li key={f.file}><button type="button" data-file={f.file} onClick={() => go("open", { file: f.file }, setError)}><strong>{f.title || f.file}</strong> <span class="soft">{f.kind} · {f.file}</span></button></li>
        ))}</ul>
        {front.waiting.length > 0 && <><h3>Begun and not saved</h3><ul class="files" id="waiting">{front.waiting.map((name) => <li key={name}><button type="button" data-waiting={name} onClick={() => go("new", { name }, setError)}>{name}</button></li>)}</ul></>}
        {hits.length === 0 && <p class="soft">No deck or campaign {find ? "of that name " : ""}in this folder.</p>}
      </section>
      <section aria-labelledby="recent-title">
        <h2 id="recent-title">Recent</h2>
        <ul class="files" id="recent">{front.recent.map((file) => <li key={file}><button type="button" onClick={() => go("open", { file }, setError)}>{file}</button></li>)}</ul>
        {front.recent.length ? <button id="forget" type="button" onClick={() => load("forget", {})}>Clear this list</button> : <p class="soft">Nothing yet.</p>}
      </section>
      <section aria-labelledby="examples-title">
        <h2 id="examples-title">Examples</h2>
        <ul class="cards" id="examples">{front.examples.map((e) => (
          <li key={e.name}><button type="button" data-example={e.name} onClick={() => go("example", { name: e.name }, setError)}><strong>{e.name}</strong><span class="soft">{e.shows}.{e.fetched ? " Its measurements are fetched from their publisher." : ""}</span></button></li>
        ))}</ul>
        <p class="soft">An example is copied into a folder of its name.</p>
      </section>
    </main>
  );
}

render(<Start />, document.body);
