// Writes ../viewer.js, one minified script, and the licence of what is in it. Its first
// line carries the digest of these sources, by which a test knows a stale bundle.
import { createHash } from "node:crypto";
import { copyFileSync, readdirSync, readFileSync } from "node:fs";
import { build } from "esbuild";

const names = readdirSync(".").filter((n) => /\.(m?js|json)$/.test(n)).sort();
const digest = createHash("sha256");
for (const name of names) digest.update(readFileSync(name));
const { devDependencies } = JSON.parse(readFileSync("package.json"));
await build({
  entryPoints: ["main.js"],
  outfile: "../viewer.js",
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  legalComments: "none",
  banner: {
    js:
      `/* ringrig viewer, sources ${digest.digest("hex")}; ` +
      `three.js ${devDependencies.three}, MIT, THREE-LICENSE.txt */`,
  },
});
copyFileSync("node_modules/three/LICENSE", "../THREE-LICENSE.txt");
