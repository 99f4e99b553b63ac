// Picture of the tool and of the indented surface of the specimen. The tool is drawn at the position of the slave,
// and a ring at the intended position of the hand. The larger the force of the hand, the larger is the distance
// between tool and ring.

import { clear, fit } from "./canvas.js";
import { fixed } from "./format.js";
import { colours, font, onTheme } from "./theme.js";

const PULL = 0.5; // force with which the specimen must pull, so that it is drawn at the tool if nobody knows whether it is glued [N]
const COMPRESSION = 0.8; // part of the bar of the force that shows compression; the rest shows tension
const ABOVE = 0.45; // height above the surface, as a fraction of the largest depth in the picture

export class Tool {
  constructor(canvas, store, hand) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.store = store;
    this.hand = hand; // {depth, grip}, see pointer.js
    this.deepest = 0.02;
    this.softForce = NaN;
    this.glued = null; // whether the specimen is glued to the tool; null if this is not known
    this.drawn = "";
    fit(canvas, () => {
      this.invalidate();
      this.draw();
    });
    onTheme(() => this.invalidate());
  }

  build(trial) {
    const limits = (trial && trial.limits) || {};
    this.deepest = (limits.soft_position && limits.soft_position[1]) || 0.02;
    this.softForce = limits.soft_force || NaN;
    this.glued = trial ? trial.glued : null;
    this.invalidate();
  }

  invalidate() {
    this.drawn = "";
  }

  // Return the depth [m] at a distance from the top, given as a fraction of the height of the canvas.
  depthAt(share) {
    return (share * (1 + ABOVE) - ABOVE) * this.deepest;
  }

  #y(depth) {
    return ((depth / this.deepest + ABOVE) / (1 + ABOVE)) * this.canvas.height;
  }

  draw() {
    const { store, canvas, hand } = this;
    if (!canvas.width) return;
    const depth = store.count ? store.last("slave_position") : 0;
    const force = store.count ? store.last("contact_force") : 0;
    const target = store.count ? store.last("target") : NaN;
    const key = `${fixed(this.#y(depth), 1)} ${fixed(force, 1)} ${fixed(this.#y(target), 0)} ${hand.grip} ${fixed(this.#y(hand.depth), 0)}`;
    if (key === this.drawn) return;
    this.drawn = key;
    this.#scene(depth, target, this.#dent(depth, force));
    if (hand.grip) this.#ring(depth);
    this.#force(force, depth);
  }

  // Return the displacement of the surface at the tool [m]. A specimen that is glued to the tool is pulled up with it.
  #dent(depth, force) {
    const pulls = this.glued ?? force < -PULL;
    return pulls ? depth : Math.max(depth, 0);
  }

  #scene(depth, target, dent) {
    const { context, canvas } = this;
    const { width, height, ratio } = canvas;
    const middle = width / 2;
    const half = Math.min(width / 9, 26 * ratio);
    const spread = half * 1.6 + 0.9 * Math.abs(this.#y(dent) - this.#y(0));
    clear(context, colours.ground);
    // Draw the surface and lines below it. Deeper lines are less indented.
    const surface = (below, share) => {
      for (let i = 0; i <= 60; i++) {
        const x = (i / 60) * width;
        const away = Math.max(Math.abs(x - middle) - half, 0) / spread;
        context.lineTo(x, this.#y(below + share * dent * Math.exp(-2 * away * away)));
      }
    };
    context.beginPath();
    surface(0, 1);
    context.lineTo(width, height);
    context.lineTo(0, height);
    context.fillStyle = colours.tissue;
    context.fill();
    context.strokeStyle = colours["tissue-line"];
    for (const layer of [0, 1, 2, 3]) {
      context.lineWidth = (layer ? 1 : 2.5) * ratio;
      context.globalAlpha = layer ? 0.45 - 0.1 * layer : 1;
      context.beginPath();
      surface(layer * 0.26 * this.deepest, 1 - 0.27 * layer);
      context.stroke();
    }
    context.globalAlpha = 1;
    if (Number.isFinite(target)) {
      context.fillStyle = colours.target;
      for (const side of [-1, 1]) context.fillRect(middle + side * 2.6 * half - half * 0.9, this.#y(target) - 2 * ratio, 1.8 * half, 4 * ratio);
    }
    const tip = this.#y(depth);
    context.fillStyle = colours.own;
    context.fillRect(middle - half * 0.32, -2, half * 0.64, Math.max(tip - half * 0.6, 0));
    context.beginPath();
    context.roundRect(middle - half, tip - half * 0.8, 2 * half, half * 0.8, [half * 0.15, half * 0.15, half * 0.25, half * 0.25]);
    context.fill();
  }

  #ring(depth) {
    const { context, canvas, hand } = this;
    const middle = canvas.width / 2;
    const radius = 11 * canvas.ratio;
    const y = Math.min(Math.max(this.#y(hand.depth), radius), canvas.height - radius);
    const tip = this.#y(depth);
    context.strokeStyle = colours.text;
    context.lineWidth = 5 * canvas.ratio;
    context.beginPath();
    context.moveTo(middle, tip);
    context.lineTo(middle, y);
    context.stroke();
    context.lineWidth = 3.5 * canvas.ratio;
    context.fillStyle = colours.force;
    context.beginPath();
    context.arc(middle, y, radius, 0, 7);
    context.fill();
    context.stroke();
  }

  #force(force, depth) {
    const { context, canvas } = this;
    const { width, height, ratio } = canvas;
    const size = 15 * ratio;
    const bar = 12 * ratio;
    const full = height - 2 * size;
    const zero = size + COMPRESSION * full;
    const end = zero - (COMPRESSION * full * force) / (this.softForce || 60);
    context.fillStyle = colours.grid;
    context.fillRect(width - 1.6 * bar, size, bar, full);
    context.fillStyle = colours.force;
    context.fillRect(width - 1.6 * bar, zero, bar, Math.min(Math.max(end, size), size + full) - zero);
    context.fillStyle = colours.text;
    context.fillRect(width - 1.8 * bar, zero - ratio, 1.4 * bar, 2 * ratio);
    context.font = font(size, "600");
    context.textAlign = "right";
    context.fillStyle = colours.text;
    context.fillText(`${fixed(force, 1)} N`, width - 2.2 * bar, 1.7 * size);
    context.textAlign = "left";
    context.fillText(`${fixed(1e3 * depth, 1)} mm`, 0.8 * size, 1.7 * size);
  }
}
