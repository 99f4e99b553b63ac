"""Run estimators of other libraries (the peers) on the same samples."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from filterpy.kalman import KalmanFilter
from padasip.filters import FilterLMS, FilterNLMS, FilterRLS
from river.linear_model import BayesianLinearRegression, LinearRegression
from river.optim import SGD
from statsmodels.regression.recursive_ls import RecursiveLS
from statsmodels.regression.rolling import RollingOLS

from estimation import paper_preset

Peer = tuple[str, Callable[[], object]]
"""Name of the estimator with the same or similar equations, and a function that runs the peer."""


def peers(x: np.ndarray, v: np.ndarray, f: np.ndarray) -> dict[str, Peer]:
    """Return the peers by name; all except those of statsmodels process one sample at a time."""
    phi = np.column_stack((v, x))
    rows = [row.reshape(1, 2) for row in phi]
    named = [{"v": a, "x": b} for a, b in phi.tolist()]
    forces = f.tolist()

    def kalman(alpha: float, process_noise: float) -> None:
        peer = KalmanFilter(dim_x=2, dim_z=1)
        peer.P *= 100.0
        peer.Q *= process_noise
        peer.alpha = alpha
        for force, row in zip(f, rows, strict=True):
            peer.predict()
            peer.update(force, H=row)

    def padasip(kind: type, mu: float) -> None:
        peer = kind(n=2, mu=mu, w="zeros")
        for force, row in zip(f, phi, strict=True):
            peer.adapt(force, row)

    def river(peer: LinearRegression | BayesianLinearRegression) -> None:
        for force, row in zip(forces, named, strict=True):
            peer.learn_one(row, force)

    def lattice() -> None:
        grid = paper_preset().grid
        b, k = (a.ravel() for a in np.meshgrid(grid.b.values, grid.k.values, indexing="ij"))
        signal = np.zeros(b.size)
        for force, (speed, depth) in zip(f, phi, strict=True):
            error = b * speed + k * depth - force
            signal *= 0.98
            signal += 1e-3 * error * error
            signal.argmin()

    fading = math.sqrt(1.0 / 0.98)
    return {
        "padasip FilterRLS": ("rls", lambda: padasip(FilterRLS, 0.98)),
        "filterpy KalmanFilter, fading": ("rls", lambda: kalman(fading, 0.0)),
        "river BayesianLinearRegression": (
            "rls",
            lambda: river(BayesianLinearRegression(smoothing=0.98)),
        ),
        "statsmodels RecursiveLS": ("rls", lambda: RecursiveLS(f, phi).fit()),
        "padasip FilterLMS": ("ai", lambda: padasip(FilterLMS, 0.1)),
        "river LinearRegression, SGD": (
            "ai",
            lambda: river(LinearRegression(SGD(0.1), intercept_lr=0.0)),
        ),
        "padasip FilterNLMS": ("ai_normalised", lambda: padasip(FilterNLMS, 0.1)),
        "filterpy KalmanFilter": ("kalman", lambda: kalman(1.0, 1.0)),
        "statsmodels RollingOLS": ("window", lambda: RollingOLS(f, phi, window=200).fit()),
        "numpy, all 7913 candidates": ("me", lattice),
    }
