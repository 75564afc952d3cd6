// A chart of lines over time, as SVG with a title for screen readers.
import { make } from "/static/common.js";

const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#7a5c00", "#3c6e9e", "#555555"];
const FEW = 40; // values that are marked one by one
const [WIDTH, HEIGHT, LEFT, TOP, BOTTOM] = [640, 260, 62, 10, 40];

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

export function lineChart(title, across, at, series) {
  const values = series.flatMap((s) => s.values.filter((v) => v !== null));
  let low = Math.min(...values), high = Math.max(...values);
  if (low === high) { low -= 1; high += 1; }
  const [first, last] = [at[0], at[at.length - 1] === at[0] ? at[0] + 1 : at[at.length - 1]];
  const x = (t) => LEFT + (WIDTH - LEFT - 8) * (t - first) / (last - first);
  const y = (v) => HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * (v - low) / (high - low);
  const chart = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": `${title} over ${across}, from ${low.toFixed(1)} to ${high.toFixed(1)}` });
  for (const v of ticks(low, high)) {
    chart.append(svg("line", { x1: LEFT, x2: WIDTH - 8, y1: y(v), y2: y(v), stroke: "#dde3e8" }));
    chart.append(svg("text", { x: LEFT - 6, y: y(v) + 4, "text-anchor": "end", "font-size": 13, fill: "#4b5763" }, String(v)));
  }
  for (const t of ticks(first, last)) chart.append(svg("text", { x: x(t), y: HEIGHT - 20, "text-anchor": "middle", "font-size": 13, fill: "#4b5763" }, String(t)));
  chart.append(svg("text", { x: WIDTH / 2, y: HEIGHT - 3, "text-anchor": "middle", "font-size": 13, fill: "#4b5763" }, across));
  series.forEach((s, k) => {
    const path = s.values.map((v, i) => v === null ? "" : `${i && s.values[i - 1] !== null ? "L" : "M"}${x(at[i]).toFixed(1)} ${y(v).toFixed(1)}`).join("");
    chart.append(svg("path", { d: path, fill: "none", stroke: COLOURS[k % COLOURS.length], "stroke-width": 1.4 }));
    if (at.length <= FEW) s.values.forEach((v, i) => v === null || chart.append(svg("circle", { cx: x(at[i]), cy: y(v), r: 4, fill: COLOURS[k % COLOURS.length] })));
  });
  const names = series.map((s, k) => {
    const swatch = make("span", { className: "swatch" });
    swatch.style.background = COLOURS[k % COLOURS.length];
    return make("span", {}, swatch, `${s.name}  `);
  });
  return make("figure", {}, make("figcaption", {}, title, " ", ...(series.length > 1 ? names : [])), chart);
}
