// The strip charts: elements, ranges, labels, and present values as text.

import { fit } from "./canvas.js";
import { charts } from "./charts.js";
import { Strip } from "./strip.js";
import { fixed } from "./format.js";
import { percentiles, ticksBetween } from "./scale.js";
import { onTheme } from "./theme.js";
import { previewOf } from "./target.js";

export const SPAN = 10; // s
export const PREVIEW = 1.2; // s
const SAMPLED = 8; // every so many rows are used for the range of estimates
const room = new Float64Array(4096 * 8);

function element(tag, name, text = "") {
  const one = document.createElement(tag);
  one.className = name;
  one.textContent = text;
  return one;
}

export class Strips {
  constructor(parent, store) {
    this.parent = parent;
    this.store = store;
    this.rows = [];
    onTheme(() => this.invalidate());
  }

  build(welcome, trial) {
    this.parent.replaceChildren();
    this.preview = previewOf(trial);
    this.timing = { span: SPAN, preview: this.preview ? PREVIEW : 0 };
    this.rows = charts(welcome, trial)
      .filter((chart) => chart.traces.length)
      .map((chart) => this.#row(chart));
    this.axis = element("div", "time-axis");
    for (const t of ticksBetween(-SPAN, this.timing.preview, 2)) {
      const label = element("span", "tick", t === 0 ? "now" : `${fixed(t)} s`);
      label.style.left = `${(100 * (t + SPAN)) / (SPAN + this.timing.preview)}%`;
      this.axis.append(label);
    }
    this.parent.append(this.axis);
  }

  #row(chart) {
    if (chart.id === "position") chart.preview = this.preview;
    const box = element("section", `strip strip-${chart.id}`);
    box.style.flexGrow = chart.share;
    const title = element("h2", "strip-title", chart.title);
    const unit = element("span", "unit", chart.unit && `[${chart.unit}]`);
    title.append(" ", unit);
    const value = element("span", "strip-value");
    const plot = element("div", "plot");
    const canvas = element("canvas", "");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${chart.title} over the last ten seconds`);
    const ticks = element("div", "ticks");
    plot.append(canvas);
    const markers = chart.markers ? [element("i", "marker target-marker"), element("i", "marker own-marker")] : [];
    plot.append(...markers);
    if (this.timing.preview) {
      const now = element("i", "now-line");
      now.style.left = `${(100 * SPAN) / (SPAN + this.timing.preview)}%`;
      plot.append(now);
    }
    box.append(title, value, ticks, plot);
    this.parent.append(box);
    const strip = new Strip(canvas, this.store, chart, this.timing);
    const row = { chart, strip, box, value, ticks, plot, markers, canvas };
    fit(canvas, () => {
      chart.scale.reset();
      strip.invalidate();
    });
    return row;
  }

  invalidate() {
    for (const row of this.rows) row.strip.invalidate();
  }

  draw(time) {
    for (const row of this.rows) {
      if (row.strip.draw(time) && row.markers.length) this.#mark(row);
    }
  }

  #mark(row) {
    const { store } = this;
    const x = (SPAN / (SPAN + this.timing.preview)) * row.canvas.clientWidth;
    const scale = row.canvas.clientHeight / row.canvas.height;
    const names = ["target", "slave_position"];
    names.forEach((name, i) => {
      const y = row.strip.y(store.last(name)) * scale;
      row.markers[i].hidden = !Number.isFinite(y);
      row.markers[i].style.transform = `translate(${x}px, ${Number.isFinite(y) ? y : 0}px)`;
    });
  }

  // Ranges and texts; called a few times a second.
  update(now) {
    if (!this.store.count) return;
    for (const row of this.rows) {
      const [low, high] = row.chart.robust ? this.#robust(row.chart) : this.#extremes(row.chart);
      const most = Math.max(2, Math.floor(row.canvas.clientHeight / 34));
      if (row.chart.scale.cover(low, high, most, now)) {
        row.strip.invalidate();
        this.#label(row);
      }
      const first = row.chart.traces[row.chart.robust ? 0 : row.chart.traces.length - 1];
      if (!row.chart.robust) row.value.textContent = fixed(this.store.last(first.name) * row.chart.factor, row.chart.digits);
    }
  }

  #label(row) {
    const { scale, levels, factor } = row.chart;
    const place = (value) => `${100 * (1 - (value - scale.low) / (scale.high - scale.low))}%`;
    row.ticks.replaceChildren(
      ...scale.ticks.map((tick) => {
        const label = element("span", "tick", fixed(tick, scale.digits()));
        label.style.top = place(tick);
        return label;
      }),
    );
    for (const old of row.plot.querySelectorAll(".level")) old.remove();
    let above = 0;
    for (const level of levels) {
      const value = level.value * factor;
      const text = `${level.text} ${fixed(value)}`;
      const inside = value > scale.low && value < scale.high;
      if (!inside && (value < scale.low || level.text === "true")) continue;
      const label = element("span", `level level-${level.text === "true" ? "truth" : "limit"}`, inside ? text : `${text} ↑`);
      if (inside) label.style.top = place(value);
      else label.classList.add(above++ ? "level-above-2" : "level-above");
      row.plot.append(label);
    }
  }

  #extremes(chart) {
    const { store } = this;
    let low = Infinity;
    let high = -Infinity;
    const start = store.rowAt(store.last("time") - SPAN);
    for (const trace of chart.traces) {
      const values = store.column(trace.name);
      for (let row = start; values && row < store.count; row++) {
        const value = values.at(row);
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (chart.id === "excitation") return [0, 1];
    if (chart.preview) {
      low = Math.min(low, chart.preview.low);
      high = Math.max(high, chart.preview.high);
    }
    return [low * chart.factor, high * chart.factor];
  }

  // Range of estimates without the transients of the start; true values are always included.
  #robust(chart) {
    const { store } = this;
    const start = store.rowAt(store.last("time") - SPAN);
    let low = Infinity;
    let high = -Infinity;
    for (const trace of chart.traces) {
      const values = store.column(trace.name);
      const std = store.column(trace.std);
      if (!values) continue;
      let n = 0;
      let bands = 0;
      const half = room.length / 2;
      for (let row = start; row < store.count; row += SAMPLED) {
        const value = values.at(row);
        if (!Number.isFinite(value)) continue;
        room[n++] = value;
        const s = std ? std.at(row) : NaN;
        if (Number.isFinite(s)) room[half + bands++] = 1.96 * s;
      }
      const [bottom, top] = percentiles(room.subarray(0, half), n, [0.06, 0.94]);
      const [usual] = percentiles(room.subarray(half), bands, [0.5]);
      const margin = Math.min(usual || 0, 0.6 * Math.max(top - bottom, chart.scale.smallest));
      if (bottom - margin < low) low = bottom - margin;
      if (top + margin > high) high = top + margin;
    }
    for (const level of chart.levels) {
      if (level.text !== "true") continue;
      low = Math.min(low, level.value);
      high = Math.max(high, level.value);
    }
    return [low, high];
  }
}
