// Store the samples of the last minutes, with a ring buffer of doubles for each column.

const CAPACITY = 32768; // number of stored rows, a power of two; 131 s at 250 rows per second
const MASK = CAPACITY - 1;

export class Store {
  constructor() {
    this.names = [];
    this.data = [];
    this.index = new Map();
    this.received = 0; // number of rows received since the last `clear`
    this.count = 0; // number of rows that the page shows; less than `received` in a replay
    this.until = Infinity; // time of the last row that the page shows [s]; finite in a replay
    this.generation = 0; // increases when earlier drawings become invalid
    this.version = 0; // increases with each change of the shown rows
    this.isInformed = () => true; // returns whether the motion until a row of values determines k
    this.informed = false; // whether there has been such a row since the last `clear`
    this.estimated = []; // indices of the columns with estimates, which are NaN before
    this.origin = 0; // value of the column "time" at which the drives were armed [s]; null before
  }

  setColumns(names) {
    this.names = names;
    this.data = names.map(() => new Float64Array(CAPACITY));
    this.index = new Map(names.map((name, i) => [name, i]));
    this.clear();
  }

  // Until the expected half width of k is at most `largest`, the columns with the indices `estimated` contain only start
  // values of the estimators. Store NaN instead of them.
  awaitInformation(estimated, largest) {
    const expected = this.index.get("k_bound");
    this.estimated = expected === undefined ? [] : estimated;
    this.isInformed = (values, start) => values[start + expected] <= largest;
  }

  clear() {
    this.received = this.count = 0;
    this.informed = false;
    this.generation += 1;
    this.version += 1;
  }

  // Append rows, given as one array in row order. If the time decreases, remove all earlier rows.
  append(values, rows, columns) {
    if (columns !== this.data.length) throw new Error(`${columns} columns, expected ${this.data.length}`);
    const time = this.index.get("time");
    for (let r = 0; r < rows; r++) {
      const start = r * columns;
      if (this.received && values[start + time] < this.data[time][(this.received - 1) & MASK]) this.clear();
      const slot = this.received & MASK;
      for (let c = 0; c < columns; c++) this.data[c][slot] = values[start + c];
      this.informed ||= this.isInformed(values, start);
      if (!this.informed) for (const c of this.estimated) this.data[c][slot] = NaN;
      this.received += 1;
    }
    this.#show(this.until === Infinity ? this.received : this.rowAfter(this.until));
  }

  // Show the rows up to a time [s] of a recording.
  showUntil(t) {
    this.until = t;
    this.#show(this.rowAfter(t));
  }

  #show(count) {
    if (count === this.count) return;
    if (count < this.count) this.generation += 1;
    this.count = count;
    this.version += 1;
  }

  setOrigin(origin) {
    if (origin === this.origin) return;
    this.origin = origin;
    this.generation += 1;
  }

  // Return the time [s] since the drives were armed, from a value of the column "time".
  trialTime(t) {
    return this.origin === null ? -Infinity : t - this.origin;
  }

  // Index of the oldest row that is still stored.
  get first() {
    return Math.max(0, this.received - CAPACITY);
  }

  // Return a column as an object with the method `at(row)`; null if there is no such column.
  column(name) {
    const i = this.index.get(name);
    return i === undefined ? null : new Column(this.data[i]);
  }

  last(name) {
    return this.count ? this.value(name, this.count - 1) : NaN;
  }

  // Return the value of a column in a row; NaN if there is no such column.
  value(name, row) {
    const i = this.index.get(name);
    return i === undefined ? NaN : this.data[i][row & MASK];
  }

  // Return the index of the newest row in which a column is not NaN; -1 if there is no such row.
  newest(name) {
    const i = this.index.get(name);
    if (i === undefined) return -1;
    for (let row = this.count - 1; row >= this.first; row--) if (!Number.isNaN(this.data[i][row & MASK])) return row;
    return -1;
  }

  // Return the index of the newest row in which a column has a value; -1 if there is no such row.
  newestWith(name, value) {
    const column = this.column(name);
    let row = this.count - 1;
    while (column && row >= this.first && column.at(row) !== value) row -= 1;
    return column && row >= this.first ? row : -1;
  }

  // Return the index of the first shown row whose time is at least t.
  rowAt(t) {
    return this.#search(this.count, (time) => time < t);
  }

  // Return the index of the first received row whose time is greater than t.
  rowAfter(t) {
    return this.#search(this.received, (time) => time <= t);
  }

  #search(end, isBefore) {
    const time = this.data[this.index.get("time")];
    let low = this.first;
    let high = end;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (isBefore(time[middle & MASK])) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

class Column {
  constructor(array) {
    this.array = array;
  }

  at(row) {
    return this.array[row & MASK];
  }
}
