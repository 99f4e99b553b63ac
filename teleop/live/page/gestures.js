// Zoom and pan of the time of all strips, and of the values of one strip, by mouse, touch and keyboard.

const KEYS = { "+": -1, "=": -1, "-": 1 };
const NOTCH = 50; // movement of the wheel that changes the window once [px]
const STEP = 0.1; // change of the time by an arrow key, relative to the length of the window

export class Gestures {
  constructor(parent, strips, view) {
    Object.assign(this, { parent, strips, view });
    this.turned = 0; // movement of the wheel since the last change of the window [px]
    this.pressed = null; // numbers of a strip at which the pointer was last pressed; null if it was pressed elsewhere
    this.dragged = null; // identifier of the pointer that drags, and its last place
    parent.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    parent.addEventListener("pointerdown", (event) => this.#down(event));
    parent.addEventListener("pointermove", (event) => this.#move(event));
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) {
      parent.addEventListener(type, () => (this.dragged = null));
    }
    // The target of a double click is the element that has captured the pointer.
    parent.addEventListener("dblclick", () => (this.pressed ? strips.releaseValues(this.pressed) : view.follow()));
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
    const steps = Math.sign(this.turned);
    const ticks = event.target.closest(".ticks");
    this.turned = 0;
    if (!ticks) return this.view.zoom(steps, this.view.timeAt((event.clientX - box.left) / box.width));
    const { top, height } = ticks.getBoundingClientRect();
    this.strips.zoomValues(ticks, steps, (event.clientY - top) / height);
  }

  #down(event) {
    const ticks = event.target.closest(".ticks");
    this.pressed = ticks;
    if (event.button !== 0 || !(ticks || event.target.closest(".plot"))) return;
    this.dragged = { id: event.pointerId, x: event.clientX, y: event.clientY, ticks };
    this.parent.setPointerCapture(event.pointerId);
  }

  #move(event) {
    if (!this.dragged || event.pointerId !== this.dragged.id) return;
    const { x, y, ticks } = this.dragged;
    const { clientX, clientY } = event;
    if (ticks && clientY !== y) this.strips.moveValues(ticks, (clientY - y) / ticks.clientHeight);
    if (!ticks && clientX !== x) this.view.pan((x - clientX) * this.#secondsPerPixel);
    Object.assign(this.dragged, { x: clientX, y: clientY });
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
