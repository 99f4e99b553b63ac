// A strip chart that is drawn incrementally: the picture moves left by whole pixels, and only the new
// columns of pixels and the new samples are drawn.

import { clear } from "./canvas.js";
import { fixed } from "./format.js";
import { evenly } from "./scale.js";
import { colours, estimatorColour, font } from "./theme.js";

const EMPTY = -1; // value of `generation` for a chart without samples
const LONGEST_STEP = 1.0; // time without samples after which lines are interrupted [s]

export class Strip {
  // `timing` is {span, preview}: the past time and the future time that the chart shows [s]. `chart` is one of the
  // charts in charts.js.
  constructor(canvas, store, chart, timing) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.store = store;
    this.chart = chart;
    this.timing = timing;
    this.invalidate();
  }

  invalidate() {
    this.generation = NaN;
  }

  // Number of pixels per second.
  get perSecond() {
    return this.canvas.width / (this.timing.span + this.timing.preview);
  }

  y(value) {
    return this.chart.scale.place(value * this.chart.factor, this.canvas.height, 0);
  }

  draw(time) {
    const { store, canvas } = this;
    if (!store.count) {
      if (this.generation !== EMPTY) clear(this.context, this.chart.axis ? colours.page : colours.ground);
      this.generation = EMPTY;
      return false;
    }
    const edge = Math.floor((time + this.timing.preview) * this.perSecond) + 1;
    const moved = edge - this.edge;
    const valid = this.generation === store.generation && moved >= 0 && moved < canvas.width;
    if (valid && moved === 0 && this.row === store.count) return false;
    if (valid) {
      if (moved) this.#scroll(moved);
      this.edge = edge;
    } else {
      this.#restart(edge, time);
    }
    this.#traces(time);
    this.row = store.count;
    return true;
  }

  #restart(edge, time) {
    this.edge = edge;
    this.generation = this.store.generation;
    this.row = this.store.rowAt(time - this.timing.span);
    for (const trace of this.chart.traces) Object.assign(trace, { t: NaN, length: 0, column: -Infinity });
    this.previewed = -Infinity;
    this.#background(0, this.canvas.width);
  }

  #scroll(moved) {
    const { width, height } = this.canvas;
    this.context.drawImage(this.canvas, moved, 0, width - moved, height, 0, 0, width - moved, height);
    const edge = this.edge;
    this.edge = edge + moved;
    this.#background(width - moved, width);
  }

  // Draw background, grid, limits and true values in the columns of pixels from x0 to x1.
  #background(x0, x1) {
    const { context, canvas, chart } = this;
    const first = this.edge - canvas.width; // index of the pixel column at x = 0, counted from time 0
    context.setLineDash([]);
    context.fillStyle = chart.axis ? colours.page : colours.ground;
    context.fillRect(x0, 0, x1 - x0, canvas.height);
    context.fillStyle = colours.grid;
    for (const tick of chart.scale.ticks) {
      context.fillRect(x0, Math.round(this.y(tick / chart.factor)), x1 - x0, 1);
    }
    const every = 2 * this.perSecond;
    const left = first - (this.store.origin || 0) * this.perSecond;
    for (const i of evenly(Math.ceil((left + x0 - 1) / every), (left + x1) / every, 1)) {
      const x = Math.floor(i * every - left);
      if (x < x0 || x >= x1) continue;
      context.fillRect(x, 0, 1, canvas.height);
      if (chart.axis && this.store.origin !== null) this.#time(2 * i, x);
    }
    for (const level of chart.levels) {
      const y = Math.round(this.y(level.value)) + 0.5;
      context.strokeStyle = colours[level.colour];
      context.lineWidth = 1.5 * this.thickness;
      context.setLineDash(level.dash);
      context.lineDashOffset = (first + x0) % level.dash.reduce((a, b) => a + b, 0);
      context.beginPath();
      context.moveTo(x0, y);
      context.lineTo(x1, y);
      context.stroke();
    }
    context.setLineDash([]);
  }

  // Draw the label of a vertical grid line. It is on the left of the line, because the part of the picture on the
  // right of the line is not drawn yet.
  #time(t, x) {
    const { context, canvas } = this;
    context.font = font(0.68 * canvas.height);
    context.textAlign = "right";
    context.fillStyle = colours.muted;
    context.fillText(`${fixed(t)} s`, x - 0.3 * canvas.height, 0.75 * canvas.height);
    context.fillStyle = colours.grid;
  }

  #traces(time) {
    if (this.chart.preview) this.#preview(time + this.timing.preview);
    for (const trace of this.chart.traces) if (trace.std) this.#band(trace);
    for (const trace of this.chart.traces) this.#line(trace);
  }

  // Draw the target up to the right edge. The page computes it from the description of the trial.
  #preview(end) {
    const { context, perSecond, chart } = this;
    const first = this.edge - this.canvas.width;
    const target = (at) => this.y(chart.preview(this.store.trialTime(at)));
    const start = Math.max(this.previewed, first / perSecond);
    this.#stroke(colours["target-ahead"], 5, [], 0);
    context.beginPath();
    for (const t of [...evenly(start, end, 0.02), end]) context.lineTo(t * perSecond - first, target(t));
    context.stroke();
    this.previewed = end;
  }

  #stroke(colour, width, dash, offset) {
    const { context } = this;
    context.strokeStyle = colour;
    context.lineWidth = width * this.thickness;
    context.lineCap = dash.length ? "butt" : "round";
    context.lineJoin = "round";
    context.setLineDash(dash.map((part) => part * this.thickness));
    context.lineDashOffset = offset;
  }

  get thickness() {
    return this.canvas.ratio || 1;
  }

  #line(trace) {
    const { context, store, perSecond } = this;
    const first = this.edge - this.canvas.width;
    const time = store.column("time");
    const values = store.column(trace.name);
    if (!values) return;
    this.#stroke(trace.colour(), trace.width, trace.dash, trace.length);
    context.beginPath();
    let x = trace.t * perSecond - first;
    let y = this.y(trace.value);
    let known = !Number.isNaN(x) && !Number.isNaN(y);
    if (known) context.moveTo(x, y);
    for (let row = this.row; row < store.count; row++) {
      const t = time.at(row);
      const nextX = t * perSecond - first;
      const nextY = this.y(values.at(row));
      if (known && !Number.isNaN(nextY) && t - trace.t < LONGEST_STEP) {
        context.lineTo(nextX, nextY);
        if (trace.dash.length) trace.length += Math.hypot(nextX - x, nextY - y);
      } else if (!Number.isNaN(nextY)) {
        context.moveTo(nextX, nextY);
      }
      known = !Number.isNaN(nextY);
      x = nextX;
      y = nextY;
      trace.t = t;
      trace.value = values.at(row);
    }
    context.stroke();
  }

  // Draw the 95 % interval, as one rectangle for each complete column of pixels. Nothing is drawn while
  // the estimate is held constant.
  #band(trace) {
    const { context, store, perSecond } = this;
    const first = this.edge - this.canvas.width;
    const time = store.column("time");
    const values = store.column(trace.name);
    const std = store.column(trace.std);
    const held = trace.held && store.column(trace.held);
    if (!values || !std) return;
    context.fillStyle = estimatorColour(trace.index);
    for (let row = this.row; row < store.count; row++) {
      const column = Math.floor(time.at(row) * perSecond);
      if (column === trace.column) continue;
      const start = Math.max(trace.column + 1, column - 4);
      trace.column = column;
      const half = 1.96 * std.at(row);
      if (!Number.isFinite(half) || (held && held.at(row) === 1)) continue;
      const top = Math.max(this.y(values.at(row) + half), 0);
      const bottom = Math.min(this.y(values.at(row) - half), this.canvas.height);
      const beyond = top === 0 && bottom === this.canvas.height;
      context.globalAlpha = beyond ? 0.06 : 0.24;
      if (bottom > top) context.fillRect(start - first, top, column + 1 - start, bottom - top);
    }
    context.globalAlpha = 1;
  }
}
