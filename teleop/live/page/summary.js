// Show the result of a trial: the estimates at the end, and how well the slave followed the target.

import { fixed, percent, withInterval } from "./format.js";

function table(head, rows) {
  const one = document.createElement("table");
  one.className = "estimates";
  const line = (texts, tag) => {
    const row = document.createElement("tr");
    texts.forEach((text, i) => {
      const cell = document.createElement(i ? tag : "th");
      cell.textContent = text;
      row.append(cell);
    });
    return row;
  };
  one.append(line(head, "th"), ...rows.map((row) => line(row, "td")));
  return one;
}

function paragraph(text) {
  const one = document.createElement("p");
  one.textContent = text;
  return one;
}

// Return the elements of the page that show the result. `summary` is the document that `teleop run --json` prints.
// `k` and `b` are quantities of the message `welcome`.
export function summaryParts(summary, { k, b }) {
  const parts = [];
  const fault = summary.safety && summary.safety.fault;
  const cause = fault && fault.fault === "emergency stop" ? "a person" : "a fault";
  if (fault) parts.push(paragraph(`Stopped by ${cause}: ${fault.text || fault}`));
  const estimates = Object.entries(summary.estimates || {});
  if (estimates.length) {
    const rows = estimates.map(([name, e]) => [
      name,
      withInterval(e.k_end, e.k_interval, k).join(" "),
      withInterval(e.b_end, e.b_interval, b).join(" "),
      percent(e.held),
      percent(e.misfit),
    ]);
    parts.push(paragraph("Estimates at the end, with 95 % intervals"));
    parts.push(table(["", `k [${k.unit}]`, `b [${b.unit}]`, "held", "misfit"], rows));
  }
  const tracking = summary.tracking;
  if (tracking) {
    parts.push(paragraph("Tracking of the target"));
    parts.push(
      table(
        ["", "gain", "phase", "delay", "rms"],
        [["tracking", fixed(tracking.gain, 2), `${fixed(tracking.phase_deg)}°`, `${fixed(1e3 * tracking.delay_s)} ms`, `${fixed(1e3 * tracking.rms_m, 1)} mm`]],
      ),
    );
  }
  const recording = summary.recording;
  if (recording && recording.path) parts.push(paragraph(`Recorded in ${recording.path}`));
  return parts;
}
