/** Bundles the libraries, with their licences, and copies the style of the plots and the typeface. */

import { copyFileSync, readFileSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const folder = process.argv[2] ?? "static";

await build({
  entryPoints: ["libraries.js"],
  outfile: `${folder}/libraries/libraries.js`,
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2022",
  legalComments: "none",
  banner: { js: "// @ts-nocheck: made by `npm run build`. Licences: libraries.txt" },
});
const packages = ["three", "uplot"];
const licences = packages.map((name) => `${name}\n\n${readFileSync(`node_modules/${name}/LICENSE`, "utf8")}`);
writeFileSync(`${folder}/libraries/libraries.txt`, licences.join("\n\n"));
copyFileSync("node_modules/uplot/dist/uPlot.min.css", `${folder}/libraries/uplot.css`);
const inter = "node_modules/@fontsource-variable/inter";
copyFileSync(`${inter}/files/inter-latin-wght-normal.woff2`, `${folder}/fonts/inter.woff2`);
copyFileSync(`${inter}/LICENSE`, `${folder}/fonts/LICENSE.txt`);
