// STOP: the button, Space and Escape. It is available to every page at any time.

const CONFIRMED_WITHIN = 500; // ms

export class Stop {
  constructor(button, connection, { tell, stopped, available }) {
    this.connection = connection;
    this.tell = tell; // shows and speaks a text
    this.stopped = stopped; // whether the trial has stopped, or none runs
    this.available = available; // whether there is a trial that can be stopped
    button.addEventListener("click", () => this.send());
    // Space does not press buttons on this page; Enter does.
    addEventListener("keydown", (event) => this.#key(event, true), { capture: true });
    addEventListener("keyup", (event) => this.#key(event, false), { capture: true });
  }

  #key(event, down) {
    if (!(event.key === "Escape" || isSpace(event)) || !this.available()) return;
    event.preventDefault();
    if (down && !event.repeat) this.send();
  }

  send() {
    if (!this.connection.send({ type: "stop" })) {
      this.tell("STOP was NOT sent, because there is no connection. Use the emergency stop of the hardware, or Enter in the terminal.");
      return;
    }
    setTimeout(() => {
      if (!this.stopped()) this.tell("STOP was sent but is not confirmed. Use the emergency stop of the hardware, or Enter in the terminal.");
    }, CONFIRMED_WITHIN);
  }
}

// Whether Space was pressed, and not in order to write a text.
export function isSpace(event) {
  return (event.code === "Space" || event.key === " ") && event.target.tagName !== "TEXTAREA";
}
