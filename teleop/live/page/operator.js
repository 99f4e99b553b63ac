// Script of the operator's page, which shows target, force and STOP, large enough to be read from two metres.

import { Connection } from "./connection.js";
import { CueText } from "./cue.js";
import { ForceBar } from "./force_bar.js";
import { fixed } from "./format.js";
import { Frames } from "./frames.js";
import { publish } from "./inspection.js";
import { Pursuit } from "./pursuit.js";
import { ReplayClock } from "./replay_clock.js";
import { startSpeech } from "./speech.js";
import { Status } from "./status.js";
import { Stop } from "./stop.js";
import { Store } from "./store.js";
import { previewOf } from "./target.js";
import { startTheme } from "./theme.js";

const TEXTS = 200; // time between two updates of the texts [ms]

const byId = (id) => document.getElementById(id);
startTheme(byId("theme"));
const store = new Store();
const connection = new Connection("operator", store);
const status = new Status(byId, store, connection);
connection.expecting = () => status.expecting();
new Stop(byId("stop"), connection, {
  tell: (text, duration) => status.tell(text, duration),
  stopped: () => status.stopped(),
  without: () => status.withoutTrial(),
  available: () => status.kind !== "replay",
});
const pursuit = new Pursuit(byId("pursuit"), store);
const bar = new ForceBar(byId("force"), store);
const cue = new CueText(byId("cue-error"), byId("cue-rms"), byId("count-in"));
let preview = null;

connection.on("trial", (trial) => {
  store.clear();
  preview = previewOf(trial);
  pursuit.build(trial, preview);
  bar.build(trial);
  document.body.classList.toggle("has-cue", Boolean(preview));
});
byId("main-link").hash = location.hash;

let updated = 0;
const clock = new ReplayClock(connection, store);
const frames = new Frames();
frames.add((now) => clock.frame(now));
frames.add(() => pursuit.draw());
frames.add(() => bar.draw(), 2);
frames.add((now) => {
  if (now - updated < TEXTS) return;
  updated = now;
  status.update();
  cue.update(store, preview);
  byId("force-text").textContent = `${fixed(store.last(bar.column), 1)} N`;
});
startSpeech(byId("spoken"), store, status, () => "");
publish({ store, connection, status, frames, hand: {}, view: {} });
