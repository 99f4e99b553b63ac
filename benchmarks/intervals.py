"""Coverage of the 95 % interval: `python benchmarks/intervals.py [--seeds 2000] [--seconds 10]`.

Every method at the end of 10 s of a plant under persistent excitation, with other noise for
each seed. One that gives an interval shall have the truth within 1.96 standard deviations in 93
to 97 % of the seeds, parameter by parameter; one that gives none shall have k within 2 % in
95 %. The plant is Kelvin-Voigt, f = b v + k x; for the Hunt-Crossley methods it is
f = K x^n + B x^n v.
"""

from __future__ import annotations

import argparse
import math
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from bank_case import (
    DEPTH,
    EXPONENT,
    NOISE,
    RATE,
    B,
    K,
    bank_of,
    excitation,
    hunt_crossley,
    hunt_crossley_force,
    show,
)

from estimation import METHODS
from estimation.estimator import LEVEL_95

LINEAR = {"b": B, "k": K}
HUNT_CROSSLEY = {
    "K": K * DEPTH ** (1.0 - EXPONENT),
    "B": B * DEPTH**-EXPONENT,
    "n": EXPONENT,
}


def truth(name: str) -> dict[str, float]:
    return HUNT_CROSSLEY if hunt_crossley(name) else LINEAR


def last_values(seeds: range, seconds: float) -> dict[str, np.ndarray]:
    """Of each method the value and standard deviation of each true parameter, and k's error.

    Arrays of shape (seeds, parameters + 1, 2). The k of the Hunt-Crossley methods is that at the
    last displacement.
    """
    t = np.arange(round(seconds * RATE)) / RATE
    x, v = excitation(t)
    plants = {
        False: (B * v + K * x, K),
        True: (hunt_crossley_force(x, v, B, K), K * (x[-1] / DEPTH) ** (EXPONENT - 1.0)),
    }
    kinds = {
        kind: bank_of([name for name in METHODS if hunt_crossley(name) is kind])
        for kind in plants
        if any(hunt_crossley(name) is kind for name in METHODS)
    }
    found: dict[str, list[list[tuple[float, float]]]] = {name: [] for name in METHODS}
    for seed in seeds:
        noise = np.random.default_rng(seed).normal(0.0, NOISE, len(t))
        for kind, bank in kinds.items():
            force, k = plants[kind]
            bank.reset()
            bank.run(x, v, force + noise, 1.0 / RATE)
            for name, estimator in bank.items():
                values = estimator.values
                share = (values["k"][0] / k - 1.0, math.nan)
                found[name].append([*(values[each] for each in truth(name)), share])
    return {name: np.array(rows) for name, rows in found.items()}


def verdict(name: str, found: np.ndarray) -> tuple[str, ...]:
    """The row of the table."""
    true = truth(name)
    error = np.abs(found[:, : len(true), 0] - list(true.values()))
    deviation = found[:, : len(true), 1]
    off = np.abs(found[:, -1, 0])
    within = float(np.mean(off < 0.02))
    accuracy = (f"{np.sqrt(np.mean(off**2)):.3%}", f"{off.max():.3%}")
    if np.isnan(deviation).all():
        good = within >= 0.95
        return name, *["-"] * 3, *accuracy, f"{within:.1%}", "ok" if good else "FAILS"
    shares = np.mean(error <= LEVEL_95 * deviation, axis=0)
    good = bool(np.all((shares >= 0.93) & (shares <= 0.97)))
    cells = [f"{share:.1%}" for share in shares] + ["-"] * (3 - len(shares))
    return name, *cells, *accuracy, f"{within:.1%}", "ok" if good else "FAILS"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=2000)
    parser.add_argument("--seconds", type=float, default=10.0)
    seeds, seconds = vars(parser.parse_args()).values()
    last_values(range(1), seconds)  # compiles, for the workers to load
    parts = [range(first, seeds, 40) for first in range(min(40, seeds))]
    with ProcessPoolExecutor(2) as pool:
        answers = list(pool.map(partial(last_values, seconds=seconds), parts))
    show(
        f"Coverage of the 95 % interval after {seconds:g} s, {seeds} seeds",
        [verdict(name, np.concatenate([part[name] for part in answers])) for name in METHODS],
        ("method", "b or K", "k or B", "n", "k rms error", "largest", "within 2 %", "verdict"),
    )


if __name__ == "__main__":
    main()
