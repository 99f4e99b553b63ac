// Hand of the simulated operator, which a person moves by mouse, touch, keyboard or gamepad. The hand grips
// the handle while the person holds a button or a key.

const SPEED = 0.03; // speed of the hand while an arrow key is held [m/s]
const REACH = 0.018; // depth of the hand when the stick of a gamepad is moved down as far as possible [m]
const GRIP_KEY = "g";
const ARROWS = { ArrowDown: 1, ArrowUp: -1 };

export const HELP =
  "Mouse or touch: press and hold to grip the handle, move down to press on the surface, release to let go. " +
  "Keyboard: hold G to grip the handle, arrow down and arrow up move the hand. " +
  "Gamepad: hold the first button or the right trigger to grip the handle, move the left stick.";

export class Pointer {
  // `depthAt` converts a fraction of the height of the canvas to a depth [m]. `allowed` returns whether
  // the hand may grip. `present` returns the present depth of the tool [m].
  constructor(canvas, send, { depthAt, allowed, present }) {
    this.canvas = canvas;
    this.send = send;
    this.depthAt = depthAt;
    this.allowed = allowed;
    this.present = present;
    this.hand = { depth: 0, grip: false };
    this.source = null; // device that holds the grip: "mouse", "keys" or "pad"
    this.arrows = new Set();
    this.key = null; // key of the keyboard that holds the grip
    this.before = NaN;
    this.box = null; // box of the canvas when the mouse gripped the handle
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) {
      canvas.addEventListener(type, () => this.release("mouse"));
    }
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    addEventListener("keydown", (event) => this.#keyDown(event));
    addEventListener("keyup", (event) => this.#keyUp(event));
    addEventListener("blur", () => this.release());
    addEventListener("pagehide", () => this.release());
    document.addEventListener("visibilitychange", () => document.hidden && this.release());
  }

  // Release the handle if the device `source` holds the grip. By default, release it for any device.
  release(source = this.source) {
    if (!this.hand.grip || source !== this.source) return;
    this.#forget();
    this.#tell();
  }

  #forget() {
    this.hand.grip = false;
    this.source = null;
    this.arrows.clear();
  }

  // Send depth and grip of the hand while it grips. This method is called in each frame.
  frame(now) {
    const dt = Math.min((now - this.before) / 1000, 0.05) || 0;
    this.before = now;
    this.#pad();
    if (!this.hand.grip) return;
    if (!this.allowed()) {
      this.#forget(); // the trial has ended, or another page has control: the hand no longer holds the handle
      return;
    }
    for (const key of this.arrows) this.hand.depth += ARROWS[key] * SPEED * dt;
    this.#limit();
    this.#tell();
  }

  #tell() {
    this.send({ type: "pointer", depth: this.hand.depth, grip: this.hand.grip });
  }

  #grip(source, depth) {
    if (this.hand.grip || !this.allowed()) return false;
    this.source = source;
    this.hand.depth = depth;
    this.#limit();
    this.hand.grip = true;
    return true;
  }

  #limit() {
    this.hand.depth = Math.min(Math.max(this.hand.depth, this.depthAt(0)), this.depthAt(1));
  }

  // Return the depth at the mouse. While the mouse holds the handle, the mapping does not change, so that a mouse at
  // rest does not move the hand, even if the layout of the page changes.
  #depthOf(event) {
    return this.depthAt((event.clientY - this.box.top) / this.box.height);
  }

  #down(event) {
    if (event.button !== 0 || this.hand.grip) return;
    this.box = this.canvas.getBoundingClientRect();
    if (!this.#grip("mouse", this.#depthOf(event))) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.pointerId = event.pointerId;
    event.preventDefault();
    this.canvas.focus({ preventScroll: true });
  }

  #move(event) {
    if (this.source !== "mouse" || event.pointerId !== this.pointerId) return;
    // If another button is still pressed, the browser reports the release of the first one as a movement.
    if (event.buttons & 1) this.hand.depth = this.#depthOf(event);
    else this.release("mouse");
  }

  #keyDown(event) {
    if (typing(event) || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key.toLowerCase() === GRIP_KEY && !event.repeat && this.#grip("keys", this.present())) {
      this.key = event.code; // with AltGr, the same key has another name when it is released
      event.preventDefault();
    }
    if (event.key in ARROWS && this.source === "keys") {
      this.arrows.add(event.key);
      event.preventDefault();
    }
  }

  #keyUp(event) {
    if (event.code === this.key) this.release("keys");
    this.arrows.delete(event.key);
  }

  #pad() {
    if (!navigator.getGamepads) return;
    const pad = [...navigator.getGamepads()].find((one) => one && one.connected);
    const pressed = Boolean(pad && [0, 7].some((i) => pad.buttons[i] && pad.buttons[i].pressed));
    if (this.source === "pad" && !pressed) this.release("pad");
    if (!pressed) return;
    const depth = (pad.axes[1] || 0) * REACH;
    if (this.source === "pad") this.hand.depth = depth;
    else this.#grip("pad", depth);
  }
}

export function typing(event) {
  return /^(TEXTAREA|SELECT|INPUT)$/.test(event.target.tagName);
}
