"""Ten minutes of what upsets estimators: `python benchmarks/robustness.py`.

Each case is 5 s of persistent excitation, so that there is something to lose, and then 600 000
samples at 1 kHz. Every method runs alone and behind the preset's gate; never shall a
value or a deviation be NaN or infinite, nor a covariance not positive definite, looked at after
every 1000 samples. The peer is padasip's FilterRLS with the same forgetting.

In a hold, the probe rests at 5 mm. Position has white noise and velocity is its difference
behind a low-pass of 20 Hz. At 0.1 um padasip's b swings by hundreds; 3 um is a poor encoder.
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
CHUNK = 1000
HOLDS = {"hold, 0.1 um": 0.1e-6, "hold, 3 um": 3e-6}
SCALED = {
    "x in um": (1e6, 1.0),
    "x in km": (1e-3 * 1e-3, 1.0),
    "f in uN": (1.0, 1e6),
    "f in MN": (1.0, 1e-6),
}
"""Factors of x and v, and of f."""
CASES = ("zero", *HOLDS, "constant v", "outliers", *SCALED)
PEER = "padasip RLS"
Signals = tuple[np.ndarray, np.ndarray, np.ndarray]


def signals(case: str) -> Signals:
    """Displacement, velocity and force, of shape (LEAD + LASTING,)."""
    rng = np.random.default_rng(0)
    t = np.arange(LEAD + LASTING) / RATE
    after = slice(LEAD, None)
    noise = rng.normal(0.0, NOISE, len(t))
    x, v = excitation(t)
    if case in HOLDS:
        stop = np.clip((LEAD / RATE - t) / 0.2, 0.0, 1.0)
        x = DEPTH + stop**2 * (3.0 - 2.0 * stop) * (x - DEPTH)
        f = B * np.gradient(x, t) + K * x + noise
        measured = x + rng.normal(0.0, HOLDS[case], len(t))
        return measured, FilteredDifference(20.0).run(measured, f, 1.0 / RATE).v, f
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
    for channel, factor in zip((x, v, f), np.repeat(SCALED.get(case, (1.0, 1.0)), (2, 1))):
        channel[after] *= factor
    return x, v, f


def definite(covariance: np.ndarray) -> bool:
    """Whether variances are positive and correlations below 1."""
    variances = np.diag(covariance)
    if not (np.isfinite(covariance).all() and (variances > 0.0).all()):
        return False
    deviations = np.sqrt(variances)
    correlations = covariance / deviations / deviations[:, None]
    return bool(np.all(np.abs(correlations[~np.eye(len(variances), dtype=bool)]) < 1.0))


def fault(estimator: Estimator, answers: np.ndarray, gives: bool) -> str:
    """What is wrong after a chunk, if anything."""
    if not np.isfinite(answers[:2]).all():
        return "not finite"
    if np.isinf(answers[2:]).any() or (gives and np.isnan(answers[2:]).any()):
        return "std not finite"
    if isinstance(estimator, LinearGainEstimator) and not definite(np.array(estimator.covariance)):
        return "not definite"
    return ""


def ours(bank: Bank, samples: Signals) -> dict[str, tuple[str, np.ndarray]]:
    """Of each method the first fault, and b and its deviation after each sample."""
    faults = dict.fromkeys(bank, "")
    series: dict[str, list[np.ndarray]] = {name: [] for name in bank}
    for first in range(0, LEAD + LASTING, CHUNK):
        part = slice(first, first + CHUNK)
        for name, found in bank.run(*(channel[part] for channel in samples), 1.0 / RATE).items():
            answers = np.array([found.b, found.k, found.b_std, found.k_std])
            gives = bool(series[name]) and math.isfinite(series[name][-1][1, -1])
            what = fault(bank[name], answers, gives)
            if what and not faults[name]:
                faults[name] = f"{what} {first / RATE:.0f} s"
            series[name].append(answers[[0, 2]])
    return {name: (faults[name], np.concatenate(series[name], axis=1)) for name in bank}


def peers(samples: Signals) -> tuple[str, np.ndarray]:
    """The same of padasip, until its covariance is not finite or not definite."""
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


def swing(series: np.ndarray, samples: int) -> tuple[str, str]:
    """Largest way of b from where the hold began, in its deviations and in N s/m."""
    b, deviation = series[:, LEAD : LEAD + samples]
    way = np.abs(b - series[0, LEAD - 1])
    if np.isnan(b).any():
        return "-", f"{np.nanmax(way):.3g}, then NaN"
    own = "-" if np.isnan(deviation).any() else f"{np.max(way / deviation):.2f}"
    return own, f"{way.max():.3g}"


def trial(case: str) -> tuple[dict[str, str], dict[str, tuple[str, ...]]]:
    """Each method's cell of the first table, and its row of the hold's."""
    samples = signals(case)
    with np.errstate(all="ignore"):
        alone, gated = (ours(bank_of(list(METHODS), gate), samples) for gate in (False, True))
        peer = peers(samples)
    cells = {name: f"{alone[name][0] or 'ok'} / {gated[name][0] or 'ok'}" for name in METHODS} | {
        PEER: peer[0] or "ok"
    }
    rows = {
        name: tuple(
            cell
            for _, series in found
            for length in (10_000, LASTING)
            for cell in swing(series, length)
        )
        for name, found in [(n, (alone[n], gated[n])) for n in METHODS] + [(PEER, (peer,))]
    }
    return cells, rows


def main() -> None:
    for name in METHODS:
        bank_of([name], gated=True).run(*np.ones((3, 1)), 1e-3)  # compiles, for the workers to load
    with ProcessPoolExecutor(2) as pool:
        found = dict(zip(CASES, pool.map(trial, CASES), strict=True))
    names = [*METHODS, PEER]
    show(
        "First fault in ten minutes of each case, the method alone / behind the gate",
        [(name, *(found[case][0][name] for case in CASES)) for name in names],
        ("method", *CASES),
    )
    for case in HOLDS:
        rows = [(name, *found[case][1][name]) for name in names]
        show(
            f"Largest way of b in a {case}, in its own standard deviations and in N s/m",
            [(*row, *[""] * (9 - len(row))) for row in rows],
            (
                "method",
                *(
                    f"{who}, {t}{u}"
                    for who in ("alone", "gated")
                    for t in ("10 s", "10 min")
                    for u in ("", " [N s/m]")
                ),
            ),
        )


if __name__ == "__main__":
    main()
