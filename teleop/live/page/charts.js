// Define the strip charts of the main page, with columns, units and line styles.

import { Scale } from "./scale.js";
import { colours, estimatorColour, estimatorDash } from "./theme.js";

const LIMIT = { colour: "limit", dash: [3, 4] };
const TRUTH = { colour: "truth", dash: [10, 5] };
const THRESHOLD = { colour: "truth", dash: [2, 3], digits: 0, isBeside: true };

function line(name, colour, label, width = 1.8, dash = []) {
  return { name, label, swatch: colour, colour: () => colours[colour], width: () => width, opacity: () => 1, dash };
}

function estimated(estimators, key, columns, emphasis) {
  const name = (index) => (index === null || index === undefined ? undefined : columns[index].name);
  return estimators.map((e, index) => ({
    name: name(e[key]),
    std: name(e[`${key}_std`]),
    held: name(e.held),
    settled: { value: name(e.k), std: name(e.k_std) },
    label: e.name,
    index,
    swatch: index % 5,
    colour: () => estimatorColour(index),
    width: () => 1.8 * emphasis.width(e.name),
    opacity: () => emphasis.opacity(e.name),
    isEstimator: true,
    dash: estimatorDash(index),
  }));
}

// Return unit, factor from SI and digits of a quantity of the message `welcome`.
function shown({ unit, factor, decimals }) {
  return { unit, factor, digits: decimals };
}

function levels(values, style, text) {
  return values.filter(Number.isFinite).map((value) => ({ value, text, ...style }));
}

// Return the charts for the columns in the message `welcome`, and the limits and true values in `trial`. `emphasis`
// states which estimators are highlighted or hidden. Of two stations, the master measures only the handle, and shows
// what the hand feels; the slave has no handle.
export function charts(welcome, trial, emphasis) {
  const limits = (trial && trial.limits) || {};
  const truth = (trial && trial.truth) || {};
  const force = [limits.soft_force, limits.hard_force].filter(Number.isFinite);
  const position = limits.soft_position || [];
  const { k, b, position: length, velocity: speed, force: load } = welcome.quantities;
  const target = trial && trial.target ? [{ ...line("target", "target", "target", 4), marker: "target-marker" }] : [];
  const handle = line("master_position", "muted", "handle", 1.3, [3, 3]);
  const tool = { ...line("slave_position", "own", "tool", 2.2), marker: "own-marker" };
  const positions = {
    id: "position", title: "position", ...shown(length), share: 1.5, scale: new Scale(0.002 * length.factor),
    traces: [...target, handle, tool], levels: levels(position, LIMIT, "soft limit"),
  };
  const axis = { id: "axis", axis: true, traces: [], levels: [], factor: 1, scale: new Scale(1) };
  const side = trial && trial.station;
  if (side === "master") return [
    { ...positions, traces: [...target, { ...line("master_position", "own", "handle", 2.2), marker: "own-marker" }], levels: [] },
    {
      id: "felt-force", title: "force on the hand", ...shown(load), share: 1.1, scale: new Scale(2 * load.factor),
      traces: [line("displayed_force", "force", "force on the hand")], levels: [],
    },
    {
      id: "felt-stiffness", title: "stiffness that the hand feels", ...shown(k), share: 1.5, scale: new Scale(100 * k.factor),
      traces: [line("model_stiffness", "text", "stiffness that the hand feels")],
      levels: levels([truth.k_surface], TRUTH, "true at the surface"),
    },
    axis,
  ];
  return [
    side === "slave" ? { ...positions, traces: [...target, tool] } : positions,
    {
      id: "force", title: "contact force", ...shown(load), share: 1.1, scale: new Scale(2 * load.factor),
      traces: [line("contact_force", "force", "contact force")],
      levels: [
        ...levels(force.slice(0, 1), LIMIT, "soft limit"),
        ...levels(force.slice(1), LIMIT, "hard limit"),
      ],
    },
    {
      id: "velocity", title: "velocity", ...shown(speed), share: 0.8, scale: new Scale(0.01 * speed.factor),
      traces: [line("slave_velocity", "velocity", "velocity", 1.6)],
      levels: levels([limits.max_velocity, -limits.max_velocity], LIMIT, "soft limit"),
    },
    {
      id: "stiffness", title: "stiffness k", ...shown(k), share: 1.5, scale: new Scale(100 * k.factor),
      traces: estimated(welcome.estimators, "k", welcome.columns, emphasis),
      levels: [
        ...levels([truth.k_surface], TRUTH, "true at the surface"),
        ...levels([truth.k], TRUTH, "true at full depth"),
      ],
      robust: true,
    },
    {
      id: "damping", title: "damping b", ...shown(b), digits: Math.max(b.decimals - 1, 0), share: 1, scale: new Scale(20 * b.factor),
      traces: estimated(welcome.estimators, "b", welcome.columns, emphasis),
      levels: levels([truth.b], TRUTH, "true"),
      robust: true,
    },
    // recordings of earlier versions do not have the columns of this chart
    ...(welcome.columns.length && !welcome.columns.some(({ name }) => name === "k_bound") ? [] : [{
      id: "expected", title: "possible ±", unit: "%", factor: 100, digits: 1, share: 0.5, scale: new Scale(2),
      traces: [line("k_bound", "text", "of k", 1.5), line("b_bound", "muted", "of b", 1.5, [4, 3])],
      levels: levels([welcome.thresholds.expected], THRESHOLD, "most for estimates"),
      most: 1.2 * welcome.thresholds.expected,
    }]),
    axis,
  ];
}
