// Bar on the operator's page that shows the contact force, the soft limit and the hard limit. At the master station of
// two, it shows the force on the hand.

import { clear, fit } from "./canvas.js";
import { fixed } from "./format.js";
import { colours, font, onTheme } from "./theme.js";

export class ForceBar {
  constructor(canvas, store) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.store = store;
    this.limits = {};
    this.column = "contact_force";
    this.drawn = "";
    fit(canvas, () => {
      this.drawn = "";
      this.draw();
    });
    onTheme(() => (this.drawn = ""));
  }

  build(trial) {
    this.limits = (trial && trial.limits) || {};
    this.column = trial && trial.station === "master" ? "displayed_force" : "contact_force";
    this.drawn = "";
  }

  draw() {
    const { canvas, context, store, limits } = this;
    const force = store.last(this.column);
    const text = fixed(force, 1);
    if (!canvas.width || text === this.drawn) return;
    this.drawn = text;
    const { width, height } = canvas;
    const across = width > height; // the bar is horizontal, for example on a phone
    const most = 1.1 * (limits.hard_force || 1.2 * (limits.soft_force || 50));
    const size = Math.max(Math.min(width, height) / 9, 12 * canvas.ratio);
    clear(context, colours.ground);
    const length = (across ? width : height) - 3 * size;
    const at = (value) => (across ? size + (value / most) * length : height - size - (value / most) * length);
    const box = (from, to, start, end) => {
      if (across) context.fillRect(at(from), start * height, at(to) - at(from), (end - start) * height);
      else context.fillRect(start * width, at(to), (end - start) * width, at(from) - at(to));
    };
    context.fillStyle = colours.grid;
    box(0, most, 0.3, 0.7);
    context.fillStyle = force > limits.soft_force ? colours.limit : colours.force;
    box(0, Math.min(Math.max(force, 0), most), 0.3, 0.7);
    context.font = font(Math.max(0.8 * size, 12 * canvas.ratio));
    for (const [value, name] of [[limits.soft_force, "soft"], [limits.hard_force, "hard"]]) {
      if (!Number.isFinite(value)) continue;
      context.fillStyle = colours.limit;
      box(value - most / 300, value + most / 300, 0.2, 0.8);
      context.fillStyle = colours.text;
      context.textAlign = across ? "center" : "left";
      if (across) context.fillText(name, at(value), 0.98 * height);
      else context.fillText(name, 0.72 * width, at(value) - 0.3 * size);
    }
  }
}
