// Bundles src/ into the Python package: the player and the live page, each with the licences of what is in it.
import { build } from "esbuild";
import { mkdir, readFile, writeFile } from "node:fs/promises";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

const here = fileURLToPath(new URL(".", import.meta.url));
const out = process.argv[2];
const UPLOT_CSS = "/*! Holds parts of uPlot (MIT licence, Leon Sorokin); the text stands in the script. */";

const BUNDLES = [
  // a page that brings the player twice runs it once
  { name: "player", entry: "src/main.js", folder: "report/viewer", inside: ["three", "uplot"], css: UPLOT_CSS, guard: "if (!window.oarlock?.fill) {", end: "}" },
  { name: "live", entry: "src/live/main.js", folder: "live/page", inside: ["three"], css: "", guard: "{", end: "}" },
];

async function licences({ name, inside }) {
  const parts = [];
  for (const one of inside) {
    const { version, homepage } = JSON.parse(await readFile(join(here, "node_modules", one, "package.json"), "utf8"));
    const text = (await readFile(join(here, "node_modules", one, "LICENSE"), "utf8")).replaceAll("\r\n", "\n").trim();
    parts.push(`${one} ${version} (${homepage})\n\n${text}\n`);
  }
  return `${name}.js and ${name}.css hold parts of these packages.\n\n${parts.join("\n----\n\n")}`;
}

for (const bundle of BUNDLES) {
  const { name, entry, folder, css, guard, end } = bundle;
  const legal = await licences(bundle);
  const place = out ?? join(here, "../python/oarlock", folder);
  await mkdir(place, { recursive: true });
  await build({
    absWorkingDir: here,
    entryPoints: { [name]: entry },
    outdir: place,
    bundle: true,
    minify: true,
    format: "iife",
    target: ["chrome110", "firefox110", "safari16"],
    charset: "utf8",
    legalComments: "none",
    footer: { js: end },
    // the licences travel with every copy, pages included
    banner: { js: `/*!\n${legal.replaceAll("*/", "* /")}*/\n${guard}`, css },
    loader: { ".css": "css" },
  });
  await writeFile(join(place, `${name}.licences.txt`), legal);
}
