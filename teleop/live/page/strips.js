// All strip charts of the page, with their elements, ranges, labels, and present values as text.

import { fit } from "./canvas.js";
import { charts } from "./charts.js";
import { Strip } from "./strip.js";
import { fixed } from "./format.js";
import { percentiles } from "./scale.js";
import { onTheme } from "./theme.js";
import { previewOf } from "./target.js";

export const SPAN = 10; // past time that the charts show [s]
export const PREVIEW = 1.2; // future time for which the charts show the target [s]
const MOST_NAMED = 5; // a chart with more traces has no legend; the table of estimates shows the line styles
const LABEL = 0.95; // height of a label, relative to the size of the text of the page
const TICK = 0.8; // shortest distance of two ticks, relative to the height of a label
const SAMPLED = 8; // every eighth row is used to compute the range of the estimates
const room = new Float64Array(4096 * 8); // estimates in the first half, half widths of intervals in the second

function element(tag, name, text = "") {
  const one = document.createElement(tag);
  one.className = name;
  one.textContent = text;
  return one;
}

// Return a function that returns whether an estimate is settled in a row: the half width of the 95 %
// interval of the stiffness is at most the stiffness.
function settled(store, trace) {
  const k = store.column(trace.settled.value);
  const std = store.column(trace.settled.std);
  return (row) => !std || !(1.96 * std.at(row) > Math.abs(k.at(row)));
}

function legend(trace) {
  const one = element("span", "legend", trace.label);
  one.prepend(element("i", `swatch swatch-${trace.swatch}`));
  return one;
}

// Return the ticks whose numbers do not overlap, from the first one on.
export function apart(ticks, place, line) {
  let before = Infinity;
  return ticks.filter((tick) => {
    const isApart = Math.abs(place(tick) - before) >= line;
    if (isApart) before = place(tick);
    return isApart;
  });
}

