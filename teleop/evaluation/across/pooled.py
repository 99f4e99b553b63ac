"""Test whether a single Kelvin-Voigt body explains several recordings of a specimen.

The values of k of all recordings are compared by Cochran's test. Its statistic is

    Q = sum_i (k_i - k_mean)^2 / s_i^2,

where s_i is the standard deviation of k_i, and k_mean is the mean of all k_i with the weights 1 /
s_i^2. If the m recordings have the same k, Q is chi-squared distributed with m - 1 degrees of
freedom. The values of b are compared in the same way if they are all of one kind
(`teleop.evaluation.batch.kinds`). The result also states the ratio of the largest to the smallest
value, with its interval. In addition, a single Kelvin-Voigt model is fitted to all recordings
together. Its residual is compared with the residuals of separate fits to each recording.

If the intervals of k are wide, the test can miss a difference. Therefore, the smallest ratio that
the test would detect with a probability of 80 % is also reported.

References
----------
W. G. Cochran, "The combination of estimates from different experiments", Biometrics 10(1), 1954.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.special import chdtrc

from estimation import least_squares
from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from teleop.evaluation.batch.kinds import MEANING, MEANING_OF_K
from teleop.evaluation.evaluation import Evaluation

POWER_80 = 2.8
"""Difference between two values that a test with the significance level 5 % detects with a
probability of 80 %, in standard deviations of the difference."""
LARGE = 1.1
"""If the ratio of the largest to the smallest value is not above this limit, the values do not
count as different, even if the difference is significant."""
WORSE = 1.2
"""If the residual of a single fit to all recordings is larger than that of separate fits by more
than this factor, the single model does not fit."""


def evaluate_together(evaluations: Mapping[str, Evaluation]) -> dict[str, Any]:
    """Test whether one Kelvin-Voigt body explains several recordings.

    The values of k and b of the recordings are compared, and a Kelvin-Voigt model is fitted to all
    recordings together. The result is a dictionary for JSON, with the comparison, the fits and
    sentences for the user (`reasons`).
    """
    regressions = [e.sampled.regression for e in evaluations.values()]
    x, v, f = (np.concatenate([r[channel] for r in regressions]) for channel in range(3))
    fit = least_squares(x, v, f)
    fits = [least_squares(*regression[:3]) for regression in regressions]
    alone = float(np.sqrt(np.mean(np.concatenate([one.residual for one in fits]) ** 2)))
    results = {
        file: e.analysis.result for file, e in evaluations.items() if e.analysis.result.identifiable
    }
    ratios: dict[str, dict[str, float]] = {}
    kinds = {
        symbol: {r.kinds[symbol] for r in results.values() if r.determines(symbol)}
        for symbol in ("k", "b")
    }
    symbols = [
        symbol
        for symbol, found in kinds.items()
        if len(found) == 1 and all(r.determines(symbol) for r in results.values())
    ]
    for symbol in symbols if len(results) > 1 else ():
        values = np.array([getattr(r, symbol) for r in results.values()])
        highest = np.array([getattr(r, f"{symbol}_high") for r in results.values()])
        ratios[symbol] = compare_values(values, (highest - values) / LEVEL_95)
    differing = {
        symbol: found["ratio"]
        for symbol, found in ratios.items()
        if found["p_value"] < 1e-3 and not found["ratio"] <= LARGE
    }
    reasons = [
        f"Kelvin-Voigt does not fit all files: {symbol} differs by a factor of {ratio:.3g} between "
        f"them (95 % interval {ratios[symbol]['low']:.3g} to {ratios[symbol]['high']:.3g})"
        if math.isfinite(ratio)
        else f"Kelvin-Voigt does not fit all files: the sign of {symbol} differs between them, or "
        f"{symbol} is negative"
        for symbol, ratio in differing.items()
    ]
    within = [
        f"Kelvin-Voigt is insufficient within {file}"
        for file, result in results.items()
        if any(reason.startswith("Kelvin-Voigt is insufficient") for reason in result.reasons)
    ]
    reasons += within
    reasons += [
        f"no stiffness is identifiable from {file}, so it is not compared"
        for file in evaluations
        if file not in results
    ]
    worse = fit.rms > WORSE * alone
    if worse and not differing:
        reasons.append("one fit to all files has a larger residual than one fit to each file")
    if not reasons and "k" in ratios:
        reasons.append(
            f"one Kelvin-Voigt body is consistent with all {len(results)} files; a difference of k "
            f"by {ratios['k']['detectable'] - 1.0:.2%} is detected in 80 % of such tests"
        )
    for symbol, meanings in (("k", MEANING_OF_K), ("b", MEANING)):
        if len(kinds[symbol]) > 1:
            reasons.append(f"{symbol} is not compared: it is {' or '.join(meanings.values())}")
    stiffnesses = [(file, e.analysis.complex_stiffness()) for file, e in evaluations.items()]
    return {
        "alone": [
            {"file": file, "b": one.b, "k": one.k, "rms": one.rms}
            for file, one in zip(evaluations, fits, strict=True)
        ],
        "b": fit.b,
        "k": fit.k,
        "rms": fit.rms,
        "rms_alone": alone,
        "ratios": ratios,
        "misfit": differing,
        "insufficient": bool(differing or within or worse),
        "reasons": reasons,
        "complex_stiffness": [{"file": file, **one} for file, one in stiffnesses if one],
    }


def compare_values(values: Floats, std: Floats) -> dict[str, float]:
    """Test whether the values of one parameter from several recordings are equal.

    `ratio` is the largest by the smallest value, with its 95 % interval from `low` to `high`; NaN
    if the smallest value is not positive. `p_value` is that of Cochran's test. `detectable` is the
    smallest ratio that the test detects with a probability of 80 %.
    """
    weights = 1.0 / std**2
    mean = float(weights @ values / weights.sum())
    q = float(weights @ (values - mean) ** 2)
    large, small = int(np.argmax(values)), int(np.argmin(values))
    ratio = low = high = math.nan
    if values[small] > 0.0:
        ratio = float(values[large] / values[small])
        half = LEVEL_95 * float(np.hypot(std[large] / values[large], std[small] / values[small]))
        low, high = ratio * math.exp(-half), ratio * math.exp(half)
    widest = float(np.linalg.norm(np.sort(std)[-2:]))
    return {
        "ratio": ratio,
        "low": low,
        "high": high,
        "p_value": float(chdtrc(len(values) - 1, q)),
        "detectable": 1.0 + POWER_80 * widest / abs(mean),
    }
