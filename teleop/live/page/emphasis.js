// Which estimators a person has highlighted or hidden. The button of an estimator highlights it, hides it, and shows it
// again.

const NEXT = { shown: "highlighted", highlighted: "hidden", hidden: "shown" };
const ACTION = { shown: "highlight it", highlighted: "hide it", hidden: "show it again" };
const FAINT = 0.25; // opacity of an estimator while another one is highlighted

export class Emphasis {
  constructor() {
    this.states = new Map(); // "highlighted" or "hidden" by the name of an estimator; all others are shown
    this.listeners = [];
  }

  onChange(listener) {
    this.listeners.push(listener);
  }

  of(name) {
    return this.states.get(name) || "shown";
  }

  // Return the opacity of an estimator; 0 if it is hidden.
  opacity(name) {
    const state = this.of(name);
    if (state === "hidden") return 0;
    return state === "shown" && [...this.states.values()].includes("highlighted") ? FAINT : 1;
  }

  // Return the width of a line of an estimator, relative to the usual one.
  width(name) {
    return this.of(name) === "highlighted" ? 1.7 : 1;
  }

  // Let a button change the state of an estimator.
  attach(button, name) {
    button.dataset.estimator = name;
    button.addEventListener("click", () => this.#advance(name));
    this.#label(button);
  }

  #advance(name) {
    const next = NEXT[this.of(name)];
    if (next === "shown") this.states.delete(name);
    else this.states.set(name, next);
    for (const button of document.querySelectorAll("[data-estimator]")) this.#label(button);
    for (const listener of this.listeners) listener();
  }

  #label(button) {
    const name = button.dataset.estimator;
    const state = this.of(name);
    button.dataset.emphasis = state;
    button.title = `${name} is ${state}: press to ${ACTION[state]}`;
    button.setAttribute("aria-label", button.title);
  }
}
