// Show the law of the force feedback, the communication channel, and the force and the body that the hand feels.

import { fixed } from "./format.js";

const NEAR_PRIOR = 0.95; // a model that is at least this fraction of the prior is not estimated from the specimen

export class Feedback {
  constructor(byId, store) {
    this.byId = byId;
    this.store = store;
    this.feedback = null;
  }

  build(welcome, trial) {
    this.feedback = (trial && trial.feedback) || null;
    this.quantities = welcome.quantities;
    this.byId("feedback-panel").hidden = !this.feedback;
    if (!this.feedback) return;
    const elsewhere = trial.station === "master" ? " · k and b: at the slave station" : "";
    this.byId("feedback-settings").textContent = describe(this.feedback) + elsewhere;
    this.update();
  }

  update() {
    if (!this.feedback) return;
    const text = this.feedback.law === "none" ? this.#age() : this.#felt();
    if (this.byId("feedback-felt").textContent !== text) this.byId("feedback-felt").textContent = text;
  }

  #age() {
    const age = this.store.last("report_age");
    return Number.isFinite(age) ? `Data from the tool are ${fixed(1e3 * age)} ms old` : "";
  }

  #felt() {
    const force = this.store.last("displayed_force");
    if (!Number.isFinite(force)) return "";
    return `The hand feels ${fixed(force, 1)} N: ${this.#body()}`;
  }

  #body() {
    const { prior } = this.feedback;
    const { unit, factor } = this.quantities.k;
    const stiffness = this.store.last("model_stiffness");
    if (prior === null) return `the contact force of ${fixed(1e3 * this.store.last("report_age"))} ms ago`;
    if (!(stiffness < NEAR_PRIOR * prior)) return "stiff until the first push";
    return `a spring of ${fixed(factor * stiffness)} ${unit}`;
  }
}

function describe({ law, delay, jitter, loss }) {
  const feedback = law === "none" ? "no force feedback" : law;
  const parts = [`delay ${fixed(1e3 * delay)} ms`];
  if (jitter) parts.push(`jitter ${fixed(1e3 * jitter)} ms`);
  if (loss) parts.push(`loss ${fixed(100 * loss)} %`);
  return `${feedback} · ${delay || jitter || loss ? parts.join(", ") : "no delay, no loss"}`;
}
