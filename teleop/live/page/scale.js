// Range of an axis of a plot. The range contains the data, has round limits, and seldom changes.

const PATIENCE = 4000; // time after which a range that is too large becomes smaller [ms]
const SHRINK = 0.6; // a range is too large if the data need at most this fraction of the range

export class Scale {
  constructor(smallest) {
    this.smallest = smallest; // smallest length of the range
    this.low = 0;
    this.high = smallest;
    this.ticks = [];
    this.step = 1;
    this.since = -Infinity; // last time at which the range was not too large [ms]
    this.empty = true;
  }

  reset() {
    this.empty = true;
  }

  // Change the range if necessary, so that it contains [low, high]. `rows` is the largest number of intervals between
  // ticks, and `now` the present time [ms]. Return whether the range changed.
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

// Return percentiles of the first n values, which must be finite. `values` is sorted in place.
export function percentiles(values, n, shares) {
  const part = values.subarray(0, n).sort();
  return shares.map((share) => (n ? part[Math.round(share * (n - 1))] : NaN));
}
