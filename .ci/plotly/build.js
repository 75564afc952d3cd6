// Builds plotly.js with the traces that report.html draws: npm install && npm run build, in this folder.
// The settings are plotly.js' own (esbuild-config.js of its package); the licences of all that went in stand beside.
const fs = require("fs"), path = require("path");
const { build } = require("esbuild");
const { environmentPlugin } = require("esbuild-plugin-environment");
const { glsl } = require("esbuild-plugin-glsl");
const inlineCss = require("esbuild-plugin-inline-css");

const TRACES = ["bar", "heatmap", "scatterpolar", "scatter3d", "mesh3d"]; // "scatter" is in every bundle
const FOLDER = path.join(__dirname, "../../planner/report/static/plotly");
const VERSION = require("plotly.js/package.json").version;
const HEAD = `/**\n* plotly.js v${VERSION} (scatter, ${TRACES.join(", ")})\n* Copyright 2012-2026, Plotly, Inc.\n* All rights reserved.\n* Licensed under the MIT license\n*/`;
const ENTRY = `"use strict";
const Plotly = require("plotly.js/lib/core");
Plotly.register([${TRACES.map((t) => `require("plotly.js/lib/${t}")`).join(", ")}]);
module.exports = Plotly;`;

// the canvas on which letters in space are measured is read back each time: without this the browser warns
const readBack = {
  name: "read-back",
  setup: (b) => b.onLoad({ filter: /stackgl_modules[\\/]index\.js$/ }, (at) => {
    const text = fs.readFileSync(at.path, "utf8"), plain = 'defaultCanvas.getContext("2d")';
    if (!text.includes(plain)) throw new Error(`${at.path} has no ${plain}`);
    return { contents: text.replace(plain, 'defaultCanvas.getContext("2d", {willReadFrequently: true})'), loader: "js" };
  }),
};

function licence(name) {
  const folder = path.join(__dirname, "node_modules", name);
  const file = fs.readdirSync(folder).find((f) => /^(un)?licen[cs]e/i.test(f));
  const about = JSON.parse(fs.readFileSync(path.join(folder, "package.json"), "utf8"));
  const text = file ? fs.readFileSync(path.join(folder, file), "utf8").trim() : `Licence: ${about.license}`;
  return `${name} ${about.version}\n${"-".repeat(70)}\n${text}\n`;
}

build({
  stdin: { contents: ENTRY, resolveDir: __dirname },
  outfile: path.join(FOLDER, "plotly.min.js"),
  format: "iife",
  globalName: "Plotly",
  bundle: true,
  minify: true,
  metafile: true,
  legalComments: "none", // they stand in LICENSE
  banner: { js: HEAD },
  plugins: [readBack, inlineCss(), glsl({ minify: true }), environmentPlugin({ NODE_DEBUG: false })],
  alias: { regl: "@plotly/regl", stream: "stream-browserify" },
  define: { global: "window", "define.amd": "false" },
  target: "es2016",
}).then((made) => {
  const inside = Object.keys(made.metafile.inputs).map((f) => /node_modules\/((?:@[^/]+\/)?[^/]+)/.exec(f)?.[1]);
  const names = [...new Set(inside)].filter(Boolean).sort((a, b) => (b === "plotly.js") - (a === "plotly.js") || a.localeCompare(b));
  fs.writeFileSync(path.join(FOLDER, "LICENSE"), names.map(licence).join("\n"));
  console.log(`${fs.statSync(path.join(FOLDER, "plotly.min.js")).size} bytes, of ${names.length} packages`);
});
