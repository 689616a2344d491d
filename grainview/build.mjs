// Bundles the page into the Python package: one script and one sheet of styles, no map, no network.
import { build } from "esbuild";

await build({
  entryPoints: { grainview: "src/main.ts" },
  outdir: process.argv[2] ?? "../src/sand/view/page",
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2022",
  charset: "utf8",
  legalComments: "inline",
  logLevel: "warning",
});
