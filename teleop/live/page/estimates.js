// Table of the estimates: k and b with 95 % intervals, whether the estimate is held constant, and the misfit.

import { percent, withInterval } from "./format.js";

const LARGEST_MISFIT = 9.99; // the digits of a larger misfit do not fit into the column

export class Estimates {
  // `explain` explains an element with a text. `emphasis` states which estimators are highlighted or hidden.
  constructor(body, store, explain, emphasis) {
    this.body = body;
    this.store = store;
    this.explain = explain;
    this.emphasis = emphasis;
    this.rows = [];
    this.supported = [];
  }

  // Store which estimates can be used, from the message `state`. The others are grey.
  support(trust) {
    this.supported = (trust && trust.supported) || [];
  }

  build(welcome, trial) {
    const texts = (trial && trial.explanations) || {};
    const name = (index) => (index === null || index === undefined ? "" : welcome.columns[index].name);
    this.rows = welcome.estimators.map((estimator, index) => {
      const row = document.createElement("tr");
      const head = document.createElement("th");
      head.scope = "row";
      const swatch = document.createElement("button");
      swatch.type = "button";
      swatch.className = "line-style";
      swatch.append(document.createElement("i"));
      swatch.firstChild.className = `swatch swatch-${index % 5}`;
      this.emphasis.attach(swatch, estimator.name);
      const [first, ...others] = estimator.name.split(/(?<=_)/);
      const term = document.createElement(estimator.name in texts ? "button" : "span");
      term.className = estimator.name in texts ? "term" : "";
      if (term.type) term.type = "button";
      // A long name breaks after an underscore.
      term.append(first, ...others.flatMap((part) => [document.createElement("wbr"), part]));
      this.explain(term, texts[estimator.name]);
      head.append(swatch, term);
      const cells = {};
      for (const key of ["k", "b", "held", "misfit"]) {
        const cell = document.createElement("td");
        cell.className = `cell-${key}`;
        row.append(cell);
        cells[key] = cell;
      }
      // The interval is below the value, so that the height of a row does not depend on the width of the numbers.
      for (const key of ["k", "b"]) cells[key].append(document.createElement("b"), " ", document.createElement("span"));
      row.prepend(head);
      const columns = {};
      for (const key of ["k", "b", "k_std", "b_std", "held", "misfit"]) columns[key] = name(estimator[key]);
      return { estimator: estimator.name, row, cells, columns };
    });
    this.quantities = welcome.quantities;
    this.largestMisfit = welcome.thresholds.misfit; // a larger misfit has a mark
    this.body.replaceChildren(...this.rows.map((one) => one.row));
  }

  update() {
    const { store } = this;
    this.rows.forEach(({ row, cells, columns }, index) => {
      const newest = store.newest(columns.k);
      const last = (key) => (newest >= 0 && columns[key] ? store.column(columns[key]).at(newest) : NaN);
      for (const key of ["k", "b"]) {
        const [value, half] = withInterval(last(key), 1.96 * last(`${key}_std`), this.quantities[key]);
        cells[key].firstChild.textContent = value;
        cells[key].lastChild.textContent = half;
        cells[key].classList.toggle("unsupported", !(this.supported[index] || {})[key]);
      }
      const held = last("held") === 1;
      cells.held.textContent = held ? "held" : "–";
      row.classList.toggle("held", held || newest < store.count - 1);
      const misfit = last("misfit");
      const share = misfit > LARGEST_MISFIT ? `>${percent(LARGEST_MISFIT)}` : percent(misfit);
      cells.misfit.textContent = misfit > this.largestMisfit ? `▲ ${share}` : share;
    });
  }

  // Return the estimate of k of the first estimator as a sentence.
  sentence() {
    if (!this.rows.length) return "";
    const { estimator, columns } = this.rows[0];
    const { k } = this.quantities;
    const [value, half] = withInterval(this.store.last(columns.k), 1.96 * this.store.last(columns.k_std), k);
    return value === "–" ? "" : `${estimator}: k ${value} ${half.replace("±", "plus or minus")} ${k.unit}`;
  }
}
