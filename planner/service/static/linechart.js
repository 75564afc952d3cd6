// A chart of lines over time, as SVG with a title for screen readers.
import { make } from "./common.js";

// Okabe and Ito's colours that are dark enough on white; lines are told apart by their dashes too.
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#222222", "#9a6b00", "#7a2f8f"];
const DASHES = ["", "9 3", "3 3", "12 3 3 3", "6 6", "1 4", "14 5"];
const FEW = 40; // values that are marked one by one
const ROOM = 84; // of a name below the axis
const [WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [Math.min(640, innerWidth - 40), 260, 62, 20, 10, 40]; // letters stay readable on a phone

function svg(tag, attributes, text = "") {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [k, v] of Object.entries(attributes)) node.setAttribute(k, v);
  node.textContent = text;
  return node;
}

function ticks(low, high) {
  const step = 10 ** Math.floor(Math.log10((high - low) / 3));
  const nice = [1, 2, 5, 10].map((f) => f * step).find((s) => (high - low) / s <= 5);
  const out = [];
  for (let v = Math.ceil(low / nice) * nice; v <= high; v += nice) out.push(Number(v.toPrecision(6)));
  return out;
}

// A line goes through the values at ``at``; ``std`` of a series makes bars, ``limit`` a dashed line right across.
// ``label`` writes what stands at an axis whose few values are named one by one, such as days.
export function lineChart(title, across, at, series, label = null) {
  const reach = (s) => s.values.flatMap((v, i) => v === null ? [] : s.std ? [v - 2 * s.std[i], v + 2 * s.std[i], 0] : [v]);
  const values = series.flatMap(reach);
  let low = Math.min(...values), high = Math.max(...values);
  if (low === high) { low -= 1; high += 1; }
  const spare = label ? Math.max(1, 0.12 * (at[at.length - 1] - at[0])) : 0;
  const first = at[0] - spare, last = at[at.length - 1] === at[0] && !spare ? at[0] + 1 : at[at.length - 1] + spare;
  const x = (t) => LEFT + (WIDTH - LEFT - RIGHT) * (t - first) / (last - first);
  const y = (v) => HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * (v - low) / (high - low);
  const chart = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": `${title} over ${across}, from ${low.toFixed(1)} to ${high.toFixed(1)}` });
  for (const v of ticks(low, high)) {
    chart.append(svg("line", { x1: LEFT, x2: WIDTH - RIGHT, y1: y(v), y2: y(v), stroke: v === 0 ? "#76828d" : "#dde3e8" }));
    chart.append(svg("text", { x: LEFT - 6, y: y(v) + 4, "text-anchor": "end", "font-size": 13, fill: "#4b5763" }, String(v)));
  }
  for (const t of label ? named(at, x) : ticks(first, last)) chart.append(svg("text", { x: x(t), y: HEIGHT - 20, "text-anchor": "middle", "font-size": 13, fill: "#4b5763" }, label ? label(t) : String(t)));
  chart.append(svg("text", { x: WIDTH / 2, y: HEIGHT - 3, "text-anchor": "middle", "font-size": 13, fill: "#4b5763" }, across));
  series.forEach((s, k) => {
    const stroke = COLOURS[k % COLOURS.length];
    if (s.limit) { chart.append(svg("line", { x1: LEFT, x2: WIDTH - RIGHT, y1: y(s.values[0]), y2: y(s.values[0]), stroke, "stroke-width": 2, "stroke-dasharray": "7 5" })); return; }
    const aside = s.std ? 9 * (k - (series.length - 1) / 2) : 0; // bars stand beside each other
    const path = s.values.map((v, i) => v === null ? "" : `${i && s.values[i - 1] !== null ? "L" : "M"}${(x(at[i]) + aside).toFixed(1)} ${y(v).toFixed(1)}`).join("");
    chart.append(svg("path", { d: path, fill: "none", stroke, "stroke-width": 1.6, "stroke-dasharray": DASHES[k % DASHES.length] }));
    if (at.length > FEW) return;
    s.values.forEach((v, i) => {
      if (v === null) return;
      if (s.std) chart.append(svg("line", { x1: x(at[i]) + aside, x2: x(at[i]) + aside, y1: y(v - 2 * s.std[i]), y2: y(v + 2 * s.std[i]), stroke, "stroke-width": 1.4 }));
      chart.append(svg("circle", { cx: x(at[i]) + aside, cy: y(v), r: 4, fill: stroke }));
    });
  });
  const names = series.map((s, k) => {
    const stroke = COLOURS[k % COLOURS.length], swatch = svg("svg", { width: 34, height: 10, "aria-hidden": "true" });
    const dashes = s.limit ? "7 5" : DASHES[k % DASHES.length];
    swatch.append(svg("line", { x1: 0, x2: 34, y1: 5, y2: 5, stroke, "stroke-width": 2.5, "stroke-dasharray": dashes }));
    return make("span", { className: "legend" }, swatch, " ", s.name, " ");
  });
  return make("figure", {}, make("figcaption", {}, title, " ", ...(series.length > 1 ? names : [])), chart);
}

// Those of the values at an axis whose names have room beside each other.
function named(at, x) {
  const kept = [];
  for (const t of [...new Set(at)]) if (!kept.length || x(t) - x(kept[kept.length - 1]) > ROOM) kept.push(t);
  return kept;
}
