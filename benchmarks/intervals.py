"""Measure the coverage of the 95 % intervals: `python benchmarks/intervals.py [--seeds 2000]`.

Every estimator runs on 10 s of a plant with persistent excitation, with different noise for each
seed. The last estimate is evaluated. For an estimator with an interval, each true parameter should
be within 1.96 standard deviations of the estimate for 93 to 97 % of the seeds. For an estimator
without an interval, k should be within 2 % of the true k for 95 % of the seeds. The plant is a
Kelvin-Voigt body, f = b v + k x. For the Hunt-Crossley estimators, it is a Hunt-Crossley body,
f = K x^n + B x^n v.

The noise is white. With `--noise-time TAU`, it is coloured: an autoregressive process of first
order, whose autocorrelation decreases by the factor e in the time TAU [s].
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
from scipy.signal import lfilter

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


def force_noise(seed: int, count: int, time: float) -> np.ndarray:
    """Return the noise of the force [N], with the correlation time `time` [s]; 0 is white noise."""
    rng = np.random.default_rng(seed)
    if time == 0.0:
        return rng.normal(0.0, NOISE, count)
    before = round(5.0 * time * RATE)  # the process is then stationary
    decay = math.exp(-1.0 / (time * RATE))
    white = rng.normal(0.0, NOISE * math.sqrt(1.0 - decay * decay), count + before)
    return np.asarray(lfilter([1.0], [1.0, -decay], white)[before:])


def last_values(seeds: range, seconds: float, time: float = 0.0) -> dict[str, np.ndarray]:
    """Return the value and standard deviation of each parameter, and the relative error of k.

    For each estimator, the array has the shape (seeds, parameters + 1, 2). The k of the
    Hunt-Crossley estimators is the value at the last displacement.
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
        noise = force_noise(seed, len(t), time)
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
    """Return the row of an estimator in the table."""
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
    parser.add_argument("--noise-time", type=float, default=0.0)
    seeds, seconds, time = vars(parser.parse_args()).values()
    last_values(range(1), seconds)  # compile once; the workers load the result
    parts = [range(first, seeds, 40) for first in range(min(40, seeds))]
    with ProcessPoolExecutor(2) as pool:
        results = list(pool.map(partial(last_values, seconds=seconds, time=time), parts))
    noise = f", noise with the correlation time {time:g} s" if time else ""
    show(
        f"Coverage of the 95 % interval after {seconds:g} s, {seeds} seeds{noise}",
        [verdict(name, np.concatenate([part[name] for part in results])) for name in METHODS],
        ("method", "b or K", "k or B", "n", "k rms error", "largest", "within 2 %", "verdict"),
    )


if __name__ == "__main__":
    main()
