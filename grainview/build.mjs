// Bundles the page into the Python package: one script and one style sheet, without source maps. Both begin with the
// licences of the bundled packages, so that every copy includes them; `licences.txt` contains them, too.
import { build } from "esbuild";
import { mkdir, readFile, readdir, writeFile } from "node:fs/promises";
import path from "node:path";
import { fileURLToPath } from "node:url";

const here = path.dirname(fileURLToPath(import.meta.url));
const out = process.argv[2] ?? path.join(here, "..", "src", "sand", "viewer", "page");

/** Names of the packages of esbuild's input files; "" stands for the page itself. */
function packagesOf(inputs) {
  const names = Object.keys(inputs).map((file) => /node_modules\/((?:@[^/]+\/)?[^/]+)\//.exec(file)?.[1] ?? "");
  return [...new Set(names)].sort();
}

/** Name, version and full licence text of a package; throws if it has none. */
async function licenceOf(name) {
  if (!name) return `SAND, grainview (BSD-3-Clause)\n\n${await readFile(path.join(here, "..", "LICENSE"), "utf8")}`;
  const folder = path.join(here, "node_modules", name);
  const manifest = JSON.parse(await readFile(path.join(folder, "package.json"), "utf8"));
  const file = (await readdir(folder)).find((entry) => /^licen[cs]e(\.|$)/i.test(entry));
  if (!file) throw new Error(`package ${name} has no licence file`);
  const text = await readFile(path.join(folder, file), "utf8");
  return `${manifest.name} ${manifest.version} (${manifest.license})\n\n${text}`;
}

/** Licence texts of the packages of esbuild's input files. */
async function licencesOf(inputs) {
  const texts = await Promise.all(packagesOf(inputs).map(licenceOf));
  return texts.map((text) => text.replace(/\r\n/g, "\n").trim()).join(`\n\n${"-".repeat(80)}\n\n`) + "\n";
}

const result = await build({
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
for (const file of result.outputFiles) {
  const name = Object.keys(result.metafile.outputs).find((key) => path.resolve(here, key) === path.resolve(file.path));
  const licences = await licencesOf(result.metafile.outputs[name].inputs);
  if (licences.includes("*/")) throw new Error("a licence text contains */, which would end its comment");
  await writeFile(file.path, `/*!\n${licences}*/\n${file.text}`);
}
await writeFile(path.join(out, "licences.txt"), await licencesOf(result.metafile.inputs));
