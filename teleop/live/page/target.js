// Compute the target of the condition mimic, also for times that the loop has not reached yet.

// Return the target as a function of time, with its lowest and highest position as properties. The result
// is null if the trial has no target.
export function previewOf(trial) {
  const target = trial && trial.target;
  if (!target) return null;
  const { frequency, depth, low, count_in: countIn } = target;
  const position = (t) =>
    low + 0.5 * (depth - low) * (1 - Math.cos(2 * Math.PI * frequency * Math.max(t - countIn, 0)));
  return Object.assign(position, { low, high: depth, countIn: countIn || 0 });
}
