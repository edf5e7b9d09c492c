// Bundle stage.js with three.js into the one script that reports carry, which is committed:
//   npm ci && npm run build
import { createHash } from "node:crypto";
import { readFile, stat } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import esbuild from "esbuild";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const out = here("../../src/physique/report/static/stage.min.js");
const { devDependencies } = JSON.parse(await readFile(here("package.json"), "utf8"));
// The test suite compares this with the source, so that the bundle cannot be forgotten.
const digest = createHash("sha256").update(await readFile(here("stage.js"))).digest("hex");

await esbuild.build({
  entryPoints: [here("stage.js")],
  outfile: out,
  bundle: true,
  minify: true,
  format: "iife",
  globalName: "PhysiqueStage",
  target: "es2022",
  legalComments: "inline",
  banner: {
    js: `/* tools/web/stage.js ${digest}, with three.js ${devDependencies.three} (MIT) */`,
  },
});
console.log(`${out}: ${(await stat(out)).size} bytes`);
