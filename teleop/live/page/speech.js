// Write the present values as a sentence for screen readers, every few seconds.

import { fixed } from "./format.js";

const EVERY = 6000; // time between two sentences [ms]

export function startSpeech(element, store, status, estimate) {
  setInterval(() => {
    const mode = status.state ? status.state.mode : "";
    if (mode !== "active" || !store.count) return;
    const words = [
      `${fixed(store.trialTime(store.last("time")))} seconds`,
      `depth ${fixed(1e3 * store.last("slave_position"), 1)} millimetres`,
      `force ${fixed(store.last("contact_force"), 1)} newtons`,
      estimate(),
    ];
    element.textContent = words.filter(Boolean).join(", ");
  }, EVERY);
}
