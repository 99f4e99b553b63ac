// Controls for the replay of a recording: overview of the whole recording, time slider, play, pause, speed, steps from
// sample to sample, and the events.

import { fixed } from "./format.js";
import { Overview } from "./overview.js";
import { isSpace } from "./stop.js";

const END = 0.02; // if less time is left [s], "Play" starts from the beginning of the recording
const STEPS = { ",": -1, ".": 1 }; // keys that show the sample before and the next one

export class Replay {
  constructor(byId, connection, clock, view) {
    Object.assign(this, { byId, clock, view });
    this.store = clock.store;
    this.events = [];
    this.labelled = NaN; // origin of the times of the events in the list
    this.overview = new Overview(byId("overview"), clock);
    byId("play").addEventListener("click", () => this.toggle());
    byId("rate").addEventListener("change", () => clock.rate && clock.play(this.speed));
    byId("back").addEventListener("click", () => this.step(-1));
    byId("forward").addEventListener("click", () => this.step(1));
    byId("event").addEventListener("change", (event) => this.#choose(event.target));
    byId("seek").addEventListener("input", (event) => clock.seek(event.target.valueAsNumber));
    for (const type of ["keydown", "keyup"]) addEventListener(type, (event) => this.#key(event), { capture: true });
    connection.on("events", (message) => {
      this.events = message.events;
      this.labelled = NaN;
    });
    connection.on("welcome", (message) => {
      const isReplay = message.kind === "replay";
      byId("replay").hidden = !isReplay;
      view.seek = isReplay ? (t) => clock.seek(t) : null;
    });
  }

  get speed() {
    return Number(this.byId("rate").value);
  }

  toggle() {
    const { clock } = this;
    if (!clock.rate && clock.t > clock.end - END) clock.seek(clock.start);
    clock.play(clock.rate ? 0 : this.speed);
  }

  // Pause, and show the next sample (1) or the sample before (-1).
  step(samples) {
    const { clock, store } = this;
    if (clock.rate) clock.play(0);
    const row = Math.min(Math.max(store.count - 1 + samples, store.first), store.received - 1);
    clock.seek(store.value("time", row));
  }

  #key(event) {
    if (this.byId("replay").hidden || !(isSpace(event) || event.key in STEPS)) return;
    event.preventDefault();
    event.stopPropagation();
    if (event.type !== "keydown") return;
    if (event.key in STEPS) this.step(STEPS[event.key]);
    else if (!event.repeat) this.toggle();
  }

  #choose(select) {
    this.clock.seek(Number(select.value));
    select.value = "";
  }

  // Show the present time. This method is called in every frame.
  draw() {
    const { byId, clock, store } = this;
    if (byId("replay").hidden) return;
    this.overview.draw(this.view, this.events);
    if (store.origin !== this.labelled) this.#list();
    const text = `${fixed(store.trialTime(clock.t), 2)} of ${fixed(store.trialTime(clock.end), 1)} s`;
    const action = clock.rate ? "Pause" : "Play";
    if (byId("play").textContent !== action) byId("play").textContent = action;
    if (byId("replay-time").textContent === text) return;
    byId("replay-time").textContent = text;
    Object.assign(byId("seek"), { min: clock.start, max: clock.end, value: clock.t });
    byId("seek").setAttribute("aria-valuetext", `${fixed(store.trialTime(clock.t), 1)} seconds`);
  }

  // List the events with their times since the drives were armed.
  #list() {
    const { byId, events, store } = this;
    this.labelled = store.origin;
    const options = events.map(({ time, text }) => new Option(`${fixed(store.trialTime(time), 1)} s: ${text}`, time));
    byId("event").replaceChildren(new Option("Events", ""), ...options);
    byId("event").hidden = !events.length;
  }
}
