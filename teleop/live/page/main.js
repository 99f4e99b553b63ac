// Script of the main page, which creates all parts of the page and updates them.

import { Connection } from "./connection.js";
import { Controls } from "./controls.js";
import { CueText } from "./cue.js";
import { Cursor } from "./cursor.js";
import { Emphasis } from "./emphasis.js";
import { Estimates } from "./estimates.js";
import { Feedback } from "./feedback.js";
import { Explanation } from "./explanation.js";
import { ForceDisplacement } from "./force_displacement.js";
import { Frames } from "./frames.js";
import { Gestures } from "./gestures.js";
import { HELP, Pointer } from "./pointer.js";
import { Replay } from "./replay.js";
import { ReplayClock } from "./replay_clock.js";
import { publish } from "./inspection.js";
import { startSpeech } from "./speech.js";
import { Status } from "./status.js";
import { Stop } from "./stop.js";
import { Store } from "./store.js";
import { Strips } from "./strips.js";
import { summaryParts } from "./summary.js";
import { startTheme } from "./theme.js";
import { Tool } from "./tool.js";
import { Trials } from "./trials.js";
import { Trust } from "./trust.js";
import { View, WINDOWS } from "./view.js";

const TEXTS = 200; // time between two updates of the texts [ms]
const HELD = "The estimate is held constant, because the present sample contains no information.";
const MISFIT = "Part of the force that neither the estimate nor noise explains, divided by the force.";
const TRUST =
  "Whether the estimate can be used: with contact and a motion that determines it, a narrow 95 % interval, a small misfit and, for b, " +
  "a small effect of force lag and lost motion. The mark is that of the best estimator. Grey numbers cannot be used.";
const RANGES = 80; // time between two updates of the ranges of the plots [ms]

const byId = (id) => document.getElementById(id);
startTheme(byId("theme"));
const store = new Store();
const connection = new Connection("main", store);
const status = new Status(byId, store, connection);
connection.expecting = () => status.expecting();
const controls = new Controls(byId, connection);
new Stop(byId("stop"), connection, {
  tell: (text, duration) => status.tell(text, duration),
  stopped: () => status.stopped(),
  without: () => status.withoutTrial(),
  available: () => status.kind !== "replay",
});
const view = new View(store);
view.moves = () => status.expecting();
const clock = new ReplayClock(connection, store);
const replay = new Replay(byId, connection, clock, view);
const emphasis = new Emphasis();
const strips = new Strips(byId("charts"), byId("axis"), { store, view, emphasis });
const cursor = new Cursor(byId("strips"), strips, byId("cursor-time"));
new Gestures(byId("strips"), strips, view);
const explanation = new Explanation(byId("explanation"));
const explain = (element, text) => explanation.add(element, text);
const estimates = new Estimates(byId("estimates").tBodies[0], store, explain, emphasis);
explain(byId("held-term"), HELD);
explain(byId("misfit-term"), MISFIT);
for (const part of ["k", "b"]) explain(byId(`trust-${part}-term`), TRUST);
const trust = new Trust(byId);
new Trials(byId("trials-area"), byId("trials"), connection);
const plane = new ForceDisplacement(byId("xy"), byId("xy-caption"), store, emphasis);
const cue = new CueText(byId("cue-error"), byId("cue-rms"), byId("count-in"));
const feedback = new Feedback(byId, store);
let welcome = null;
let trial = null;

const pointer = new Pointer(byId("tool"), (message) => connection.send(message), {
  depthAt: (share) => tool.depthAt(share),
  allowed: () => Boolean(welcome && welcome.pointer && status.state.mode === "active" && controls.take()),
  present: () => store.last("slave_position") || 0,
});
const tool = new Tool(byId("tool"), store, pointer.hand);
byId("tool-help").textContent = HELP;

