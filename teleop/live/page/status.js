// Show mode, time of the trial, health of the loop and state of the connection as text.

import { fixed } from "./format.js";

const RUNNING = ["ready", "active", "stopping"]; // modes in which ticks arrive
// Names of the values of the column "mode".
const MODES = ["disconnected", "idle", "ready", "active", "stopping", "fault"];
const ACTIVE = MODES.indexOf("active");
const EVALUATING = "Please wait: k and b are computed from all samples of the trial.";

export class Status {
  constructor(byId, store, connection) {
    this.byId = byId;
    this.store = store;
    this.connection = connection;
    this.state = null;
    this.trial = null;
    this.notice = "";
    this.isEvaluating = false; // whether the result of the trial is computed at present
    connection.on("welcome", (message) => {
      this.kind = message.kind;
      document.body.classList.toggle("is-replay", message.kind === "replay");
    });
    connection.on("trial", (message) => this.#trial(message));
    for (const type of ["evaluating", "summary", "trial"]) {
      connection.on(type, () => {
        this.isEvaluating = type === "evaluating";
        if (this.state) this.#state(this.state);
      });
    }
    connection.on("state", (message) => this.#state(message));
    connection.on("error", (message) => {
      const isLate = message.text.startsWith("pointer"); // a request sent before the page knew that the trial had ended
      if (!isLate) this.tell(message.text, 6000);
    });
    connection.on("words", () => this.#connection());
    connection.on("fresh", () => this.#fresh());
    connection.on("closed", () => this.#fresh());
  }

  // Return whether the page expects ticks at present.
  expecting() {
    if (this.kind === "replay") return true;
    return Boolean(this.state) && RUNNING.includes(this.state.mode);
  }

  stopped() {
    return !this.state || !["active", "stopping"].includes(this.state.mode) || this.kind === "replay";
  }

  // Return what STOP does while no trial runs; empty while it stops a trial.
  withoutTrial() {
    if (!this.state || !["idle", "ended"].includes(this.state.mode)) return "";
    const next = this.state.armed_by === "terminal" ? "STOP stops the next trial." : "There is nothing to stop.";
    return `No trial is running. ${next}`;
  }

  // Show a notice instead of other messages for `duration` ms.
  tell(text, duration = 15000) {
    this.notice = text;
    this.byId("alert").textContent = text;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      this.notice = "";
      this.#fresh();
    }, duration);
    this.#fresh();
  }

  #trial(message) {
    this.trial = message;
    const subject = this.byId("subject");
    if (!subject) return;
    const parts = [message.condition, message.specimen, message.simulated ? "simulated rig" : message.rig];
    if (message.operator) parts.push(message.operator);
    subject.textContent = parts.filter(Boolean).join(" · ");
  }

  #state(message) {
    this.state = message;
    if (message.armed_at !== undefined) this.store.setOrigin(message.armed_at);
    const mode = this.byId("mode");
    const [label, kind] = shownMode(message);
    if (this.kind !== "replay") {
      mode.textContent = label;
      mode.dataset.mode = document.body.dataset.mode = kind;
    }
    const evaluating = this.isEvaluating ? EVALUATING : "";
    const text = [sentence(message.text), evaluating, this.#advice(message)].filter(Boolean).join(" ");
    if (this.byId("text").textContent !== text) this.byId("text").textContent = text;
    document.title = `${mode.textContent} · teleop`;
    this.#connection();
    this.#fresh();
  }

  // Return what the person at this page can do next. Only a page that can press the buttons names them.
  #advice({ advice, mode, control }) {
    if (!advice) return "";
    if (this.connection.view === "main" && control !== "other") return sentence(advice);
    if (mode === "active") return "";
    return this.connection.view === "main" ? "Another page has control." : "Continue in the main view.";
  }

  #connection() {
    const { connection, state } = this;
    const parts = [connection.words];
    if (connection.isOpen) {
      if (Number.isFinite(connection.roundTrip)) parts.push(`round trip ${fixed(connection.roundTrip)} ms`);
      if (state && state.clients > 1) parts.push(`${state.clients} pages`);
      if (state && state.armed_by) parts.push(`armed from the ${state.armed_by}`);
    }
    this.byId("connection").textContent = parts.join(" · ");
    document.body.classList.toggle("is-connected", connection.isOpen);
  }

