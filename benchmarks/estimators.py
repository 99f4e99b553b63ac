"""Measure the time per sample of estimators and peers: `python benchmarks/estimators.py`.

The peers are estimators of other libraries. Each number is the shortest time of many short
repetitions, because the machine is shared. All estimators together should take less than 1 us per
sample in compiled code, and less than 60 us in interpreted code. The benchmark requires the extras
`fast`, `test` and `dev`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import replace

import numpy as np
from bank_case import bank_of, show
from bank_peers import peers

from estimation import METHODS, Axis, Bank, Estimator, Grid, paper_preset
from estimation.checks import checked_samples
from estimation.compiled import compiled_sweep, interpreted_sweep

RATE = 1000.0
ROUNDS = 3
"""Repetitions of the whole series, because the load of the machine varies."""
Costs = Mapping[str, tuple[float, float, float]]
"""Time per sample in compiled code, in interpreted code, and of `update` [s], by estimator name."""


def palpation(samples: int) -> tuple[np.ndarray, ...]:
    """Return x, v and f of one palpation per second on a soft cube, with noise."""
    rng = np.random.default_rng(0)
    t = np.arange(samples) / RATE
    x = 5e-3 - 4e-3 * np.cos(2 * np.pi * t) + 0.05e-3 * np.sin(2 * np.pi * 9.7 * t)
    v = np.gradient(x, t)
    f = 5.0 * v + (2000.0 + 3e6 * x**2) * x + rng.normal(0.0, 0.02, samples)
    return x, v, f


def per_sample(run: Callable[[], object], samples: int, repeats: int = 9) -> float:
    """Return the shortest time per sample of several repetitions [s], after one unmeasured run."""
    run()
    best = math.inf
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        best = min(best, time.perf_counter() - start)
    return best / samples


def swept(
    sweep: Callable[..., object], estimator: Estimator, samples: int, repeats: int = 9
) -> float:
    """Return the time per sample of a sweep [s]. Each repetition starts from the same state."""
    given = estimator.step_samples(checked_samples(*palpation(samples), 1.0 / RATE))
    law, state = estimator.law, estimator.state
    return per_sample(lambda: sweep(law, deepcopy(state), given), samples, repeats)


def updated(update: Callable[..., object], samples: int = 600) -> float:
    """Return the time of one call of `update` [s]."""
    rows = np.column_stack((*palpation(samples), np.full(samples, 1.0 / RATE))).tolist()

    def run() -> None:
        for row in rows:
            update(*row)

    return per_sample(run, samples, repeats=25)


def costs(estimator: Estimator) -> tuple[float, float, float]:
    return (
        swept(compiled_sweep, estimator, 50_000),
        swept(interpreted_sweep, estimator, 1000, repeats=27),
        updated(estimator.update),
    )


def bank_costs(bank: Bank, samples: int = 50_000) -> tuple[float, float]:
    """Return the time per sample of `Bank.run` and of `Bank.update` [s]."""
    x, v, f = palpation(samples)
    run = per_sample(lambda: bank.run(x, v, f, 1.0 / RATE), samples)
    return run, updated(bank.update)


def cost_table(found: Costs) -> None:
    rows = [
        (name, f"{c * 1e9:.0f}", f"{i * 1e6:.2f}", f"{u * 1e6:.2f}")
        for name, (c, i, u) in found.items()
    ]
    c, i, u = np.sum(list(found.values()), axis=0)
    rows.append(("together", f"{c * 1e9:.0f}", f"{i * 1e6:.1f}", f"{u * 1e6:.1f}"))
    rows.append(
        (
            "below 1 us, 60 us",
            *("ok" if cost < most else "FAILS" for cost, most in ((c, 1e-6), (i, 60e-6))),
            "",
        )
    )
    for gated in (False, True):
        run, update = bank_costs(bank_of(list(METHODS), gated))
        kind = "Bank.run, Bank.update" + (", gated" if gated else "")
        rows.append((kind, f"{run * 1e9:.0f}", "", f"{update * 1e6:.1f}"))
    show(
        f"A sample by each of {len(found)} methods",
        rows,
        ("method", "compiled [ns]", "interpreted [us]", "update() [us]"),
    )


def peer_table(found: Costs, samples: int = 2000) -> None:
    rows = []
    for peer, (name, run) in peers(*palpation(samples)).items():
        if name in found:
            cost = per_sample(run, samples, repeats=5)
            ratios = (f"{cost / each:.{0 if each < 1e-6 else 1}f}" for each in found[name])
            rows.append((peer, f"{cost * 1e6:.1f}", name, *ratios))
    show(
        "A sample by peers, and how many times ours",
        rows,
        ("peer", "cost [us]", "ours", "compiled", "interpreted", "update()"),
    )


def growth_table() -> None:
    rows = []
    paper = paper_preset()
    for where, b_last in (("inside the grid", 500.0), ("outside of it", -20.0)):
        for nb, nk in ((41, 193), (1001, 1001), (10_001, 10_001)):
            k = paper.grid.k
            grid = Grid(b=Axis(-500.0, b_last, nb), k=Axis(k.first, k.last, nk))
            compiled, interpreted, _ = costs(METHODS["me"](replace(paper, grid=grid)))
            rows.append(
                (where, f"{grid.candidates:,}", f"{compiled * 1e9:.0f}", f"{interpreted * 1e6:.1f}")
            )
    show(
        "Multi-estimator, a sample, with the true parameters inside the grid and outside",
        rows,
        ("truth", "candidates", "compiled [ns]", "interpreted [us]"),
    )


def main() -> None:
    bank = bank_of(list(METHODS))
    rounds = [[costs(estimator) for estimator in bank.values()] for _ in range(ROUNDS)]
    found = dict(zip(bank, map(tuple, np.min(rounds, axis=0).tolist()), strict=True))
    cost_table(found)
    peer_table(found)
    growth_table()


if __name__ == "__main__":
    main()
