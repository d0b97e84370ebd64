// Writes spikeblocks/studio/page/codemirror.js and the licences of what is in it: npm ci && npm run build
import {build} from "esbuild";
import {readFileSync, readdirSync, writeFileSync, existsSync} from "node:fs";

const made = await build({
  entryPoints: ["entry.mjs"], bundle: true, format: "esm", minify: true, target: "es2022",
  legalComments: "none", outfile: "../../spikeblocks/studio/page/codemirror.js", metafile: true,
});
const used = new Set();
for (const file of Object.keys(made.metafile.inputs)) {
  const found = file.match(/^node_modules\/((?:@[^/]+\/)?[^/]+)\//);
  if (found) used.add(found[1]);
}
const texts = [...used].sort().map((name) => {
  const folder = `node_modules/${name}`;
  const {version} = JSON.parse(readFileSync(`${folder}/package.json`));
  const licence = readdirSync(folder).find((file) => /^licen[cs]e/i.test(file));
  return `${name} ${version}\n\n${licence ? readFileSync(`${folder}/${licence}`, "utf-8") : "MIT"}`;
});
writeFileSync("../../spikeblocks/studio/page/codemirror.LICENSE", texts.join("\n----\n\n"));
