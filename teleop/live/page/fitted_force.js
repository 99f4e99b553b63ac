// Force over displacement that an estimator fits, without damping.
//
// `further` has the names of the parameters besides b and k. The force can be drawn over the displacement only if
// it depends on no other quantity, such as the acceleration or the rate of the force.

const TERMS = { k3: "k3\u00a0x³", f0: "f0" };

// Formula, and force [N] at displacement x [m] for parameters p; null if the force depends on more than x.
export function fittedForce(further) {
  if (further.includes("K") && further.includes("n")) {
    return { formula: "K\u00a0xⁿ", force: (p, x) => (x > 0 ? p.K * x ** p.n : 0) };
  }
  if (!further.every((name) => name in TERMS)) return null;
  const formula = ["k\u00a0x", ...further.map((name) => TERMS[name])].join(" + ");
  return { formula, force: (p, x) => (p.f0 || 0) + p.k * x + (p.k3 || 0) * x ** 3 };
}

const MOST_NAMES = 3;

// Caption of the plot: the formulas of the lines, and the estimators without a line.
export function fitCaption(fits) {
  const formulas = [...new Set(fits.filter((one) => one.law).map((one) => one.law.formula))];
  const without = fits.filter((one) => !one.law).map((one) => one.label);
  const names = without.length > MOST_NAMES ? `${without.length} estimators` : without.join(", ");
  const sentences = [];
  if (formulas.length) sentences.push(`Lines: ${formulas.join("; ")}, without damping.`);
  if (without.length) sentences.push(`No line of ${names}: the force of the model depends on more than the displacement.`);
  return sentences.join(" ");
}
