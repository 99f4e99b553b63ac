// Part of the time that the strips show. It changes only the strips, and never the picture of the tool, in which the
// pointer moves the hand.

export const WINDOWS = [1, 2, 5, 10, 20, 30, 60]; // lengths of the past time that can be shown [s]
const USUAL = 10; // length at the start [s]
const PREVIEW = 1.2; // longest future time for which the strips show the target [s]
const PREVIEW_SHARE = 0.12; // its largest length, relative to the past time

export class View {
  constructor(store) {
    this.store = store;
    this.span = USUAL; // length of the past time [s]
    this.end = null; // time at the end of the past time [s]; null for that of the newest row
    this.hasTarget = false; // whether the strips show a target
    this.seek = null; // function that changes the time of a replay
    this.moves = () => false; // returns whether new rows arrive at present
    this.listeners = [];
  }

  onChange(listener) {
    this.listeners.push(listener);
  }

  // Time at the end of the past time [s]. It is never before the oldest stored window.
  get time() {
    const { store } = this;
    const newest = store.last("time");
    if (this.end === null) return newest;
    return Math.min(Math.max(this.end, this.#earliest), newest);
  }

  get follows() {
    return this.end === null;
  }

  // Length of the future time for which the strips show the target [s].
  get preview() {
    return this.hasTarget ? Math.min(PREVIEW, PREVIEW_SHARE * this.span) : 0;
  }

  // Place of the end of the past time, as a fraction of the width of a strip.
  get share() {
    return this.span / (this.span + this.preview);
  }

  // Return the time at a place, given as a fraction of the width of a strip.
  timeAt(share) {
    return this.time + (share - 1) * (this.span + this.preview) + this.preview;
  }

  shareOf(t) {
    return 1 + (t - this.preview - this.time) / (this.span + this.preview);
  }

  get #earliest() {
    const { store } = this;
    return Math.min(store.value("time", store.first) + this.span, store.last("time"));
  }

  // Show a longer (steps > 0) or shorter window. The time `at` keeps its place, if the strips are at rest.
  zoom(steps, at = this.time) {
    const place = Math.max(WINDOWS.indexOf(this.span) + steps, 0);
    const span = WINDOWS[Math.min(place, WINDOWS.length - 1)];
    const end = at + ((this.time - at) * span) / this.span;
    const isAtRest = !this.seek && !(this.follows && this.moves());
    this.span = span;
    if (isAtRest) this.end = end < this.store.last("time") ? end : null;
    this.#changed();
  }

  setSpan(span) {
    this.span = span;
    this.#changed();
  }

  // Show the time that is later by `seconds`. In a replay, the whole page shows it.
  pan(seconds) {
    if (this.seek) return this.seek(this.store.until + seconds);
    const newest = this.store.last("time");
    const end = Math.max(this.time + seconds, this.#earliest);
    this.end = end < newest ? end : null;
    this.#changed();
  }

  follow() {
    if (this.follows) return;
    this.end = null;
    this.#changed();
  }

  #changed() {
    for (const listener of this.listeners) listener();
  }
}
