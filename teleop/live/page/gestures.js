// Zoom and pan of the strips, by mouse, touch and keyboard.

const KEYS = { "+": -1, "=": -1, "-": 1 };
const NOTCH = 50; // movement of the wheel that changes the window once [px]
const STEP = 0.1; // change of the time by an arrow key, relative to the length of the window

export class Gestures {
  constructor(parent, strips, view) {
    Object.assign(this, { parent, strips, view });
    this.turned = 0; // movement of the wheel since the last change of the window [px]
    this.dragged = null; // identifier of the pointer that drags, and its last place
    parent.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    parent.addEventListener("pointerdown", (event) => this.#down(event));
    parent.addEventListener("pointermove", (event) => this.#move(event));
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) {
      parent.addEventListener(type, () => (this.dragged = null));
    }
    parent.addEventListener("dblclick", () => view.follow());
    parent.addEventListener("keydown", (event) => this.#key(event));
  }

  get #secondsPerPixel() {
    const box = this.strips.box();
    return box ? (this.view.span + this.view.preview) / box.width : 0;
  }

  // On a page that can be scrolled, the wheel zooms only together with the key Ctrl.
  #wheel(event) {
    const scrolls = document.documentElement.scrollHeight > innerHeight;
    const box = this.strips.box();
    if (!box || (scrolls && !event.ctrlKey) || !event.deltaY) return;
    event.preventDefault();
    this.turned += event.deltaMode ? NOTCH * Math.sign(event.deltaY) : event.deltaY;
    if (Math.abs(this.turned) < NOTCH) return;
    this.view.zoom(Math.sign(this.turned), this.view.timeAt((event.clientX - box.left) / box.width));
    this.turned = 0;
  }

  #down(event) {
    if (event.button !== 0 || !event.target.closest(".plot")) return;
    this.dragged = { id: event.pointerId, x: event.clientX };
    this.parent.setPointerCapture(event.pointerId);
  }

  #move(event) {
    if (!this.dragged || event.pointerId !== this.dragged.id || event.clientX === this.dragged.x) return;
    this.view.pan((this.dragged.x - event.clientX) * this.#secondsPerPixel);
    this.dragged.x = event.clientX;
  }

  #key(event) {
    if (event.target !== this.parent || event.ctrlKey || event.altKey || event.metaKey) return;
    const arrow = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key in KEYS) this.view.zoom(KEYS[event.key]);
    else if (event.key === "End") this.view.follow();
    else if (arrow) this.view.pan(arrow * STEP * this.view.span);
    else return;
    event.preventDefault();
  }
}
