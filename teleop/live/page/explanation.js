// Explain a term in a box: while the mouse is over the term, while the term has the focus, or after a tap.

const GAP = 6; // distance between the term and the box [px]

export class Explanation {
  constructor(box) {
    this.box = box;
    addEventListener("scroll", () => this.#hide(), { capture: true, passive: true });
  }

  // Explain an element, which can have the focus, with a text.
  add(element, text) {
    if (!text) return;
    element.setAttribute("aria-describedby", this.box.id);
    for (const type of ["pointerenter", "focus", "click"]) element.addEventListener(type, () => this.#show(element, text));
    for (const type of ["pointerleave", "blur"]) element.addEventListener(type, () => this.#hide());
  }

  #show(element, text) {
    const { box } = this;
    box.textContent = text;
    box.hidden = false;
    const term = element.getBoundingClientRect();
    const below = term.bottom + GAP + box.offsetHeight < innerHeight;
    const left = Math.min(Math.max(term.left, GAP), innerWidth - box.offsetWidth - GAP);
    box.style.left = `${left}px`;
    box.style.top = `${below ? term.bottom + GAP : term.top - GAP - box.offsetHeight}px`;
  }

  #hide() {
    this.box.hidden = true;
  }
}