function build() {
  if (!welcome) return;
  strips.build(welcome, trial);
  estimates.build(welcome, trial);
  for (const [symbol, { unit }] of Object.entries(welcome.quantities))
    for (const place of document.querySelectorAll(`[data-unit="${symbol}"]`)) place.textContent = `[${unit}]`;
  plane.build(welcome);
  tool.build(trial);
  byId("cue-panel").hidden = !strips.preview;
  feedback.build(welcome, trial);
  document.body.classList.toggle("has-pointer", Boolean(welcome.pointer));
  document.body.classList.toggle("has-no-specimen", Boolean(trial && trial.station === "master"));
}

connection.on("welcome", (message) => {
  welcome = message;
  trial = null;
  build();
});
connection.on("trial", (message) => {
  trial = message;
  store.clear();
  strips.setEvents([]);
  view.follow();
  byId("summary").close();
  byId("result-again").hidden = true;
  build();
});
connection.on("events", (message) => strips.setEvents(message.events));
connection.on("state", (message) => {
  trust.show(message.trust);
  estimates.support(message.trust);
});
function showResult({ title, use, parts, files }) {
  byId("summary-title").textContent = title;
  byId("summary-title").dataset.use = use;
  // new elements appear at their place, and nothing that a person sees moves
  for (const [id, content] of [["summary-body", parts], ["summary-files", files]]) {
    const fresh = byId(id).cloneNode();
    fresh.append(...content);
    byId(id).replaceWith(fresh);
  }
  if (!byId("summary").open) byId("summary").show();
}
let result = null; // the latest message `summary`
const showSummary = () => showResult(summaryParts(result));
const resultButtons = [byId("result"), byId("result-again")]; // of a replay, and of a session
connection.on("summary", (message) => {
  result = message;
  for (const button of resultButtons) button.hidden = false;
  if (!connection.isReplay) showSummary();
});
for (const button of resultButtons) button.addEventListener("click", showSummary);
connection.on("closed", () => pointer.release());
byId("summary-close").addEventListener("click", () => byId("summary").close());
byId("operator-link").hash = location.hash;

byId("window").replaceChildren(...WINDOWS.map((span) => new Option(`${span} s`, span)));
byId("window").addEventListener("change", (event) => view.setSpan(Number(event.target.value)));
byId("follow").addEventListener("click", () => view.follow());
function showView() {
  byId("window").value = view.span;
  byId("follow").hidden = view.follows;
  byId("strips").classList.toggle("is-past", !view.follows);
}
view.onChange(showView);
showView();

// Return the present step of a protocol; empty in other trials.
function presentStep() {
  const steps = trial?.steps ?? [];
  const step = store.count ? store.last("phase") : NaN;
  return steps[step] ? `Step ${step + 1} of ${steps.length}: ${steps[step]}` : "";
}

function hint() {
  if (presentStep()) return presentStep();
  if (!welcome || !welcome.pointer || !status.state) return "";
  if (!["ready", "active"].includes(status.state.mode)) return "";
  if (status.state.control === "other") return "Another page has control.";
  if (status.state.mode === "ready") return "Press Unlock, then Start. Then press here, hold, and move down.";
  return pointer.hand.grip ? "Move down to press, up to lift. Release to let go of the handle." : "Press here and hold to take the handle. Or hold G and use the arrow keys.";
}

let updated = 0;
let ranged = 0;
const frames = new Frames();
frames.add((now) => pointer.frame(now));
frames.add((now) => clock.frame(now));
frames.add(() => replay.draw());
frames.add((now) => {
  if (now - ranged < RANGES) return;
  ranged = now;
  strips.scale(now);
});
frames.add((now, frame) => strips.draw(frame));
frames.add(() => cursor.draw());
frames.add((now, frame) => (frame % 2 || pointer.hand.grip) && tool.draw());
frames.add((now) => plane.draw(now), 4, 1);
frames.add((now) => {
  if (now - updated < TEXTS) return;
  updated = now;
  estimates.update();
  status.update();
  feedback.update();
  if (strips.preview) cue.update(store, strips.preview);
  const text = hint();
  if (byId("tool-hint").textContent !== text) byId("tool-hint").textContent = text;
});
startSpeech(byId("spoken"), store, status, () => estimates.sentence());
publish({ store, connection, status, frames, hand: pointer.hand, view });
