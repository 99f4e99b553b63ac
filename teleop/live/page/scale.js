// Range of an axis of a plot. The range contains the data, has round limits, and seldom changes.

const PATIENCE = 4000; // time after which a range that is too large becomes smaller [ms]
const SHRINK = 0.6; // a range is too large if the data need at most this fraction of the range
const LARGEST = 1e100; // larger values are not shown, so that sums and products of the ends of a range are finite
const FINEST = 1e-9; // smallest length of a range, relative to its values, so that the ticks are different numbers
const FURTHEST = 100; // largest distance of a place from the start of its axis, relative to the length of the axis
const SHORTEST = 1e-3; // smallest length of a range that a person chooses, relative to the usual smallest one
const LONGEST = 1e4; // its largest length
const MOST_STEPS = 1000; // largest number of values of `evenly`

export class Scale {
  constructor(smallest) {
    this.smallest = smallest; // smallest length of the range
    this.low = 0;
    this.high = smallest;
    this.ticks = [];
    this.step = 1;
    this.since = -Infinity; // last time at which the range was not too large [ms]
    this.empty = true;
    this.kept = null; // range that a person has chosen; null if the range follows the data
  }

  reset() {
    this.empty = true;
  }

  // Keep a range, whatever the data are, until `release`.
  keep(low, high) {
    const length = within(high - low, SHORTEST * this.smallest, LONGEST * this.smallest);
    this.kept = [(low + high - length) / 2, (low + high + length) / 2];
  }

  release() {
    this.kept = null;
    this.reset();
  }

  // Change the range if necessary, so that it contains [low, high]. `rows` is the largest number of intervals between
  // ticks, and `now` the present time [ms]. Return whether the range changed.
  cover(low, high, rows, now) {
    const before = [this.low, this.high];
    const hasChanged = () => before[0] !== this.low || before[1] !== this.high;
    if (this.kept) {
      [this.low, this.high] = this.kept;
      this.#divide((this.high - this.low) / rows);
      return hasChanged();
    }
    if (!(low <= high)) return false;
    low = within(low, -LARGEST, LARGEST);
    high = within(high, -LARGEST, LARGEST);
    const middle = (low + high) / 2;
    const half = Math.max(high - low, this.smallest, FINEST * Math.abs(middle)) / 2;
    const inside = low >= this.low && high <= this.high;
    const needed = (2 * half) / (this.high - this.low);
    if (inside && needed > SHRINK) this.since = now;
    if (!this.empty && inside && now - this.since < PATIENCE) return false;
    this.empty = false;
    this.since = now;
    const margin = 0.16 * half;
    const least = (2 * half + 2 * margin) / rows;
    const fine = niceStep(least) / 5;
    this.low = Math.floor((middle - half - margin) / fine) * fine;
    this.high = Math.ceil((middle + half + margin) / fine) * fine;
    this.#divide(least);
    return hasChanged();
  }

  // Divide the range by ticks at a distance of at least `least`, if these are two or more.
  #divide(least) {
    this.step = niceStep(least);
    this.ticks = ticksBetween(this.low, this.high, this.step);
    if (this.ticks.length >= 2) return;
    this.step = niceStep((this.high - this.low) / 4);
    this.ticks = ticksBetween(this.low, this.high, this.step);
  }

  // Return the place of a value on an axis that is drawn between the pixels `from` and `to`. The place of a value far
  // outside the range is limited, because a canvas does not draw very long lines correctly.
  place(value, from, to) {
    const share = (value - this.low) / (this.high - this.low);
    return from + within(share, -FURTHEST, FURTHEST) * (to - from);
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

// Return the multiples of a step in a range.
export function ticksBetween(low, high, step) {
  const first = Math.ceil(low / step - 1e-9);
  return evenly(0, Math.floor(high / step + 1e-9) - first, 1).map((i) => (first + i) * step);
}

// Return the values low, low + step, ... up to and including `high`. If there are more than `MOST_STEPS` values, or if
// a number is not finite, the result is empty. The values are computed from their number, because adding a step to a
// very large number does not change the number, and a loop would not end.
export function evenly(low, high, step) {
  const count = Math.floor((high - low) / step) + 1;
  return count >= 1 && count <= MOST_STEPS ? Array.from({ length: count }, (_, i) => low + i * step) : [];
}

function within(value, low, high) {
  return Math.min(Math.max(value, low), high);
}

// Return percentiles of the first n values, which must be finite. `values` is sorted in place.
export function percentiles(values, n, shares) {
  const part = values.subarray(0, n).sort();
  return shares.map((share) => (n ? part[Math.round(share * (n - 1))] : NaN));
}
