// Large display of the target, its future motion and the position of the tool, for an operator who is two
// metres away.

import { clear, fit } from "./canvas.js";
import { fixed } from "./format.js";
import { evenly, niceStep, ticksBetween } from "./scale.js";
import { colours, font, onTheme } from "./theme.js";

const PAST = 3; // past time that is shown [s]
const AHEAD = 1.2; // future time for which the target is shown [s]

export class Pursuit {
  constructor(canvas, store) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.store = store;
    this.preview = null;
    this.drawn = NaN;
    this.build(null, null);
    fit(canvas, () => {
      this.drawn = NaN;
      this.draw();
    });
    onTheme(() => (this.drawn = NaN));
  }

  build(trial, preview) {
    this.preview = preview;
    const limit = trial && trial.limits && trial.limits.soft_position;
    this.high = preview ? 1.25 * preview.high : limit ? limit[1] : 0.02;
    this.low = preview ? -0.1 * this.high : -0.15 * this.high;
    this.drawn = NaN;
  }

  draw() {
    const { canvas, context, store } = this;
    if (store.version === this.drawn) return;
    this.drawn = store.version;
    clear(context, colours.ground);
    if (!store.count) return;
    const { width, height } = canvas;
    const smaller = Math.min(height, 0.8 * width);
    const size = Math.max(smaller / 26, 12 * canvas.ratio);
    const thick = smaller / 130;
    const now = store.last("time");
    const ahead = this.preview ? AHEAD : 0;
    const x = (t) => 3.2 * size + ((t - now + PAST) / (PAST + ahead)) * (width - 3.2 * size - (ahead ? 0 : 2 * size));
    const y = (value) => height * (1 - (value - this.low) / (this.high - this.low));
    this.#grid(size, y);
    if (this.preview) this.#target(now, ahead, x, y, thick);
    this.#own(now, x, y, thick);
  }

  #grid(size, y) {
    const { context, canvas } = this;
    context.font = font(size);
    context.textAlign = "right";
    const step = niceStep((1e3 * (this.high - this.low)) / 5);
    for (const tick of ticksBetween(1e3 * this.low, 1e3 * this.high, step)) {
      const level = y(tick / 1e3);
      context.fillStyle = tick === 0 ? colours.muted : colours.grid;
      context.fillRect(3.2 * size, Math.round(level), canvas.width, Math.max(1, canvas.ratio));
      context.fillStyle = colours.muted;
      context.fillText(fixed(tick), 2.6 * size, level + 0.35 * size);
    }
    context.textAlign = "left";
    context.fillStyle = colours.text;
    context.fillText("depth [mm]", 3.6 * size, 1.4 * size);
  }

  #target(now, ahead, x, y, thick) {
    const { context, store } = this;
    const target = (t) => y(this.preview(store.trialTime(t)));
    context.lineCap = "round";
    context.lineJoin = "round";
    context.lineWidth = 5 * thick;
    context.strokeStyle = colours["target-ahead"];
    context.beginPath();
    for (const t of evenly(now - PAST, now + ahead, 0.015)) context.lineTo(x(t), target(t));
    context.stroke();
    context.strokeStyle = colours.target;
    context.lineWidth = 2 * thick;
    context.beginPath();
    context.arc(x(now), target(now), 6 * thick, 0, 7);
    context.stroke();
  }

  #own(now, x, y, thick) {
    const { context, store } = this;
    const time = store.column("time");
    const own = store.column("slave_position");
    context.lineCap = "round";
    context.lineJoin = "round";
    context.strokeStyle = colours.own;
    context.lineWidth = 1.6 * thick;
    context.beginPath();
    for (let row = store.rowAt(now - PAST); row < store.count; row += 2) context.lineTo(x(time.at(row)), y(own.at(row)));
    context.stroke();
    context.fillStyle = colours.own;
    context.beginPath();
    context.arc(x(now), y(store.last("slave_position")), 4 * thick, 0, 7);
    context.fill();
  }
}