// Return the upper edge of the label of each level, whose places `ys` increase. A label stands directly above or below
// its own line, so that nobody reads it at another line. It covers no other line and no other label. If there is no
// such place, the result is null.
export function labelTops(ys, line, height) {
  let end = 0; // lower edge of the label before
  return ys.map((y, i) => {
    const others = ys.filter((_, j) => j !== i);
    const free = (top) => top >= end && top + line <= height && !others.some((other) => other > top && other < top + line);
    const top = [y - line, y].find(free);
    if (top === undefined) return null;
    end = top + line;
    return top;
  });
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
      .filter((chart) => chart.axis || chart.traces.length)
      .map((chart) => (chart.axis ? this.#axis(chart) : this.#row(chart)));
  }

  // Create the time axis below the strip charts.
  #axis(chart) {
    const plot = element("div", "time-axis");
    const canvas = element("canvas", "");
    plot.append(canvas);
    this.parent.append(plot);
    const strip = new Strip(canvas, this.store, chart, this.timing);
    const row = { chart, strip, markers: [] };
    fit(canvas, () => this.#redraw(row));
    return row;
  }

  #row(chart) {
    if (chart.id === "position") chart.preview = this.preview;
    const box = element("section", `strip strip-${chart.id}`);
    box.style.flexGrow = chart.share;
    const title = element("h2", "strip-title", chart.title);
    const unit = element("span", "unit", chart.unit && `[${chart.unit}]`);
    title.append(" ", unit);
    const notes = element("span", "strip-notes");
    const value = element("span", "strip-value");
    const named = chart.traces.length > 1 && chart.traces.length <= MOST_NAMED ? chart.traces : [];
    title.append(...named.flatMap((trace) => [" ", legend(trace)]));
    const plot = element("div", "plot");
    const canvas = element("canvas", "");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${chart.title} over the last ten seconds`);
    const ticks = element("div", "ticks");
    plot.append(canvas);
    const markers = chart.traces.filter((trace) => trace.marker).map((trace) => element("i", `marker ${trace.marker}`));
    plot.append(...markers);
    if (this.timing.preview) {
      const now = element("i", "now-line");
      now.style.left = `${(100 * SPAN) / (SPAN + this.timing.preview)}%`;
      plot.append(now);
    }
    box.append(title, notes, value, ticks, plot);
    this.parent.append(box);
    const strip = new Strip(canvas, this.store, chart, this.timing);
    const row = { chart, strip, notes, value, ticks, plot, markers, canvas };
    fit(canvas, () => {
      chart.scale.reset();
      this.#scale(row, performance.now());
      this.#label(row);
      this.#redraw(row);
    });
    return row;
  }

  #redraw(row) {
    row.strip.invalidate();
    this.#draw(row);
  }

  #draw(row) {
    if (!row.strip.draw(this.store.last("time"))) return;
    if (row.markers.length) this.#mark(row);
    this.#write(row);
  }

  invalidate() {
    for (const row of this.rows) row.strip.invalidate();
  }

  // Draw the chart with the target in each frame, and the other charts in every second frame.
  draw(frame) {
    for (const row of this.rows) if (row.chart.preview || frame % 2) this.#draw(row);
  }

  #mark(row) {
    const { store } = this;
    const x = (SPAN / (SPAN + this.timing.preview)) * row.canvas.clientWidth;
    const scale = row.canvas.clientHeight / row.canvas.height;
    const marked = row.chart.traces.filter((trace) => trace.marker);
    marked.forEach((trace, i) => {
      const y = row.strip.y(store.last(trace.name)) * scale;
      row.markers[i].hidden = !Number.isFinite(y);
      row.markers[i].style.transform = `translate(${x}px, ${Number.isFinite(y) ? y : 0}px)`;
    });
  }

  // Write the present value as text, in the frame in which it is drawn.
  #write({ chart, value }) {
    if (chart.axis || chart.robust) return;
    const text = fixed(this.store.last(chart.traces.at(-1).name) * chart.factor, chart.digits);
    if (value.textContent !== text) value.textContent = text;
  }

  // Adapt the ranges of the charts to the data.
  scale(now) {
    for (const row of this.rows) this.#scale(row, now);
  }

  #scale(row, now) {
    if (row.chart.axis || !this.store.count) return;
    const [low, high] = row.chart.robust ? this.#robust(row.chart) : this.#extremes(row.chart);
    const most = Math.max(1.5, row.canvas.clientHeight / 22);
    if (row.chart.scale.cover(low, high, most, now)) {
      row.strip.invalidate();
      this.#label(row);
    }
  }

  #label(row) {
    const { scale, levels, factor } = row.chart;
    const height = row.plot.clientHeight;
    const line = LABEL * parseFloat(getComputedStyle(row.plot).fontSize); // height of a label [px]
    const place = (value) => scale.place(value, height, 0);
    const put = (parent, name, text, y) => {
      const label = element("span", name, text);
      label.style.top = `${y}px`;
      parent.append(label);
    };
    row.ticks.replaceChildren();
    for (const tick of apart(scale.ticks, place, TICK * line)) put(row.ticks, "tick", fixed(tick, scale.digits()), place(tick));
    for (const old of row.plot.querySelectorAll(".level")) old.remove();
    const named = levels.map(({ value, text, colour }) => {
      const shown = value * factor;
      return { y: place(shown), text: `${text} ${fixed(shown, Math.abs(shown) < 10 ? 1 : 0)}`, colour };
    });
    const inside = named.filter(({ y }) => y > 0 && y < height).sort((one, other) => one.y - other.y);
    const beside = named.filter(({ y }) => y <= 0).map(({ text }) => `${text} ↑`);
    const tops = labelTops(inside.map(({ y }) => y), line, height);
    inside.forEach(({ text, colour }, i) => {
      if (tops[i] === null) beside.push(text);
      else put(row.plot, `level level-${colour}`, text, tops[i]);
    });
    row.notes.textContent = beside.join("  ");
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
    if (chart.id === "excitation") return [0, Math.max(high, 0.2)];
    if (chart.preview) {
      low = Math.min(low, chart.preview.low);
      high = Math.max(high, chart.preview.high);
    }
    return [low * chart.factor, high * chart.factor];
  }

  // Return a range that contains most of the settled estimates, and the true values.
  #robust(chart) {
    const { store } = this;
    const start = store.rowAt(store.last("time") - SPAN);
    let low = Infinity;
    let high = -Infinity;
    let margin = Infinity; // median half width of the narrowest 95 % interval
    for (const trace of chart.traces) {
      const values = store.column(trace.name);
      const std = store.column(trace.std);
      if (!values) continue;
      let n = 0;
      let bands = 0;
      const half = room.length / 2;
      const isSettled = settled(store, trace);
      for (let row = start; row < store.count; row += SAMPLED) {
        const value = values.at(row);
        if (!Number.isFinite(value) || !isSettled(row)) continue;
        room[n++] = value;
        const s = std ? std.at(row) : NaN;
        if (Number.isFinite(s)) room[half + bands++] = 1.96 * s;
      }
      const [bottom, top] = percentiles(room.subarray(0, half), n, [0.1, 0.9]);
      const [usual] = percentiles(room.subarray(half), bands, [0.5]);
      if (usual < margin) margin = usual;
      if (bottom < low) low = bottom;
      if (top > high) high = top;
    }
    if (Number.isFinite(margin)) {
      margin = Math.min(margin, 0.5 * Math.max(high - low, chart.scale.smallest));
      low -= margin;
      high += margin;
    }
    for (const level of chart.levels) {
      if (level.text !== "true") continue;
      low = Math.min(low, level.value);
      high = Math.max(high, level.value);
    }
    return [low, high];
  }
}
