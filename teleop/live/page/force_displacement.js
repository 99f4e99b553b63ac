// Plot of contact force against displacement in the last three seconds, with the line f = k x of each
// estimator.

import { clear, fit } from "./canvas.js";
import { fixed } from "./format.js";
import { Scale } from "./scale.js";
import { colours, estimatorColour, estimatorDash, font, onTheme } from "./theme.js";

const SHOWN = 3; // time that the plot shows [s]
const EVERY = 2; // the plot contains every second row

export class ForceDisplacement {
  constructor(canvas, store) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.store = store;
    this.estimators = [];
    this.scales = { x: new Scale(2), f: new Scale(2) };
    this.drawn = NaN;
    fit(canvas, () => this.invalidate());
    onTheme(() => this.invalidate());
  }

  build(welcome) {
    this.estimators = welcome.estimators.map((e) => welcome.columns[e.k].name);
    this.invalidate();
  }

  invalidate() {
    this.drawn = NaN;
  }

  draw(now) {
    const { store, context, canvas } = this;
    if (store.version === this.drawn) return;
    this.drawn = store.version;
    if (!store.count) return clear(context, colours.ground);
    const x = store.column("slave_position");
    const f = store.column("contact_force");
    const start = store.rowAt(store.last("time") - SHOWN);
    this.#ranges(x, f, start, now);
    const size = 12 * canvas.ratio;
    const frame = { left: 3.2 * size, right: canvas.width - size, top: 2 * size, bottom: canvas.height - 2.4 * size };
    const X = (value) => place(this.scales.x, value * 1e3, frame.left, frame.right);
    const Y = (value) => place(this.scales.f, value, frame.bottom, frame.top);
    this.#axes(frame, size, X, Y);
    context.save();
    context.beginPath();
    context.rect(frame.left, frame.top, frame.right - frame.left, frame.bottom - frame.top);
    context.clip();
    this.#fits(X, Y);
    context.setLineDash([]);
    context.strokeStyle = colours.muted;
    context.lineWidth = 2.2 * canvas.ratio;
    context.beginPath();
    for (let row = start; row < store.count; row += EVERY) context.lineTo(X(x.at(row)), Y(f.at(row)));
    context.stroke();
    context.restore();
    context.fillStyle = colours.text;
    context.beginPath();
    context.arc(X(store.last("slave_position")), Y(store.last("contact_force")), 4.5 * canvas.ratio, 0, 7);
    context.fill();
  }

  #ranges(x, f, start, now) {
    const ends = [Infinity, -Infinity, Infinity, -Infinity];
    for (let row = start; row < this.store.count; row += EVERY) {
      ends[0] = Math.min(ends[0], x.at(row));
      ends[1] = Math.max(ends[1], x.at(row));
      ends[2] = Math.min(ends[2], f.at(row));
      ends[3] = Math.max(ends[3], f.at(row));
    }
    const { width, height, ratio } = this.canvas;
    this.scales.x.cover(Math.min(1e3 * ends[0], 0), 1e3 * ends[1], Math.max(2, width / ratio / 70), now);
    this.scales.f.cover(Math.min(ends[2], 0), ends[3], Math.max(2, height / ratio / 50), now);
  }

  #axes(frame, size, X, Y) {
    const { context } = this;
    context.setLineDash([]);
    clear(context, colours.ground);
    context.font = font(size);
    context.textAlign = "center";
    for (const tick of this.scales.x.ticks) {
      const x = Math.round(X(tick / 1e3));
      context.fillStyle = colours.grid;
      context.fillRect(x, frame.top, 1, frame.bottom - frame.top);
      context.fillStyle = colours.muted;
      context.fillText(fixed(tick, this.scales.x.digits()), x, frame.bottom + 1.25 * size);
    }
    context.textAlign = "right";
    for (const tick of this.scales.f.ticks) {
      const y = Math.round(Y(tick));
      context.fillStyle = colours.grid;
      context.fillRect(frame.left, y, frame.right - frame.left, 1);
      context.fillStyle = colours.muted;
      context.fillText(fixed(tick, this.scales.f.digits()), frame.left - 0.5 * size, y + 0.35 * size);
    }
    context.fillStyle = colours.text;
    context.textAlign = "left";
    context.fillText("force [N] over displacement [mm], last 3 s", 0.7 * size, 1.3 * size);
  }

  // Draw the line f = k x of each estimator over the range of the plot.
  #fits(X, Y) {
    const { context, canvas } = this;
    const { low, high } = this.scales.x;
    context.lineWidth = 1.6 * canvas.ratio;
    context.lineCap = "butt";
    this.estimators.forEach((name, index) => {
      const newest = this.store.newest(name);
      if (newest < 0) return;
      const k = this.store.column(name).at(newest);
      context.strokeStyle = estimatorColour(index);
      context.setLineDash(estimatorDash(index).map((part) => part * canvas.ratio));
      context.beginPath();
      context.moveTo(X(low / 1e3), Y((k * low) / 1e3));
      context.lineTo(X(high / 1e3), Y((k * high) / 1e3));
      context.stroke();
    });
  }
}

function place(scale, value, from, to) {
  return from + ((value - scale.low) / (scale.high - scale.low)) * (to - from);
}
