// Vertical range of a plot: it covers the data, has round ends, and seldom changes.

const PATIENCE = 4000; // ms for which a range stays larger than needed
const SHRINK = 0.6; // share of the range that is needed, below which it becomes smaller

export class Scale {
  constructor(smallest) {
    this.smallest = smallest; // smallest difference of the ends
    this.low = 0;
    this.high = smallest;
    this.ticks = [];
    this.step = 1;
    this.since = -Infinity; // time at which the range was last needed in full
    this.empty = true;
  }

  reset() {
    this.empty = true;
  }

  // Cover [low, high]; returns whether the range changed.
  cover(low, high, rows, now) {
    if (!(low <= high)) return false;
    const middle = (low + high) / 2;
    const half = Math.max(high - low, this.smallest) / 2;
    const inside = low >= this.low && high <= this.high;
    const needed = (2 * half) / (this.high - this.low);
    if (inside && needed > SHRINK) this.since = now;
    if (!this.empty && inside && now - this.since < PATIENCE) return false;
    this.empty = false;
    this.since = now;
    const margin = 0.16 * half;
    this.step = niceStep((2 * half + 2 * margin) / rows);
    const fine = this.step / 5;
    const before = [this.low, this.high];
    this.low = Math.floor((middle - half - margin) / fine) * fine;
    this.high = Math.ceil((middle + half + margin) / fine) * fine;
    this.ticks = ticksBetween(this.low, this.high, this.step);
    if (this.ticks.length < 2) {
      this.step = niceStep((this.high - this.low) / 4);
      this.ticks = ticksBetween(this.low, this.high, this.step);
    }
    return before[0] !== this.low || before[1] !== this.high;
  }

  digits() {
    return Math.max(0, -Math.floor(Math.log10(this.step) + 1e-9));
  }
}

export function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  const factor = [1, 2, 5, 10].find((f) => f * power >= least * 0.999);
  return factor * power;
}

export function ticksBetween(low, high, step) {
  const ticks = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) ticks.push(i * step);
  return ticks;
}

// Percentiles of finite values; `values` is sorted in place.
export function percentiles(values, n, shares) {
  const part = values.subarray(0, n).sort();
  return shares.map((share) => (n ? part[Math.round(share * (n - 1))] : NaN));
}
