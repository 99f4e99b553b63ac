// Time of a replay. The server states it ten times per second, and the page computes the time of each frame from it.

const TOLERANCE = 0.1; // largest difference from the time of the server that is not corrected while playing [s]
const SETTLING = 300; // time after a change by this page in which the server may state an earlier time [ms]

export class ReplayClock {
  constructor(connection, store) {
    Object.assign(this, { connection, store });
    this.t = NaN; // time that the page shows [s]
    this.start = this.end = 0; // times of the first and the last sample [s]
    this.rate = 0; // present speed, as a multiple of real time; 0 while paused
    this.soughtAt = -Infinity; // time at which this page last changed the time [ms]
    this.shownAt = NaN; // time of the latest frame [ms]
    connection.on("replay", (message) => this.#receive(message));
  }

  // Show a time [s], limited to the recording. All other pages then show it, too.
  seek(t) {
    this.soughtAt = performance.now();
    this.#show(Math.min(Math.max(t, this.start), this.end));
    this.connection.send({ type: "seek", t: this.t });
  }

  // Play with a speed, or pause if it is 0.
  play(rate) {
    this.rate = rate;
    this.connection.send({ type: "play", rate });
  }

  // Advance the time while the replay plays. This method is called in every frame.
  frame(now) {
    if (this.rate) this.#show(Math.min(this.t + (this.rate * (now - this.shownAt)) / 1000, this.end));
    this.shownAt = now;
  }

  #receive({ t, start, end, playing, rate }) {
    Object.assign(this, { start, end, rate: playing ? rate : 0 });
    const isNear = playing && Math.abs(t - this.t) < TOLERANCE;
    if (!isNear && performance.now() - this.soughtAt > SETTLING) this.#show(t);
  }

  #show(t) {
    this.t = t;
    this.store.showUntil(t);
  }
}
