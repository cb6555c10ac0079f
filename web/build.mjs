// Makes the studio's pages out of src/: one script for each page, what several share or load later in pieces beside them.
import { createHash } from "node:crypto";
import { cpSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const bundle = join(here, "..", "src", "thermid", "app", "studio", "bundle");
// what the pages are made of; a test compares it with the sources
const sources = [...readdirSync(join(here, "src")).sort().map((name) => join("src", name)), "build.mjs", "package-lock.json"];
const digest = createHash("sha256");
for (const name of sources) digest.update(name).update("\0").update(readFileSync(join(here, name))).update("\0");

rmSync(bundle, { recursive: true, force: true });
mkdirSync(bundle, { recursive: true });
await build({
  absWorkingDir: here,
  entryPoints: ["src/start.tsx", "src/build.tsx", "src/studio.tsx"],
  bundle: true,
  splitting: true,
  format: "esm",
  target: "es2022",
  jsx: "automatic",
  jsxImportSource: "preact",
  minify: true,
  legalComments: "eof",
  outdir: bundle,
  chunkNames: "piece-[hash]",
});
cpSync(join(here, "node_modules", "uplot", "dist", "uPlot.min.css"), join(bundle, "plot.css"));
for (const name of readdirSync(join(here, "src"))) if (/\.(html|css)$/.test(name)) cpSync(join(here, "src", name), join(bundle, name));
writeFileSync(join(bundle, "sources.txt"), `${digest.digest("hex")}\n`);
