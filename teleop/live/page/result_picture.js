// Picture of force over depth: the samples, the fit of the best model, and k as the slope at its point.

import { fixed } from "./format.js";
import { Scale } from "./scale.js";

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 340;
const HEIGHT = 190;
const FRAME = { left: 34, right: WIDTH - 8, top: 22, bottom: HEIGHT - 22 };
const TANGENT = 0.3; // length of the line of slope k, as a part of the range of the depth

function add(parent, kind, attributes, text) {
  const one = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(attributes)) one.setAttribute(name, value);
  if (text !== undefined) one.textContent = text;
  parent.append(one);
  return one;
}

function scaleOf(values, least) {
  const known = values.filter(Number.isFinite);
  const scale = new Scale(1e-3);
  scale.cover(Math.min(...known), Math.max(...known), least, 0);
  return scale;
}

// Return one path with a dot at each point, which is faster than an element for each of them.
function dots(xs, ys, X, Y) {
  const places = xs.map((x, i) => [x, ys[i]]).filter((one) => one.every(Number.isFinite));
  return places.map(([x, y]) => `M${X(x).toFixed(1)} ${Y(y).toFixed(1)}h0`).join("");
}

// Return the picture as an SVG element. `depth` [m], `force` [N], `fit` [N] and `tangent` are those of the message `summary`.
export function picture({ depth, force, fit, tangent }) {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  svg.setAttribute("class", "result-picture");
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", "Force over depth: measured samples, the fitted model, and the slope k");
  const millimetres = depth.map((x) => 1e3 * x);
  const x = scaleOf(millimetres, 4);
  const f = scaleOf(force, 3);
  const X = (value) => x.place(value, FRAME.left, FRAME.right);
  const Y = (value) => f.place(value, FRAME.bottom, FRAME.top);
  for (const tick of x.ticks) {
    add(svg, "line", { x1: X(tick), x2: X(tick), y1: FRAME.top, y2: FRAME.bottom, class: "grid" });
    add(svg, "text", { x: X(tick), y: HEIGHT - 8, "text-anchor": "middle" }, fixed(tick, x.digits()));
  }
  for (const tick of f.ticks) {
    add(svg, "line", { x1: FRAME.left, x2: FRAME.right, y1: Y(tick), y2: Y(tick), class: "grid" });
    add(svg, "text", { x: FRAME.left - 5, y: Y(tick) + 3.5, "text-anchor": "end" }, fixed(tick, f.digits()));
  }
  add(svg, "path", { d: dots(millimetres, force, X, Y), class: "measured" });
  if (fit) add(svg, "path", { d: dots(millimetres, fit, X, Y), class: "fitted" });
  if (tangent) {
    const half = 0.5 * TANGENT * (x.high - x.low);
    const [at, level, slope] = [1e3 * tangent.depth, tangent.force, 1e-3 * tangent.k];
    const ends = { x1: X(at - half), x2: X(at + half), y1: Y(level - slope * half), y2: Y(level + slope * half) };
    add(svg, "line", { ...ends, class: "tangent" });
    add(svg, "circle", { cx: X(at), cy: Y(level), r: 3.5, class: "tangent-point" });
  }
  const title = add(svg, "text", { x: 4, y: 13, class: "title" }, "force [N] over depth [mm]");
  for (const [shown, kind, text] of [[true, "measured", "measured"], [fit, "fitted", "fit"], [tangent, "tangent", "slope k"]]) {
    if (!shown) continue;
    const one = add(title, "tspan", { dx: 9, class: `key ${kind}` }, "●");
    one.after(Object.assign(document.createElementNS(SVG, "tspan"), { textContent: ` ${text}` }));
  }
  return svg;
}
