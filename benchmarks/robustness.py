"""Test estimators with ten minutes of difficult signals: `python benchmarks/robustness.py`.

Each case begins with 5 s of persistent excitation, in which the estimates converge, followed by
600 000 samples at 1 kHz. Every estimator runs without a gate and with the preset's gate. No value
and no standard deviation should be NaN or infinite, and every covariance should be positive
definite. This is checked after every 1000 samples. The estimators are compared with padasip's
FilterRLS with the same forgetting factor.

In a hold, the probe is at rest at 5 mm. The position has white noise, and the velocity has the
difference of this noise, filtered by a low-pass of 20 Hz. With noise of 0.1 um, padasip's b varies
by hundreds of N s/m. With 3 um, the noise itself excites the regressors, and b varies less. In the
first 10 s of a hold, b of a gated estimator should change by less than three standard deviations.
"""

from __future__ import annotations

import math
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import padasip
from bank_case import DEPTH, NOISE, RATE, B, K, bank_of, excitation, show

from estimation import METHODS, Bank, Estimator, FilteredDifference
from estimation.linear_gain import LinearGainEstimator

LEAD = 5_000
LASTING = 600_000
LENGTHS = (10_000, LASTING)
CHUNK = 1000
HOLDS = {"hold 0.1 um": 0.1e-6, "hold 3 um": 3e-6}
SCALED = {
    "x 1e6": (1e6, 1.0),
    "x 1e-6": (1e-6, 1.0),
    "f 1e6": (1.0, 1e6),
    "f 1e-6": (1.0, 1e-6),
}
"""Factor by which x and v are multiplied, and factor by which f is multiplied."""
CASES = ("zero", *HOLDS, "constant v", "outliers", *SCALED)
PEER = "padasip RLS"
Signals = tuple[np.ndarray, np.ndarray, np.ndarray]


def signals(case: str) -> Signals:
    """Return displacement, velocity and force, each of shape (LEAD + LASTING,)."""
    rng = np.random.default_rng(0)
    t = np.arange(LEAD + LASTING) / RATE
    after = slice(LEAD, None)
    noise = rng.normal(0.0, NOISE, len(t))
    x, v = excitation(t)
    if case in HOLDS:
        stop = np.clip((LEAD / RATE - t) / 0.2, 0.0, 1.0)
        x = DEPTH + stop**2 * (3.0 - 2.0 * stop) * (x - DEPTH)
        v = np.gradient(x, t)
        error = rng.normal(0.0, HOLDS[case], len(t))
        v_error = FilteredDifference(20.0).run(error, error, 1.0 / RATE).v
        return x + error, v + v_error, B * v + K * x + noise
    if case == "zero":
        x[after] = v[after] = 0.0
    if case == "constant v":
        v[after] = 5e-3
        x[after] = DEPTH + 5e-3 * (t[after] - t[LEAD])
    f = B * v + K * x + noise
    if case == "outliers":
        for channel, size in ((x, 1.0), (v, 100.0), (f, 1000.0)):
            hit = LEAD + np.flatnonzero(rng.random(LASTING) < 0.01)
            channel[hit] += size * rng.standard_normal(len(hit))
    motion, force = SCALED.get(case, (1.0, 1.0))
    for channel, factor in ((x, motion), (v, motion), (f, force)):
        channel[after] *= factor
    return x, v, f


def definite(covariance: np.ndarray) -> bool:
    """Return whether all variances are positive and all correlations are between -1 and 1."""
    variances = np.diag(covariance)
    if not (np.isfinite(covariance).all() and (variances > 0.0).all()):
        return False
    deviations = np.sqrt(variances)
    correlations = covariance / deviations / deviations[:, None]
    return bool(np.all(np.abs(correlations[~np.eye(len(variances), dtype=bool)]) < 1.0))


def fault(estimator: Estimator, results: np.ndarray, has_std: bool) -> str:
    """Return the problem of the results of a chunk, shape (4, n); empty if there is none."""
    if not np.isfinite(results[:2]).all():
        return "not finite"
    if np.isinf(results[2:]).any() or (has_std and np.isnan(results[2:]).any()):
        return "std not finite"
    if isinstance(estimator, LinearGainEstimator) and not definite(np.array(estimator.covariance)):
        return "not definite"
    return ""


