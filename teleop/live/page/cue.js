// Show the tracking error, its root mean square (rms) over the last 5 s, and the seconds until the target begins
// to move (count-in).

import { fixed } from "./format.js";

const WINDOW = 5; // time over which the rms value is computed [s]

// Return the present difference between tool and target [m], and its root mean square over the last 5 s [m].
export function tracking(store) {
  const target = store.column("target");
  const own = store.column("slave_position");
  const error = store.last("slave_position") - store.last("target");
  let sum = 0;
  let n = 0;
  const start = store.rowAt(store.last("time") - WINDOW);
  for (let row = start; row < store.count; row++) {
    const difference = own.at(row) - target.at(row);
    if (Number.isNaN(difference)) continue;
    sum += difference * difference;
    n += 1;
  }
  return { error, rms: n ? Math.sqrt(sum / n) : NaN };
}

// Return the whole seconds until the target begins to move; 0 afterwards.
export function secondsLeft(preview, time) {
  return preview ? Math.max(0, Math.ceil(preview.countIn - Math.max(time, 0))) : 0;
}

export class CueText {
  constructor(error, rms, count) {
    Object.assign(this, { error, rms, count });
  }

  update(store, preview) {
    if (!store.count) return;
    const found = tracking(store);
    const signed = (found.error > 0 ? "+" : "") + fixed(1e3 * found.error, 1);
    this.error.textContent = Number.isFinite(found.error) ? `${signed} mm` : "–";
    this.rms.textContent = Number.isFinite(found.rms) ? `${fixed(1e3 * found.rms, 1)} mm` : "–";
    const time = store.trialTime(store.last("time"));
    const left = Number.isFinite(time) ? secondsLeft(preview, time) : 0;
    const text = left ? `starts in ${left} s` : "";
    if (this.count.textContent !== text) this.count.textContent = text;
  }
}
