// Bundles src/ into the Python package: player.js, player.css and the licences of what is in them.
import { build } from "esbuild";
import { mkdir, readFile, writeFile } from "node:fs/promises";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

const here = fileURLToPath(new URL(".", import.meta.url));
const out = process.argv[2] ?? join(here, "../python/oarlock/report/viewer");

const INSIDE = ["three", "uplot"];

async function licences() {
  const parts = [];
  for (const name of INSIDE) {
    const { version, homepage } = JSON.parse(await readFile(join(here, "node_modules", name, "package.json"), "utf8"));
    const text = (await readFile(join(here, "node_modules", name, "LICENSE"), "utf8")).replaceAll("\r\n", "\n").trim();
    parts.push(`${name} ${version} (${homepage})\n\n${text}\n`);
  }
  return `player.js and player.css hold parts of these packages.\n\n${parts.join("\n----\n\n")}`;
}

const legal = await licences();
await mkdir(out, { recursive: true });
await build({
  absWorkingDir: here,
  entryPoints: { player: "src/main.js" },
  outdir: out,
  bundle: true,
  minify: true,
  format: "iife",
  target: ["chrome110", "firefox110", "safari16"],
  charset: "utf8",
  legalComments: "none",
  // the licences travel with every copy, pages included
  // and a page that brings the script twice runs it once
  footer: { js: "}" },
  banner: { js: `/*!\n${legal.replaceAll("*/", "* /")}*/\nif (!window.oarlock?.fill) {`, css: "/*! Holds parts of uPlot (MIT licence, Leon Sorokin); the text stands in the script. */" },
  loader: { ".css": "css" },
});
await writeFile(join(out, "player.licences.txt"), legal);
