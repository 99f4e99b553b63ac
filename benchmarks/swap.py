"""Measure how fast estimators follow a change of the cube: `python benchmarks/swap.py`.

The cube changes from soft to hard, and back. For every estimator with a gate and with forgetting, k
should be within 5 % of the true value again after 0.3 s. The motion is a sine of 3 Hz. The changes
occur at several phases of this sine. The Hunt-Crossley estimators run on a Hunt-Crossley plant. At
the mean depth, the k of this plant is that of the cube. The estimate is compared with the true k at
the present depth.
"""

from __future__ import annotations

import math

import numpy as np
from bank_case import (
    DEPTH,
    EXPONENT,
    NOISE,
    RATE,
    B,
    bank_of,
    hunt_crossley,
    hunt_crossley_force,
    show,
)

from estimation import METHODS
from sim_backend import CUBES

PAIRS = {
    "2000 and 20000 N/m": (2000.0, 20_000.0),
    "the rig's soft and hard, {:.0f} and {:.0f} N/m".format(CUBES["soft"].k1, CUBES["hard"].k1): (
        CUBES["soft"].k1,
        CUBES["hard"].k1,
    ),
}
FREQUENCY = 3.0
PHASES = 24
LASTING = 2.0
"""Duration of each of the three phases soft, hard and soft [s]."""
ALLOWED = 0.3
"""Longest time after a change until k should be within 5 % again [s]."""
NOT_FORGETTING = ("segments",)
"""Estimators that use all samples. The paper's estimators forget, but have no gate."""


def recoveries(soft: float, hard: float, phase: float) -> dict[str, tuple[float, float]]:
    """Return the time until k stays within 5 % after each of the two changes [s]."""
    t = np.arange(round(3 * LASTING * RATE)) / RATE
    omega = 2.0 * math.pi * FREQUENCY
    x = DEPTH + 3e-3 * np.sin(omega * t + phase)
    v = 3e-3 * omega * np.cos(omega * t + phase)
    k = np.where((t >= LASTING) & (t < 2 * LASTING), hard, soft)
    noise = np.random.default_rng(0).normal(0.0, NOISE, len(t))
    plants = {
        False: (B * v + k * x, k),
        True: (hunt_crossley_force(x, v, B, k), k * (x / DEPTH) ** (EXPONENT - 1.0)),
    }
    found = {}
    for name in METHODS:
        force, true = plants[hunt_crossley(name)]
        estimates = bank_of([name], gated=True).run(x, v, force + noise, 1.0 / RATE)[name]
        off = np.abs(estimates.k / true - 1.0) > 0.05
        swaps = np.split(off, 3)[1:]
        up, down = (np.flatnonzero(part)[-1] + 1 if part.any() else 0 for part in swaps)
        length = len(swaps[0])
        found[name] = tuple(n / RATE if n < length else math.inf for n in (up, down))
    return found


def verdict(name: str, seconds: np.ndarray) -> tuple[str, ...]:
    """Return the row of an estimator in the table; `seconds` has the shape (phases, 2)."""
    median, worst = np.median(seconds, axis=0), np.max(seconds, axis=0)
    cells = [f"{value:.3f}" for pair in zip(median, worst, strict=True) for value in pair]
    good = worst.max() <= ALLOWED
    if name not in NOT_FORGETTING and bank_of([name])[name].gated:
        return name, *cells, "ok" if good else "FAILS"
    reason = "does not forget" if name in NOT_FORGETTING else "not gated"
    return name, *cells, f"{'within' if good else 'not within'}, {reason}"


def main() -> None:
    for title, (soft, hard) in PAIRS.items():
        trials = [recoveries(soft, hard, 2.0 * math.pi * n / PHASES) for n in range(PHASES)]
        show(
            f"Seconds to within 5 % of k after a swap, {title}, {PHASES} phases",
            [verdict(name, np.array([trial[name] for trial in trials])) for name in METHODS],
            ("method", "to hard: median", "worst", "to soft: median", "worst", "in 0.3 s"),
        )


if __name__ == "__main__":
    main()
