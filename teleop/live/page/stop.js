// The request STOP. Every page can send it at any time, with the button, the key Space or the key Escape.

const CONFIRMED_WITHIN = 500; // time within which the stop must be confirmed [ms]
const KEYS = "Space or Escape";
const DEAD = "cannot be sent: no connection";

export class Stop {
  constructor(button, connection, { tell, stopped, available, without }) {
    this.connection = connection;
    this.tell = tell; // shows and speaks a text
    this.stopped = stopped; // returns whether the trial has stopped, or no trial runs
    this.without = without; // returns what STOP does while no trial runs; empty during a trial
    this.available = available; // returns whether there is a trial that can be stopped
    button.addEventListener("click", () => this.send());
    const note = button.querySelector("small");
    const show = () => {
      button.classList.toggle("dead", !connection.isOpen);
      note.textContent = connection.isOpen ? KEYS : DEAD;
    };
    connection.on("words", show);
    show();
    // On this page, Space sends STOP and does not activate buttons. Enter activates buttons.
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
    if (this.without()) this.tell(this.without(), 3000);
    setTimeout(() => {
      if (!this.stopped()) this.tell("STOP was sent but is not confirmed. Use the emergency stop of the hardware, or Enter in the terminal.");
    }, CONFIRMED_WITHIN);
  }
}

// Return whether the key is Space, and the person is not writing in a text field.
export function isSpace(event) {
  return (event.code === "Space" || event.key === " ") && event.target.tagName !== "TEXTAREA";
}