  #fresh() {
    const { connection } = this;
    const connected = connection.isOpen;
    const over = Boolean(this.state && this.state.mode === "ended" && this.state.loop === "gone");
    if (over && !connected) this.byId("text").textContent = "The session has ended. Run the command again for another trial.";
    const stale = !over && !connection.fresh && (connected || this.state !== null || connection.words !== "connecting");
    let text = this.notice;
    if (!text && stale) {
      const age = `${fixed(connection.age / 1000, 1)} s`;
      if (!connected) text = `${sentence(connection.words)} The values are old.`;
      else if (connection.arrives) text = `The connection is slow. The data are up to ${age} old.`;
      else text = `No new data from the control loop for ${fixed(connection.silence / 1000, 1)} s. The values are old.`;
    }
    const box = this.byId("stale");
    box.hidden = !text;
    if (box.textContent !== text) box.textContent = text;
    document.body.classList.toggle("is-stale", stale);
  }

  update() {
    const { store, trial, byId } = this;
    const time = store.trialTime(this.kind === "replay" ? store.last("time") : this.#end());
    const duration = trial ? trial.duration : NaN;
    if (this.kind === "replay") {
      const shown = MODES[store.last("mode")];
      byId("mode").textContent = shown ? `replay: ${shown}` : "replay";
      byId("mode").dataset.mode = shown === "fault" ? "fault" : "replay";
    }
    const ended = Number.isFinite(duration) ? ` of ${fixed(duration)}` : "";
    byId("clock").textContent = Number.isFinite(time) ? `${fixed(Math.max(time, 0), 1)}${ended} s` : "";
    if (byId("progress")) byId("progress").value = Number.isFinite(duration) ? Math.min(Math.max(time, 0) / duration, 1) || 0 : 0;
    if (byId("health")) byId("health").textContent = this.#health();
    if (byId("station")) this.#station();
    this.#connection();
    this.#fresh();
  }

  // Return the time of the newest row, or the time at which the drives were no longer active. After a stop, rows
  // arrive for a second more.
  #end() {
    const { store, state } = this;
    if (!state || !["fault", "ended"].includes(state.mode)) return store.last("time");
    const row = store.newestWith("mode", ACTIVE);
    return row < 0 ? store.last("time") : store.column("time").at(row);
  }

  // Show what the other of two stations does; hidden in a trial on one computer.
  #station() {
    const { store, byId } = this;
    const mode = MODES[store.last("other_mode")];
    byId("station").hidden = mode === undefined;
    if (mode === undefined) return;
    const half = 0.5 * (store.last("offset_high") - store.last("offset_low"));
    const clock = Number.isFinite(half) ? `, clock ± ${fixed(1e3 * half, 2)} ms` : "";
    byId("station").textContent =
      `other station: ${mode}, round trip ${fixed(1e3 * store.last("round_trip"), 1)} ms${clock}, datagrams: ` +
      ["lost", "overtaken", "rejected"].map((name) => `${fixed(store.last(`${name}_datagrams`))} ${name}`).join(", ");
  }

  #health() {
    const health = this.state && this.state.health;
    if (!health) return "";
    const count = (value, scale = 1) => (Number.isFinite(value) ? fixed(scale * value) : "–"); // null is no number
    return (
      `loop: largest lateness ${count(health.lateness_max, 1e6)} µs, overruns ${count(health.overruns)}, ` +
      `skipped periods ${count(health.skipped)}, dropped ticks ${count(health.dropped)}`
    );
  }
}

// Return the text of a mode, and the kind that selects its colour. A stop by a person is no fault.
function shownMode({ mode, faulted, by_person: byPerson }) {
  const stopped = faulted && ["fault", "ended"].includes(mode);
  if (stopped && byPerson) return ["stopped", "stopped"];
  return stopped && mode === "ended" ? ["ended by a fault", "fault"] : [mode, mode];
}

function sentence(words) {
  return words && `${words[0].toUpperCase()}${words.slice(1)}${/[.!?]$/.test(words) ? "" : "."}`;
}
