// Show the result of a trial: k and b as the evaluation gives them, force over depth with the fit, and the files.

import { fixed } from "./format.js";
import { picture } from "./result_picture.js";

const POLL = 500; // time between two questions whether a file is written [ms]
const FILES = [
  ["report", "Open report"],
  ["recording", "Recording"],
  ["csv", "CSV"],
];

function element(kind, className, text) {
  const one = document.createElement(kind);
  if (className) one.className = className;
  if (text !== undefined) one.textContent = text;
  return one;
}

function table(head, rows) {
  const one = element("table", "estimates");
  const line = (texts, tag) => {
    const row = document.createElement("tr");
    row.append(...texts.map((text, i) => element(i ? tag : "th", "", text)));
    return row;
  };
  one.append(line(head, "th"), ...rows.map((row) => line(row, "td")));
  return one;
}

function values(shown) {
  const one = element("table", "result-values");
  const head = document.createElement("tr");
  head.append(element("th"), element("th"), element("th", "", "95 % interval"));
  one.append(head);
  for (const { name, symbol, value, unit, low, high, usable } of shown) {
    const row = element("tr", usable ? "" : "unsupported");
    const title = element("th", "", name || symbol);
    title.scope = "row";
    if (name) title.append(" ", element("i", "", symbol));
    row.append(title, element("td", "result-value", value ? `${value} ${unit}` : "not determined"));
    row.append(element("td", "", value && `${low} to ${high}`));
    one.append(row);
  }
  return one;
}

function further({ shown, tracking }) {
  const parts = [];
  if (shown.estimates.length) {
    parts.push(element("p", "", "Online estimators at the end, with 95 % intervals"));
    parts.push(table(shown.headings, shown.estimates));
  }
  if (tracking) {
    const row = [fixed(tracking.gain, 2), `${fixed(tracking.phase_deg)}°`, `${fixed(1e3 * tracking.delay_s)} ms`, `${fixed(1e3 * tracking.rms_m, 1)} mm`];
    parts.push(table(["", "gain", "phase", "delay", "rms"], [["tracking", ...row]]));
  }
  return parts;
}

function links(files) {
  return FILES.filter(([name]) => name in files).map(([name, text]) => {
    const one = element("a", "button", text);
    one.href = files[name];
    if (name === "report") {
      one.target = "_blank"; // the page there waits until the report is written
      one.rel = "noopener";
    } else {
      one.download = "";
    }
    if (name === "csv") one.addEventListener("click", (event) => save(one, event));
    return one;
  });
}

// Wait until the file of a link is written, and then download it with a second click.
async function save(link, event) {
  if (link.dataset.ready) return;
  event.preventDefault();
  const text = link.textContent;
  link.textContent = "Writing …";
  const problem = await waitForFile(link.href).catch(() => "no connection to teleop");
  link.textContent = text;
  if (problem) return link.replaceWith(element("span", "", problem));
  link.dataset.ready = "yes";
  link.click();
}

// Ask for a file until it is written. Return the reason why there is none; empty if there is one.
async function waitForFile(url) {
  for (;;) {
    const answer = await fetch(url);
    const isWaiting = answer.headers.has("Refresh");
    if (!isWaiting && !answer.headers.has("Content-Disposition")) return answer.text();
    answer.body.cancel();
    if (!isWaiting) return "";
    await new Promise((resolve) => setTimeout(resolve, POLL));
  }
}

// Return the title, the elements and the links of the dialog that shows the result, and which values can be used.
// `summary` is the document that `teleop run --json` prints, with the texts `shown` and the data of the picture.
export function summaryParts(summary) {
  const { shown, recording, picture: drawn, result } = summary;
  const parts = [];
  const fault = summary.safety && summary.safety.fault;
  const cause = fault && (fault.fault === "emergency stop" ? "a person" : `a fault: ${fault.text || fault}`);
  if (fault) parts.push(element("p", "", `Stopped by ${cause}`));
  if (shown.values.length) parts.push(values(shown.values));
  if (drawn) parts.push(picture(drawn));
  if (shown.reasons.length) {
    const list = element("ul", "result-reasons");
    list.append(...shown.reasons.map((text) => element("li", "", text)));
    parts.push(list);
  }
  for (const text of shown.meaning) parts.push(element("p", "muted", text));
  if (result.identifiable) parts.push(...further(summary));
  const where = recording.path ? `Recorded in ${recording.path}` : "Not recorded: there is no report and no file.";
  parts.push(element("p", "muted", recording.problem ? `The recording is not complete: ${recording.problem}` : where));
  const use = !result.identifiable ? "none" : shown.values.every((one) => one.usable) ? "all" : "some";
  return { title: shown.use, use, parts, files: links(summary.files) };
}
