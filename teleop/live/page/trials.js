// List of the trials of the session, with k and b of the evaluation after each trial.

export class Trials {
  // `area` is the element that opens the list, and `table` the list.
  constructor(area, table, connection) {
    Object.assign(this, { area, table });
    connection.on("trials", (message) => this.#show(message.trials));
  }

  #show(trials) {
    this.area.querySelector("summary").textContent = `Trials (${trials.length})`;
    const rows = trials.map(({ number, values, ...trial }) => line("td", [[number], [describe(trial)], texts(values, "k"), texts(values, "b")]));
    this.table.replaceChildren(line("th", [[""], ["trial"], ["k"], ["b"]]), ...rows.reverse());
  }
}

// Return k or b, and its interval, with the digits of the result; a dash if it cannot be given.
function texts(values, symbol) {
  const { value, unit, low, high } = values.find((one) => one.symbol === symbol) || {};
  return value ? [`${value} ${unit}`, `${low} to ${high}`] : ["–"];
}

function describe({ condition, specimen, feedback, stopped }) {
  const law = feedback === "none" ? "" : feedback;
  return [condition, specimen, law, stopped].filter(Boolean).join(", ");
}

// Return a row of cells. Each cell has one or two lines.
function line(tag, cells) {
  const row = document.createElement("tr");
  for (const [i, [first, ...second]] of cells.entries()) {
    const cell = document.createElement(i ? tag : "th");
    cell.append(first, ...second.map((text) => Object.assign(document.createElement("small"), { textContent: text })));
    row.append(cell);
  }
  return row;
}
