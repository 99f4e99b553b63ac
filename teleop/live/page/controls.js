// Buttons, choices and notes of the page. They send requests that control the trial.

const MOST_BYTES = 900; // largest size of a message
const ANSWERS = ["next", "repeat", "skip"]; // buttons that answer a question between two trials
// Time in which nobody can have read a new question [ms]. It is longer than a double click, whose second click would
// otherwise answer the question that follows the first click.
const READING = 700;
// Buttons that lose the focus when they can no longer be pressed.
const BUTTONS = ["unlock", "start", "end", ...ANSWERS];
const INLINE = ["condition", "specimen", "duration"]; // lists among the buttons, of which one value is chosen
const CHOICES = [...INLINE, "feedback"];

// Return a box with which an estimator is chosen.
function option(name) {
  const label = document.createElement("label");
  const box = Object.assign(document.createElement("input"), { type: "checkbox", value: name });
  label.append(box, " ", name);
  return label;
}

export class Controls {
  constructor(byId, connection) {
    this.byId = byId;
    this.connection = connection;
    this.welcome = null;
    this.series = null;
    this.state = null;
    this.prompt = null; // number of the question
    this.seeks = false; // whether a button lost the focus, and the next one cannot be pressed yet
    this.readable = 0; // time from which an answer is possible [ms]
    for (const type of ANSWERS) byId(type).addEventListener("click", () => this.#answer({ type }));
    for (const type of ["unlock", "start", "end"]) {
      byId(type).addEventListener("click", () => this.#request({ type }));
    }
    byId("control").addEventListener("click", () => {
      connection.send({ type: this.state.control === "you" ? "release" : "control" });
    });
    for (const name of CHOICES) byId(name).addEventListener("change", () => this.#choose());
    byId("estimators-use").addEventListener("click", () => this.#choose());
    byId("estimators-list").addEventListener("change", () => this.#update(this.state));
    byId("notes-save").addEventListener("click", () => this.#saveNotes());
    connection.on("welcome", (message) => this.#welcome(message));
    connection.on("trial", (message) => this.#trial(message));
    connection.on("state", (message) => this.#update(message));
    connection.on("closed", () => this.#update(null));
    this.#update(null);
  }

  // Return whether requests are possible: this page or no page has control. If no page has control, request
  // control.
  take() {
    if (this.state && this.state.control === "none") this.connection.send({ type: "control" });
    return Boolean(this.state && this.state.control !== "other");
  }

  #request(message) {
    if (this.take()) this.connection.send(message);
  }

  #answer(message) {
    this.#request({ ...message, prompt: this.prompt });
    this.#wait();
    this.#update(this.state);
  }

  // Accept no answer for the time READING, after a new question and after an answer.
  #wait() {
    this.readable = performance.now() + READING;
    setTimeout(() => this.#update(this.state), READING + 1);
  }

  #welcome(message) {
    this.welcome = message;
    const choices = message.choices || {};
    for (const name of CHOICES) {
      const values = choices[name] || [];
      const select = this.byId(name);
      select.replaceChildren(...values.map((value) => new Option(name === "duration" ? `${value} s` : value, value)));
      select.parentElement.hidden = values.length < 2;
    }
    const has = (name) => (choices[name] || []).length > 1;
    this.byId("choices").hidden = !INLINE.some(has);
    this.byId("more-area").hidden = !has("feedback") && !has("estimators");
    const names = choices.estimators || [];
    this.byId("estimators-area").hidden = names.length < 2;
    this.byId("estimators-list").replaceChildren(...names.map(option));
    this.#update(this.state);
  }

  #trial(message) {
    const chosen = message.choice || message;
    for (const name of CHOICES) if (name in chosen) this.byId(name).value = chosen[name];
    for (const box of this.#boxes) box.checked = (chosen.estimators || []).includes(box.value);
    this.series = message.series;
    this.byId("series-text").textContent = this.series ? `trial ${this.series.position} of ${this.series.of}` : "";
  }

  // Boxes of the estimators.
  get #boxes() {
    return [...this.byId("estimators-list").querySelectorAll("input")];
  }

  get #estimators() {
    return this.#boxes.filter((box) => box.checked).map((box) => box.value);
  }

  // Send all chosen settings of the next trial.
  #choose() {
    const message = { type: "choose" };
    for (const name of CHOICES) {
      const values = ((this.welcome || {}).choices || {})[name] || [];
      if (values.length) message[name] = values[this.byId(name).selectedIndex];
    }
    if (this.#estimators.length) message.estimators = this.#estimators;
    this.#request(message);
  }

  #saveNotes() {
    const message = { type: "notes", text: this.byId("notes").value, prompt: this.prompt };
    const fits = new TextEncoder().encode(JSON.stringify(message)).length <= MOST_BYTES;
    if (fits) this.#answer(message);
    const saved = this.series ? "The notes are saved with this trial." : "The next recording will contain the notes.";
    this.byId("notes-text").textContent = fits ? saved : "Too long: shorten the notes.";
  }

  #update(state) {
    this.state = state;
    const { byId, welcome } = this;
    const allowed = Boolean(state && welcome && welcome.kind === "live" && state.control !== "other");
    const mode = state ? state.mode : "";
    const running = mode === "active" || mode === "stopping";
    const mayArm = allowed && Boolean(welcome.may_arm) && mode === "ready";
    const prompt = (state && state.prompt) || { number: null, answers: [] };
    if (prompt.number !== this.prompt) {
      this.prompt = prompt.number;
      this.#wait();
    }
    const focused = document.activeElement;
    const answers = allowed && performance.now() >= this.readable ? prompt.answers : [];
    byId("skip").hidden = !this.series;
    byId("next").hidden = byId("repeat").hidden = !this.series && Boolean(welcome && !welcome.may_arm);
    for (const name of ANSWERS) byId(name).disabled = !answers.includes(name);
    byId("unlock").disabled = !mayArm;
    byId("unlock").hidden = byId("start").hidden = Boolean(welcome && !welcome.may_arm);
    byId("start").disabled = !(mayArm && state.unlocked);
    byId("start").classList.toggle("ready", mayArm && Boolean(state.unlocked));
    byId("end").disabled = !(allowed && running);
    for (const name of CHOICES) byId(name).disabled = !allowed || running;
    for (const box of this.#boxes) box.disabled = !allowed || running;
    byId("estimators-use").disabled = !allowed || running || !this.#estimators.length;
    byId("notes-save").disabled = !answers.includes("notes");
    const control = byId("control");
    const mine = Boolean(state && state.control === "you");
    control.disabled = !state || state.control === "other";
    control.textContent = mine ? "Release control" : "Take control";
    control.title = control.disabled && state ? "Another page has control" : "";
    this.#moveFocus(focused, mode);
  }

  // A button that can no longer be pressed loses the focus. Give it to the controls, and then to the element that a
  // person uses next: the picture of the tool during a trial, else UNLOCK or NEXT.
  #moveFocus(focused, mode) {
    const area = this.byId("controls");
    if (focused.disabled && BUTTONS.includes(focused.id)) {
      this.seeks = true;
      area.focus({ preventScroll: true });
    }
    if (!this.seeks) return;
    const next = this.byId({ active: "tool", ready: "unlock" }[mode] || "next");
    this.seeks = [area, document.body].includes(document.activeElement) && next.disabled;
    if (document.activeElement === area && !next.disabled) next.focus({ preventScroll: true });
  }
}
