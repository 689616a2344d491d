// Bundles the page into the Python package: one script and one sheet of styles, no map, no network. Both begin with the
// licences of what is in them, so that every copy carries them, and `licences.txt` holds them once more.
import { build } from "esbuild";
import { mkdir, readFile, readdir, writeFile } from "node:fs/promises";
import path from "node:path";
import { fileURLToPath } from "node:url";

const here = path.dirname(fileURLToPath(import.meta.url));
const out = process.argv[2] ?? path.join(here, "..", "src", "sand", "viewer", "page");

/** Names of the packages that inputs of esbuild are from; "" is the page itself. */
function packagesOf(inputs) {
  const names = Object.keys(inputs).map((file) => /node_modules\/((?:@[^/]+\/)?[^/]+)\//.exec(file)?.[1] ?? "");
  return [...new Set(names)].sort();
}

/** Name, version and the whole text of a package's licence; fails where there is none. */
async function licenceOf(name) {
  if (!name) return `SAND, grainview (BSD-3-Clause)\n\n${await readFile(path.join(here, "..", "LICENSE"), "utf8")}`;
  const folder = path.join(here, "node_modules", name);
  const about = JSON.parse(await readFile(path.join(folder, "package.json"), "utf8"));
  const file = (await readdir(folder)).find((entry) => /^licen[cs]e(\.|$)/i.test(entry));
  if (!file) throw new Error(`${name} comes without a licence`);
  const text = await readFile(path.join(folder, file), "utf8");
  return `${about.name} ${about.version} (${about.license})\n\n${text}`;
}

/** Their licences, one after another. */
async function licencesOf(inputs) {
  const texts = await Promise.all(packagesOf(inputs).map(licenceOf));
  return texts.map((text) => text.replace(/\r\n/g, "\n").trim()).join(`\n\n${"-".repeat(80)}\n\n`) + "\n";
}

const made = await build({
  absWorkingDir: here,
  entryPoints: { grainview: "src/main.ts" },
  outdir: out,
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2022",
  charset: "utf8",
  legalComments: "inline",
  logLevel: "warning",
  metafile: true,
  write: false,
});

await mkdir(out, { recursive: true });
for (const file of made.outputFiles) {
  const name = Object.keys(made.metafile.outputs).find((key) => path.resolve(here, key) === path.resolve(file.path));
  const licences = await licencesOf(made.metafile.outputs[name].inputs);
  if (licences.includes("*/")) throw new Error("a licence would end the comment that it is in");
  await writeFile(file.path, `/*!\n${licences}*/\n${file.text}`);
}
await writeFile(path.join(out, "licences.txt"), await licencesOf(made.metafile.inputs));
