// A strip chart that is drawn incrementally: the picture moves left by whole pixels, and only the new
// columns of pixels and the new samples are drawn.

import { clear } from "./canvas.js";
import { fixed } from "./format.js";
import { evenly, niceStep } from "./scale.js";
import { colours, estimatorColour, font } from "./theme.js";

const EMPTY = -1; // value of `generation` for a chart without samples
const ROWS_PER_PIXEL = 2; // if there are more rows, some are left out when a whole picture is drawn
const LONGEST_COLUMN = 0.05; // longest time that the interval of one row covers [s]
const TARGET_POINTS = 600; // number of points of the target in a whole picture
const LONGEST_STEP = 1.0; // time without samples after which lines are interrupted [s]

export class Strip {
  // `view` states which time the chart shows. `chart` is one of the charts in charts.js, and `events` returns the events
  // of the trial.
  constructor(canvas, store, chart, view, events) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.store = store;
    this.chart = chart;
    this.view = view;
    this.events = events;
    this.invalidate();
  }

  invalidate() {
    this.generation = NaN;
  }

  // Number of pixels per second.
  get perSecond() {
    return this.canvas.width / (this.view.span + this.view.preview);
  }

  y(value) {
    return this.chart.scale.place(value * this.chart.factor, this.canvas.height, 0);
  }

  // Draw what has changed. Return whether something was drawn.
  draw() {
    const { store, canvas, view } = this;
    if (!store.count) {
      if (this.generation !== EMPTY) clear(this.context, this.chart.axis ? colours.page : colours.ground);
      this.generation = EMPTY;
      return false;
    }
    const { time } = view;
    const edge = Math.floor((time + view.preview) * this.perSecond) + 1;
    this.end = view.follows ? store.count : Math.min(store.rowAfter(time + view.preview), store.count);
    const moved = edge - this.edge;
    const valid = this.generation === store.generation && moved >= 0 && moved < canvas.width;
    if (valid && moved === 0 && this.row === this.end) return false;
    if (valid) {
      if (moved) this.#scroll(moved);
      this.edge = edge;
    } else {
      this.#restart(edge, time);
    }
    this.#traces(time);
    this.row = this.end;
    this.stride = 1;
    return true;
  }

  #restart(edge, time) {
    this.edge = edge;
    this.generation = this.store.generation;
    this.row = this.store.rowAt(time - this.view.span);
    this.stride = Math.max(1, Math.floor((this.end - this.row) / (ROWS_PER_PIXEL * this.canvas.width)));
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
    const step = niceStep(this.view.span / 5); // time between two grid lines [s]
    const every = step * this.perSecond;
    const left = first - (this.store.origin || 0) * this.perSecond;
    for (const i of evenly(Math.ceil((left + x0 - 1) / every), (left + x1) / every, 1)) {
      const x = Math.floor(i * every - left);
      if (x < x0 || x >= x1) continue;
      context.fillRect(x, 0, 1, canvas.height);
      if (chart.axis && this.store.origin !== null) this.#time(fixed(step * i, step < 1 ? 1 : 0), x);
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
    for (const { time, fault } of this.events()) {
      const x = Math.floor(time * this.perSecond) - first;
      if (x < x0 || x >= x1) continue;
      context.fillStyle = fault ? colours.limit : colours.muted;
      const dash = chart.axis ? canvas.height / 3 : 4 * this.thickness; // on the time axis, a short mark
      const gap = chart.axis ? canvas.height : 3 * this.thickness;
      for (let y = 0; y < canvas.height; y += dash + gap) context.fillRect(x, y, 1.5 * this.thickness, dash);
    }
  }

  // Draw the label of a vertical grid line. It is on the left of the line, because the part of the picture on the
  // right of the line is not drawn yet.
  #time(text, x) {
    const { context, canvas } = this;
    context.font = font(0.68 * canvas.height);
    context.textAlign = "right";
    context.fillStyle = colours.muted;
    context.fillText(`${text} s`, x - 0.3 * canvas.height, 0.75 * canvas.height);
    context.fillStyle = colours.grid;
  }

  #traces(time) {
    if (this.chart.preview) this.#preview(time + this.view.preview);
    const shown = this.chart.traces.filter((trace) => trace.opacity());
    for (const trace of shown) if (trace.std) this.#band(trace);
    for (const trace of shown) this.#line(trace);
    this.context.globalAlpha = 1;
  }

  // Draw the target up to the right edge. The page computes it from the description of the trial.
  #preview(end) {
    const { context, perSecond, chart } = this;
    const first = this.edge - this.canvas.width;
    const target = (at) => this.y(chart.preview(this.store.trialTime(at)));
    const start = Math.max(this.previewed, first / perSecond);
    this.#stroke(colours["target-ahead"], 5, [], 0);
    context.beginPath();
    const step = (this.view.span + this.view.preview) / TARGET_POINTS;
    for (const t of [...evenly(start, end, step), end]) context.lineTo(t * perSecond - first, target(t));
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
    this.#stroke(trace.colour(), trace.width(), trace.dash, trace.length);
    context.globalAlpha = trace.opacity();
    context.beginPath();
    let x = trace.t * perSecond - first;
    let y = this.y(trace.value);
    let known = !Number.isNaN(x) && !Number.isNaN(y);
    if (known) context.moveTo(x, y);
    for (let row = this.row; row < this.end; row += this.stride) {
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
    for (let row = this.row; row < this.end; row += this.stride) {
      const column = Math.floor(time.at(row) * perSecond);
      if (column === trace.column) continue;
      const start = Math.max(trace.column + 1, column - Math.ceil(LONGEST_COLUMN * perSecond));
      trace.column = column;
      const half = 1.96 * std.at(row);
      if (!Number.isFinite(half) || (held && held.at(row) === 1)) continue;
      const top = Math.max(this.y(values.at(row) + half), 0);
      const bottom = Math.min(this.y(values.at(row) - half), this.canvas.height);
      const beyond = top === 0 && bottom === this.canvas.height;
      context.globalAlpha = (beyond ? 0.06 : 0.24) * trace.opacity();
      if (bottom > top) context.fillRect(start - first, top, column + 1 - start, bottom - top);
    }
  }
}
