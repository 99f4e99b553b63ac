"""Cost of a sample, ours and peers', in one run: `python benchmarks/estimators.py`.

Each figure is the fastest of several repeats, since the machine is shared. Needs the extras
`fast`, `test` and `dev`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import padasip
from filterpy.kalman import KalmanFilter
from rich.console import Console
from rich.table import Table

from estimation import Axis, Estimator, Grid, paper_preset
from estimation.compiled import compiled, interpreted

RATE = 1000.0


def palpation(samples: int) -> tuple[np.ndarray, ...]:
    """Pokes of a second on a soft cube, with noise: v, x, f, dt."""
    rng = np.random.default_rng(0)
    t = np.arange(samples) / RATE
    x = 5e-3 - 4e-3 * np.cos(2 * np.pi * t) + 0.05e-3 * np.sin(2 * np.pi * 9.7 * t)
    v = np.gradient(x, t)
    f = 5.0 * v + (2000.0 + 3e6 * x**2) * x + rng.normal(0.0, 0.02, samples)
    return v, x, f, np.full(samples, 1.0 / RATE)


def per_sample(run: Callable[[], object], samples: int, repeats: int = 7) -> float:
    """Seconds a sample, the fastest of several repeats after one to warm up."""
    run()
    best = math.inf
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        best = min(best, time.perf_counter() - start)
    return best / samples


def compiled_cost(estimator: Estimator, samples: int = 50_000) -> float:
    sweep = compiled(type(estimator).step, estimator.helpers)
    signals = palpation(samples)
    return per_sample(lambda: sweep(estimator.parameters, estimator.state, *signals), samples)


def interpreted_cost(estimator: Estimator, samples: int = 3000) -> float:
    signals = palpation(samples)
    step = type(estimator).step
    return per_sample(
        lambda: interpreted(step, estimator.parameters, estimator.state, signals), samples
    )


def update_cost(estimator: Estimator, samples: int = 3000) -> float:
    rows = [
        (float(x), float(v), float(f), float(dt))
        for v, x, f, dt in zip(*palpation(samples), strict=True)
    ]

    def run() -> None:
        for row in rows:
            estimator.update(*row)

    return per_sample(run, samples)


def numpy_bank_cost(samples: int = 2000) -> float:
    grid = paper_preset().grid
    b, k = (a.ravel() for a in np.meshgrid(grid.b.values, grid.k.values, indexing="ij"))
    v, x, f, _ = palpation(samples)

    def run() -> None:
        monitoring = np.zeros(b.size)
        decay, weight = math.exp(-0.02), (1.0 - math.exp(-0.02)) / 20.0
        for n in range(samples):
            error = b * v[n] + k * x[n] - f[n]
            monitoring *= decay
            monitoring += weight * error * error
            monitoring.argmin()

    return per_sample(run, samples, repeats=3)


def padasip_cost(samples: int = 3000) -> float:
    v, x, f, _ = palpation(samples)
    regressors = np.column_stack((v, x))

    def run() -> None:
        peer = padasip.filters.FilterRLS(n=2, mu=0.98, eps=0.01, w="zeros")
        for n in range(samples):
            peer.adapt(f[n], regressors[n])

    return per_sample(run, samples, repeats=3)


def filterpy_cost(samples: int = 2000) -> float:
    v, x, f, _ = palpation(samples)
    rows = [np.array([[a, b]]) for a, b in zip(v, x, strict=True)]

    def run() -> None:
        peer = KalmanFilter(dim_x=2, dim_z=1)
        peer.P *= 100.0
        peer.Q *= 0.0
        peer.alpha = math.sqrt(1.0 / 0.98)
        for n in range(samples):
            peer.predict()
            peer.update(f[n], H=rows[n])

    return per_sample(run, samples, repeats=3)


def show(title: str, rows: list[tuple[str, ...]], headings: tuple[str, ...]) -> None:
    table = Table(title=title, title_justify="left")
    for i, heading in enumerate(headings):
        table.add_column(heading, justify="right" if i else "left")
    for row in rows:
        table.add_row(*row)
    Console(markup=False).print(table)


def main() -> None:
    bank = paper_preset("soft").bank()
    rows = []
    total = np.zeros(3)
    for name, estimator in bank.items():
        costs = np.array(
            [compiled_cost(estimator), interpreted_cost(estimator), update_cost(estimator)]
        )
        total += costs
        rows.append(
            (name, f"{costs[0] * 1e9:.0f}", f"{costs[1] * 1e6:.1f}", f"{costs[2] * 1e6:.1f}")
        )
    rows.append(
        ("all three", f"{total[0] * 1e9:.0f}", f"{total[1] * 1e6:.1f}", f"{total[2] * 1e6:.1f}")
    )
    show(
        "Ours, a sample",
        rows,
        ("estimator", "compiled [ns]", "interpreted [us]", "update() [us]"),
    )

    rls_costs, me_costs = (
        (compiled_cost(bank[name]), interpreted_cost(bank[name])) for name in ("rls", "me")
    )
    peers = []
    for name, cost, ours in (
        ("numpy bank of 7913", numpy_bank_cost(), me_costs),
        ("padasip FilterRLS", padasip_cost(), rls_costs),
        ("filterpy KalmanFilter", filterpy_cost(), rls_costs),
    ):
        peers.append((name, f"{cost * 1e6:.1f}", f"{cost / ours[0]:.0f}", f"{cost / ours[1]:.1f}"))
    show(
        "Peers, a sample, and how many times ours",
        peers,
        ("peer", "cost [us]", "ours compiled", "ours interpreted"),
    )

    growth = []
    paper = paper_preset()
    for where, b_last in (("inside the grid", 500.0), ("outside of it", -20.0)):
        for nb, nk in ((41, 193), (1001, 1001), (10_001, 10_001)):
            grid = Grid(
                b=Axis(-500.0, b_last, nb),
                k=Axis(paper.grid.k.first, paper.grid.k.last, nk),
            )
            me = replace(paper, grid=grid).bank()["me"]
            growth.append(
                (
                    where,
                    f"{grid.candidates:,}",
                    f"{compiled_cost(me) * 1e9:.0f}",
                    f"{interpreted_cost(me) * 1e6:.1f}",
                )
            )
    show(
        "Multi-estimator, a sample, with the true parameters inside the grid and outside",
        growth,
        ("truth", "candidates", "compiled [ns]", "interpreted [us]"),
    )


if __name__ == "__main__":
    main()
