// All strip charts of the page, with their elements, ranges, labels, and present values as text.

import { fit } from "./canvas.js";
import { charts } from "./charts.js";
import { Strip } from "./strip.js";
import { fixed } from "./format.js";
import { percentiles } from "./scale.js";
import { onTheme } from "./theme.js";
import { previewOf } from "./target.js";

const MOST_NAMED = 5; // a chart with more traces has no legend; the table of estimates shows the line styles
const LABEL = 0.95; // height of a label, relative to the size of the text of the page
const TICK = 0.8; // shortest distance of two ticks, relative to the height of a label
const ZOOM = 1.25; // change of the range of values by one step of the wheel
const MOST_SAMPLED = 512; // largest number of rows of an estimate from which its range is computed
// Estimates in the first half, half widths of intervals in the second. There is one more row in the newest window.
const room = new Float64Array(2 * (MOST_SAMPLED + 2));

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

// Return the name of a line with its colour. The name of an estimator is a button.
function legend(trace, emphasis) {
  const one = element(trace.isEstimator ? "button" : "span", "legend", trace.label);
  one.prepend(element("i", `swatch swatch-${trace.swatch}`));
  if (trace.isEstimator) {
    one.type = "button";
    emphasis.attach(one, trace.label);
  }
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
  // The charts are created in the element `parent`. `axis` is the canvas of the time axis below them.
  constructor(parent, axis, { store, view, emphasis }) {
    Object.assign(this, { parent, axis, store, view, emphasis });
    this.rows = [];
    this.events = []; // {time, text, fault} of each event of the trial
    onTheme(() => this.invalidate());
    emphasis.onChange(() => this.invalidate());
    view.onChange(() => this.#viewed());
  }

  setEvents(events) {
    this.events = events;
    this.invalidate();
  }

  // Return the event that is closest to a time, if it is at most `most` away [s].
  eventNear(t, most) {
    const distance = ({ time }) => Math.abs(time - t);
    const near = this.events.filter((event) => distance(event) <= most);
    return near.sort((one, other) => distance(one) - distance(other))[0];
  }

  // Return the place of the plots on the screen; undefined before there are plots.
  box() {
    return this.rows[0]?.plot?.getBoundingClientRect();
  }

  // Make the range of values of a strip larger (steps > 0) or smaller, and keep it. The value at the place `share`, from
  // the top as a fraction of the height, keeps its place. The numbers of the strip are in the element `ticks`.
  zoomValues(ticks, steps, share) {
    this.#keepRange(ticks, ({ low, high }) => {
      const value = high - share * (high - low);
      return [low, high].map((end) => value + (end - value) * ZOOM ** steps);
    });
  }

  // Move the curves of a strip down by a fraction of its height, and keep the range.
  moveValues(ticks, share) {
    this.#keepRange(ticks, ({ low, high }) => [low, high].map((end) => end + share * (high - low)));
  }

  // Let the range of a strip follow its data again.
  releaseValues(ticks) {
    this.#changeRange(ticks, (scale) => scale.release());
  }

  #keepRange(ticks, change) {
    this.#changeRange(ticks, (scale) => scale.keep(...change(scale)));
  }

  #changeRange(ticks, change) {
    const row = this.rows.find((one) => one.ticks === ticks);
    if (!row) return; // a new trial has replaced the strip
    change(row.chart.scale);
    ticks.classList.toggle("is-kept", Boolean(row.chart.scale.kept));
    this.#scale(row, performance.now());
    row.strip.invalidate();
  }

  #viewed() {
    for (const row of this.rows) {
      row.chart.scale.reset();
      if (row.now) row.now.style.left = `${100 * this.view.share}%`;
    }
    this.invalidate();
    this.scale(performance.now());
  }

  build(welcome, trial) {
    this.parent.replaceChildren();
    this.preview = previewOf(trial);
    this.view.hasTarget = Boolean(this.preview);
    this.rows = charts(welcome, trial, this.emphasis)
      .filter((chart) => chart.axis || chart.traces.length)
      .map((chart) => (chart.axis ? this.#axis(chart) : this.#row(chart)));
  }

  #strip(canvas, chart) {
    return new Strip(canvas, this.store, chart, this.view, () => this.events);
  }

  // Create the time axis below the strip charts.
  #axis(chart) {
    const row = { chart, strip: this.#strip(this.axis, chart), markers: [] };
    fit(this.axis, () => this.#redraw(row));
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
    const plot = element("div", "plot");
    const canvas = element("canvas", "");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${chart.title} over time`);
    const ticks = element("div", "ticks");
    ticks.title = "range: the wheel zooms, dragging moves, a double click returns to the automatic range";
    plot.append(canvas);
    const markers = chart.traces.filter((trace) => trace.marker).map((trace) => element("i", `marker ${trace.marker}`));
    plot.append(...markers);
    const now = this.preview ? element("i", "now-line") : null;
    if (now) {
      now.style.left = `${100 * this.view.share}%`;
      plot.append(now);
    }
    const line = element("i", "cursor-line");
    const readout = element("span", "strip-readout");
    line.hidden = readout.hidden = true;
    plot.append(line);
    box.append(title, notes, value, ticks, plot, readout);
    this.parent.append(box);
    title.append(...named.flatMap((trace) => [" ", legend(trace, this.emphasis)]));
    const strip = this.#strip(canvas, chart);
    const row = { chart, strip, notes, value, ticks, plot, markers, canvas, now, line, readout };
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
    if (!row.strip.draw()) return;
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
    const x = this.view.share * row.canvas.clientWidth;
    const scale = row.canvas.clientHeight / row.canvas.height;
    const marked = row.chart.traces.filter((trace) => trace.marker);
    marked.forEach((trace, i) => {
      const y = row.strip.y(store.value(trace.name, this.#lastRow)) * scale;
      row.markers[i].hidden = !Number.isFinite(y);
      row.markers[i].style.transform = `translate(${x}px, ${Number.isFinite(y) ? y : 0}px)`;
    });
  }

  // Last row of the past time.
  get #lastRow() {
    const { store, view } = this;
    return (view.follows ? store.count : store.rowAfter(view.time)) - 1;
  }

  // Write the value at the end of the past time as text, in the frame in which it is drawn.
  #write({ chart, value }) {
    if (chart.axis || chart.robust) return;
    const text = fixed(this.store.value(chart.traces.at(-1).name, this.#lastRow) * chart.factor, chart.digits);
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
    const named = levels.map(({ value, text, colour, digits, isBeside }) => {
      const shown = value * factor;
      return { y: place(shown), text: `${text} ${fixed(shown, digits ?? (Math.abs(shown) < 10 ? 1 : 0))}`, colour, isBeside };
    });
    const inside = named.filter(({ y, isBeside }) => y > 0 && y < height && !isBeside).sort((one, other) => one.y - other.y);
    const beside = named.filter(({ y, isBeside }) => y <= 0 || isBeside).map(({ y, text }) => (y <= 0 ? `${text} ↑` : text));
    const tops = labelTops(inside.map(({ y }) => y), line, height);
    inside.forEach(({ text, colour }, i) => {
      if (tops[i] === null) beside.push(text);
      else put(row.plot, `level level-${colour}`, text, tops[i]);
    });
    row.notes.replaceChildren(...beside.map((text) => element("span", "", text)));
  }

  #extremes(chart) {
    const { store } = this;
    let low = Infinity;
    let high = -Infinity;
    const [start, end] = this.#shown();
    for (const trace of chart.traces) {
      const values = store.column(trace.name);
      for (let row = start; values && row < end; row++) {
        const value = values.at(row);
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (chart.most) return [0, chart.factor * Math.min(high, chart.most)];
    if (chart.preview) {
      low = Math.min(low, chart.preview.low);
      high = Math.max(high, chart.preview.high);
    }
    return [low * chart.factor, high * chart.factor];
  }

  // Return the first of the rows that are shown, and the row after the last one.
  #shown() {
    const { store, view } = this;
    const end = view.follows ? store.count : Math.min(store.rowAfter(view.time + view.preview), store.count);
    return [store.rowAt(view.time - view.span), end];
  }

  // Return a range that contains most of the settled estimates that are not hidden, and the true value. Without
  // estimates, it contains all true values.
  #robust(chart) {
    const { store } = this;
    const [start, end] = this.#shown();
    const step = Math.ceil((end - start) / MOST_SAMPLED) || 1;
    let low = Infinity;
    let high = -Infinity;
    let margin = Infinity; // median half width of the narrowest 95 % interval
    for (const trace of chart.traces) {
      const values = store.column(trace.name);
      const std = store.column(trace.std);
      if (!values || !trace.opacity()) continue;
      let n = 0;
      let bands = 0;
      const half = room.length / 2;
      const isSettled = settled(store, trace);
      for (let row = start; row < end; row += step) {
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
    const isEmpty = low > high;
    for (const level of chart.levels) {
      if (level.text !== "true" && !isEmpty) continue;
      low = Math.min(low, level.value);
      high = Math.max(high, level.value);
    }
    return [low, high];
  }
}
