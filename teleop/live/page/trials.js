// List of the trials of the session, with k and b of the evaluation after each trial.

export class Trials {
  // `area` is the element that opens the list, and `table` the list.
  constructor(area, table, connection) {
    Object.assign(this, { area, table });
    connection.on("trials", (message) => this.#show(message.trials));
  }

  #show(trials) {
    this.area.querySelector("summary").textContent = `Trials (${trials.length})`;
    const rows = trials.map(({ number, values, ...trial }) => line("td", [number, describe(trial), text(values, "k"), text(values, "b")]));
    this.table.replaceChildren(line("th", ["", "trial", "k", "b"]), ...rows.reverse());
  }
}

// Return k or b with its interval, with the digits of the result; a dash if it cannot be given.
function text(values, symbol) {
  const { value, unit, low, high } = values.find((one) => one.symbol === symbol) || {};
  return value ? `${value} ${unit} (${low} to ${high})` : "–";
}

function describe({ condition, specimen, feedback, stopped }) {
  const law = feedback === "none" ? "" : feedback;
  return [condition, specimen, law, stopped ? "stopped" : ""].filter(Boolean).join(", ");
}

function line(tag, texts) {
  const row = document.createElement("tr");
  row.append(...texts.map((one, i) => Object.assign(document.createElement(i ? tag : "th"), { textContent: one })));
  return row;
}
