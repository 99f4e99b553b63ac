// Estimated force as a function of the displacement, without its damping part.
//
// `further` contains the names of the estimated parameters besides b and k. The force can be drawn over the
// displacement only if it does not also depend on another quantity, such as the acceleration or the derivative of
// the force.

const TERMS = { k3: "k3\u00a0x³", f0: "f0" };

// Return the formula as text, and a function that computes the force [N] from the parameters p and the displacement
// x [m]. The result is null if the force also depends on other quantities.
export function fittedForce(further) {
  if (further.includes("K") && further.includes("n")) {
    return { formula: "K\u00a0xⁿ", force: (p, x) => (x > 0 ? p.K * x ** p.n : 0) };
  }
  if (!further.every((name) => name in TERMS)) return null;
  const formula = ["k\u00a0x", ...further.map((name) => TERMS[name])].join(" + ");
  return { formula, force: (p, x) => (p.f0 || 0) + p.k * x + (p.k3 || 0) * x ** 3 };
}

const MOST_NAMES = 3; // if there are more estimators without a line, only their number is shown

// Return a part of the caption of the plot: the formulas of the lines, and the estimators without a line.
export function fitCaption(fits) {
  const formulas = [...new Set(fits.filter((one) => one.law).map((one) => one.law.formula))];
  const without = fits.filter((one) => !one.law).map((one) => one.label);
  const names = without.length > MOST_NAMES ? `${without.length} estimators` : without.join(", ");
  const sentences = [];
  if (formulas.length) sentences.push(`Lines: estimated force ${formulas.join("; ")}, without the damping part.`);
  if (without.length) sentences.push(`No line for ${names}: the estimated force also depends on other quantities.`);
  return sentences.join(" ");
}
