// List of the trials of the session, with k and b of the evaluation after each trial.

import { withInterval } from "./format.js";

export class Trials {
  // `area` is the element that opens the list, and `table` the list.
  constructor(area, table, connection) {
    Object.assign(this, { area, table });
    connection.on("welcome", (message) => (this.quantities = message.quantities));
    connection.on("trials", (message) => this.#show(message.trials));
  }

  #show(trials) {
    this.area.querySelector("summary").textContent = `Trials (${trials.length})`;
    const units = ["k", "b"].map((symbol) => `${symbol} [${this.quantities[symbol].unit}]`);
    const rows = trials.map((trial) => line("td", [trial.number, describe(trial), this.#text(trial, "k"), this.#text(trial, "b")]));
    this.table.replaceChildren(line("th", ["", "trial", ...units]), ...rows.reverse());
  }

  // Return k or b with the half width of its interval as text.
  #text(trial, symbol) {
    const [value, low, high] = ["", "_low", "_high"].map((end) => trial[`${symbol}${end}`] ?? NaN);
    return withInterval(value, (high - low) / 2, this.quantities[symbol]).join(" ");
  }
}

function describe({ condition, specimen, feedback, stopped }) {
  const law = feedback === "none" ? "" : feedback;
  return [condition, specimen, law, stopped ? "stopped" : ""].filter(Boolean).join(", ");
}

function line(tag, texts) {
  const row = document.createElement("tr");
  row.append(...texts.map((text, i) => Object.assign(document.createElement(i ? tag : "th"), { textContent: text })));
  return row;
}
