// Overview of a whole recording: position and contact force, the events, and the part that the strips show.

import { clear, fit } from "./canvas.js";
import { colours, onTheme } from "./theme.js";

const SIGNALS = [["slave_position", "own"], ["contact_force", "force"]];
const MARGIN = 0.1; // free space above and below a signal, relative to the height of its part

export class Overview {
  // `clock` is the time of the replay.
  constructor(canvas, clock) {
    Object.assign(this, { canvas, clock, store: clock.store });
    this.context = canvas.getContext("2d", { alpha: false });
    this.picture = document.createElement("canvas"); // signals and events, without the part that the strips show
    this.painted = ""; // what the picture shows
    this.drawn = "";
    fit(canvas, () => this.invalidate());
    onTheme(() => this.invalidate());
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => event.buttons & 1 && this.#go(event));
  }

  invalidate() {
    this.painted = this.drawn = "";
  }

  #down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.#go(event);
  }

  #go(event) {
    const box = this.canvas.getBoundingClientRect();
    const { start, end } = this.clock;
    this.clock.seek(start + ((event.clientX - box.left) / box.width) * (end - start));
  }

  #x(t) {
    const { start, end } = this.clock;
    return ((t - start) / (end - start || 1)) * this.canvas.width;
  }

  draw(view, events) {
    const { canvas, context, store, picture } = this;
    if (!canvas.width || !store.count) return;
    const [from, to] = [view.time - view.span, view.time].map((t) => this.#x(t));
    const content = `${store.received} ${events.length} ${this.clock.end}`;
    const key = `${Math.round(from)} ${to.toFixed(1)} ${content}`;
    if (key === this.drawn) return;
    this.drawn = key;
    if (this.painted !== content) this.#paint(events);
    this.painted = content;
    context.drawImage(picture, 0, 0);
    context.globalAlpha = 0.18;
    context.fillStyle = colours.text;
    context.fillRect(from, 0, to - from, canvas.height);
    context.globalAlpha = 1;
    context.fillRect(to - canvas.ratio, 0, 2 * canvas.ratio, canvas.height);
  }

  // Draw the signals and events of the whole recording.
  #paint(events) {
    const { picture, canvas } = this;
    Object.assign(picture, { width: canvas.width, height: canvas.height });
    const context = picture.getContext("2d");
    clear(context, colours.ground);
    SIGNALS.forEach(([name, colour], lane) => this.#signal(context, name, colours[colour], lane / SIGNALS.length));
    for (const { time, fault } of events) {
      context.fillStyle = fault ? colours.limit : colours.muted;
      context.fillRect(this.#x(time), 0, 1.5 * canvas.ratio, canvas.height);
    }
  }

  // Draw the range of a signal in each column of pixels, in its part of the height.
  #signal(context, name, colour, top) {
    const { store } = this;
    const { width, height, ratio } = this.canvas;
    const lows = new Float64Array(width + 1).fill(Infinity);
    const highs = new Float64Array(width + 1).fill(-Infinity);
    for (let row = store.first; row < store.received; row++) {
      const column = Math.max(Math.round(this.#x(store.value("time", row))), 0);
      const value = store.value(name, row);
      if (value < lows[column]) lows[column] = value;
      if (value > highs[column]) highs[column] = value;
    }
    const low = Math.min(...lows);
    const range = Math.max(...highs) - low || 1;
    const lane = height / SIGNALS.length;
    const y = (value) => top * height + lane * (1 - MARGIN - (1 - 2 * MARGIN) * ((value - low) / range));
    context.fillStyle = colour;
    context.strokeStyle = colour;
    context.lineWidth = 1.2 * ratio;
    context.beginPath();
    for (let x = 0; x <= width; x++) {
      if (lows[x] > highs[x]) continue;
      context.lineTo(x, y(highs[x]));
      context.lineTo(x, y(lows[x]));
    }
    context.stroke();
  }
}
