// Plot of contact force against displacement in the last three seconds, with the fitted force of each
// estimator.

import { clear, fit } from "./canvas.js";
import { fitCaption, fittedForce } from "./fitted_force.js";
import { fixed } from "./format.js";
import { Scale } from "./scale.js";
import { apart } from "./strips.js";
import { colours, estimatorColour, estimatorDash, font, onTheme } from "./theme.js";

const SHOWN = 3; // time that the plot shows [s]
const EVERY = 2; // the plot contains every second row
const POINTS = 40; // number of points of a fitted line

export class ForceDisplacement {
  // `emphasis` states which estimators are highlighted or hidden.
  constructor(canvas, caption, store, emphasis) {
    this.canvas = canvas;
    this.caption = caption;
    this.context = canvas.getContext("2d", { alpha: false });
    this.store = store;
    this.emphasis = emphasis;
    emphasis.onChange(() => this.invalidate());
    this.fits = [];
    this.scales = { x: new Scale(2), f: new Scale(2) };
    this.drawn = NaN;
    fit(canvas, () => {
      this.invalidate();
      this.draw(performance.now());
    });
    onTheme(() => this.invalidate());
  }

  build(welcome) {
    const name = (index) => welcome.columns[index].name;
    this.fits = welcome.estimators.map((e) => {
      const columns = Object.entries(e.further).map(([parameter, index]) => [parameter, name(index)]);
      return { label: e.name, law: fittedForce(Object.keys(e.further)), columns: [["k", name(e.k)], ...columns] };
    });
    this.caption.textContent = `Force [N] over displacement [mm], last ${SHOWN} s. ${fitCaption(this.fits)}`;
    this.invalidate();
  }

  invalidate() {
    this.drawn = NaN;
    this.top = this.caption.offsetHeight / Math.max(this.canvas.clientHeight, 1);
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
    const top = this.top * canvas.height + 0.7 * size;
    const frame = { left: 3.2 * size, right: canvas.width - size, top, bottom: canvas.height - 2.4 * size };
    const X = (value) => this.scales.x.place(value * 1e3, frame.left, frame.right);
    const Y = (value) => this.scales.f.place(value, frame.bottom, frame.top);
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
    for (const tick of apart(this.scales.f.ticks, Y, size)) {
      const y = Math.round(Y(tick));
      context.fillStyle = colours.grid;
      context.fillRect(frame.left, y, frame.right - frame.left, 1);
      context.fillStyle = colours.muted;
      context.fillText(fixed(tick, this.scales.f.digits()), frame.left - 0.5 * size, y + 0.35 * size);
    }
  }

  // Draw the fitted force of each estimator over the range of the plot.
  #fits(X, Y) {
    const { context, canvas } = this;
    const { low, high } = this.scales.x;
    context.lineWidth = 1.6 * canvas.ratio;
    context.lineCap = "butt";
    this.fits.forEach(({ label, law, columns }, index) => {
      const opacity = this.emphasis.opacity(label);
      const newest = law && opacity ? this.store.newest(columns[0][1]) : -1;
      if (newest < 0) return;
      const parameters = Object.fromEntries(columns.map(([name, column]) => [name, this.store.column(column).at(newest)]));
      context.globalAlpha = opacity;
      context.strokeStyle = estimatorColour(index);
      context.setLineDash(estimatorDash(index).map((part) => part * canvas.ratio));
      context.beginPath();
      for (let i = 0; i <= POINTS; i++) {
        const x = (low + ((high - low) * i) / POINTS) / 1e3;
        context.lineTo(X(x), Y(law.force(parameters, x)));
      }
      context.stroke();
    });
    context.globalAlpha = 1;
  }
}
