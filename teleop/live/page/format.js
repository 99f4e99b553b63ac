// Convert numbers to text.

const MINUS = "\u2212";
const LARGE = 1e9; // larger numbers are written with a power of ten, because their digits do not fit into the page
const LARGE_ESTIMATE = 1e5; // the same for estimates, whose columns have a fixed width

export function fixed(value, digits = 0, large = LARGE) {
  if (!Number.isFinite(value)) return "–";
  const text = Math.abs(value) < large ? value.toFixed(digits) : value.toExponential(1);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", MINUS);
}

// Return an SI value and the half width of its 95 % interval as texts, in the unit of a quantity of the message
// `welcome`, with at most its decimal places.
export function withInterval(value, half, { factor, decimals }) {
  value *= factor;
  half *= factor;
  const most = Math.max(decimals, 1);
  if (!Number.isFinite(value)) return ["–", ""];
  if (!Number.isFinite(half)) return [fixed(value, Math.abs(value) < 10 ? 1 : 0, LARGE_ESTIMATE), ""];
  const digits = half > 0 ? Math.min(Math.max(1 - Math.floor(Math.log10(half)), 0), most) : most;
  return [fixed(value, digits, LARGE_ESTIMATE), half >= LARGE_ESTIMATE ? "± >99999" : `± ${fixed(half, digits)}`];
}

export function percent(share) {
  return Number.isFinite(share) ? `${fixed(100 * share)} %` : "–";
}