def ours(bank: Bank, samples: Signals) -> dict[str, tuple[str, np.ndarray]]:
    """Return the first problem of each estimator, and b and its standard deviation per sample."""
    faults = dict.fromkeys(bank, "")
    series: dict[str, list[np.ndarray]] = {name: [] for name in bank}
    for first in range(0, LEAD + LASTING, CHUNK):
        part = slice(first, first + CHUNK)
        for name, found in bank.run(*(channel[part] for channel in samples), 1.0 / RATE).items():
            results = np.array([found.b, found.k, found.b_std, found.k_std])
            has_std = bool(series[name]) and math.isfinite(series[name][-1][1, -1])
            problem = fault(bank[name], results, has_std)
            if problem and not faults[name]:
                faults[name] = f"{problem} {first / RATE:.0f} s"
            series[name].append(results[[0, 2]])
    return {name: (faults[name], np.concatenate(series[name], axis=1)) for name in bank}


def peers(samples: Signals) -> tuple[str, np.ndarray]:
    """Return the same as `ours` for padasip, up to the first covariance that is not finite."""
    x, v, f = samples
    peer = padasip.filters.FilterRLS(n=2, mu=0.98, eps=0.01, w="zeros")
    b = np.full(len(f), np.nan)
    indefinite = ""
    for n, row in enumerate(np.column_stack((v, x))):
        peer.adapt(f[n], row)
        b[n] = peer.w[0]
        if n % 100 == 99 and not np.isfinite(peer.R).all():
            return f"not finite {(n + 1) / RATE:.1f} s", np.array([b, np.full(len(f), np.nan)])
        if n % CHUNK == CHUNK - 1 and not (indefinite or definite(peer.R)):
            indefinite = f"not definite {(n + 1) / RATE:.0f} s"
    return indefinite, np.array([b, np.full(len(f), np.nan)])


def swing(series: np.ndarray, samples: int) -> tuple[float, float]:
    """Return the largest change of b in a hold, in standard deviations of b and in N s/m."""
    b, deviation = series[:, LEAD : LEAD + samples]
    change = np.abs(b - series[0, LEAD - 1])
    return float(np.max(change / deviation)), float(np.max(change))


def trial(case: str) -> tuple[dict[str, str], dict[str, list[tuple[float, float]]]]:
    """Return the first problems of each estimator, and the largest changes of its b."""
    samples = signals(case)
    with np.errstate(all="ignore"):
        alone, gated = (ours(bank_of(list(METHODS), gate), samples) for gate in (False, True))
        peer = peers(samples)
    cells = {PEER: peer[0] or "ok"}
    ways = {PEER: [swing(peer[1], length) for length in LENGTHS]}
    for name in METHODS:
        faults = {"alone": alone[name][0], "gated": gated[name][0]}
        cells[name] = "; ".join(f"{run}: {text}" for run, text in faults.items() if text) or "ok"
        found = (alone[name][1], gated[name][1])
        ways[name] = [swing(series, length) for series in found for length in LENGTHS]
    return cells, ways


def hold_row(name: str, ways: list[tuple[float, float]]) -> tuple[str, ...]:
    """Return the row of an estimator in the table of a hold."""
    cells = [f"{way:.3g}" + (f" ({own:.2f})" if own == own else "") for own, way in ways]
    if name == PEER:
        return name, *cells, "", "", ""
    if not bank_of([name])[name].gated:
        return name, *cells, "not gated"
    own = ways[2][0]
    return name, *cells, "no interval" if math.isnan(own) else "ok" if own < 3.0 else "FAILS"


def main() -> None:
    for name in METHODS:
        bank_of([name], gated=True).run(*np.ones((3, 1)), 1e-3)  # compile once
    with ProcessPoolExecutor(2) as pool:
        found = dict(zip(CASES, pool.map(trial, CASES), strict=True))
    names = [*METHODS, PEER]
    show(
        "First fault in ten minutes of each case, the method alone and gated",
        [(name, *(found[case][0][name] for case in CASES)) for name in names],
        ("method", *CASES),
    )
    for case in HOLDS:
        show(
            f"{case}: largest way of b in N s/m (and in its own standard deviations)",
            [hold_row(name, found[case][1][name]) for name in names],
            ("method", "alone, 10 s", "10 min", "gated, 10 s", "10 min", "below 3 in 10 s"),
        )


if __name__ == "__main__":
    main()
