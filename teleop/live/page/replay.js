// Controls for the replay of a recording: time slider, play, pause and speed.

import { fixed } from "./format.js";
import { isSpace } from "./stop.js";

const END = 0.02; // if less time is left [s], "Play" starts from the beginning of the recording

export class Replay {
  constructor(byId, connection, status) {
    this.byId = byId;
    this.connection = connection;
    this.status = status;
    this.playing = false;
    this.dragging = false;
    const slider = byId("seek");
    byId("play").addEventListener("click", () => this.toggle());
    byId("rate").addEventListener("change", () => this.playing && this.#play(this.speed));
    slider.addEventListener("input", () => connection.send({ type: "seek", t: slider.valueAsNumber }));
    slider.addEventListener("pointerdown", () => (this.dragging = true));
    slider.addEventListener("pointerup", () => (this.dragging = false));
    for (const type of ["keydown", "keyup"]) addEventListener(type, (event) => this.#key(event), { capture: true });
    connection.on("replay", (message) => this.#show(message));
    connection.on("welcome", (message) => {
      byId("replay").hidden = message.kind !== "replay";
    });
  }

  get speed() {
    return Number(this.byId("rate").value);
  }

  toggle() {
    const slider = this.byId("seek");
    const atEnd = slider.valueAsNumber > Number(slider.max) - END;
    if (!this.playing && atEnd) this.connection.send({ type: "seek", t: Number(slider.min) });
    this.#play(this.playing ? 0 : this.speed);
  }

  // The key Space starts and pauses the replay.
  #key(event) {
    if (this.status.kind !== "replay" || !isSpace(event)) return;
    event.preventDefault();
    event.stopPropagation();
    if (event.type === "keydown" && !event.repeat) this.toggle();
  }

  #play(rate) {
    this.connection.send({ type: "play", rate });
  }

  #show({ t, start, end, playing }) {
    this.playing = this.status.playing = playing;
    const slider = this.byId("seek");
    slider.min = start;
    slider.max = end;
    if (!this.dragging) slider.value = t;
    slider.setAttribute("aria-valuetext", `${fixed(t, 1)} seconds`);
    this.byId("play").textContent = playing ? "Pause" : "Play";
    this.byId("replay-time").textContent = `${fixed(t, 1)} of ${fixed(end, 1)} s`;
  }
}
