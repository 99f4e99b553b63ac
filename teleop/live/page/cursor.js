// Cursor of the strips: a vertical line at the mouse, and the values of all lines at its time.

import { fixed } from "./format.js";

const NEAR = 6; // largest distance between the cursor and an event whose text is shown [px]
const MOST_VALUES = 5; // largest number of values of a strip that are shown
const VALUE = 7; // number of characters of a value
const INTERVAL = 14; // number of characters of a value with its interval

export class Cursor {
  // `strips` are the strips of the page, whose rows show the values. `label` shows the time.
  constructor(parent, strips, label) {
    Object.assign(this, { parent, strips, label });
    this.x = NaN; // place of the mouse, from the left edge of the plots [px]
    parent.addEventListener("pointermove", (event) => this.#move(event));
    for (const type of ["pointerleave", "pointercancel"]) parent.addEventListener(type, () => this.hide());
  }

  hide() {
    this.x = NaN;
    this.draw();
  }

  #move(event) {
    const plot = this.strips.box();
    if (!plot) return;
    const x = event.clientX - plot.left;
    this.x = x >= 0 && x <= plot.width ? x : NaN;
    this.draw();
  }

  // Show line, time and values. This method is called in every frame, because the data move.
  draw() {
    const { strips, label, x } = this;
    const plot = Number.isFinite(x) && strips.store.count ? strips.box() : null;
    if (!plot && label.hidden) return;
    label.hidden = !plot;
    this.parent.classList.toggle("has-cursor", Boolean(plot));
    for (const row of strips.rows) if (row.line) row.line.hidden = row.readout.hidden = !plot;
    if (!plot) return;
    const t = strips.view.timeAt(x / plot.width);
    const at = strips.store.rowAfter(t) - 1;
    const event = strips.eventNear(t, (NEAR * (strips.view.span + strips.view.preview)) / plot.width);
    label.textContent = [`${fixed(strips.store.trialTime(t), 2)} s`, event && event.text].filter(Boolean).join(" · ");
    label.style.transform = `translateX(${Math.min(Math.max(x - label.offsetWidth / 2, 0), plot.width - label.offsetWidth)}px)`;
    for (const row of strips.rows) {
      if (!row.line) continue;
      row.line.style.transform = `translateX(${x}px)`;
      this.#read(row, at);
    }
  }

  #read({ chart, readout }, at) {
    const { store } = this.strips;
    const shown = chart.traces.filter((trace) => trace.opacity() === 1).slice(0, MOST_VALUES);
    while (readout.children.length > shown.length) readout.lastChild.remove();
    while (readout.children.length < shown.length) readout.append(document.createElement("span"));
    shown.forEach((trace, i) => {
      const value = at < store.first ? NaN : store.value(trace.name, at) * chart.factor;
      const half = trace.std ? 1.96 * store.value(trace.std, at) * chart.factor : NaN;
      const interval = Number.isFinite(half) ? ` ± ${fixed(half, chart.digits)}` : "";
      const name = chart.traces.length > 1 ? `${trace.label} ` : "";
      const width = `${name.length + (trace.std ? INTERVAL : VALUE)}ch`; // no value moves another one
      const text = `${name}${fixed(value, chart.digits)}${interval}`;
      const one = readout.children[i];
      if (one.style.width !== width) one.style.width = width;
      if (one.textContent !== text) one.textContent = text;
      one.style.color = trace.colour();
    });
  }
}
