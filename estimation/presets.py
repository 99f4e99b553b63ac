"""Settings of the paper's three estimators: the paper's own, and settings scaled to the data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from estimation.adaptive_identification import AdaptiveIdentification
from estimation.bank import Bank
from estimation.estimator import checked_samples
from estimation.multi_estimator import Axis, Grid, MultiEstimator
from estimation.recursive_least_squares import RecursiveLeastSquares


@dataclass(frozen=True)
class Preset:
    """Settings of the bank of `rls`, `ai` and `me`.

    `dataclasses.replace(preset, forgetting=0.95)` changes one. The units and ranges are those
    of the estimators' parameters of the same names.
    """

    forgetting: float
    sample_period: float
    initial_covariance: tuple[float, float]
    adaptation_gain: tuple[float, float]
    ai_method: Literal["rk4", "exact"]
    grid: Grid
    forgetting_rate: float

    def bank(self) -> Bank:
        """A fresh bank with these settings; ValueError for one out of its range."""
        return Bank(
            {
                "rls": RecursiveLeastSquares(
                    self.forgetting, self.initial_covariance, self.sample_period
                ),
                "ai": AdaptiveIdentification(self.adaptation_gain, self.ai_method),
                "me": MultiEstimator(self.grid, self.forgetting_rate),
            }
        )


def paper_preset(cube: str = "soft") -> Preset:
    """The paper's settings: (17), (18) for this cube, (19), beta = 0.98 at 1 kHz, lambda = 10.

    Raises
    ------
    ValueError
        The cube is not soft, medium or hard.
    """
    gains = {"soft": (2000.0, 1.2e5), "medium": (5000.0, 5.0e5), "hard": (50000.0, 1.0e7)}
    if cube not in gains:
        raise ValueError(f"cube must be one of {', '.join(gains)}, got {cube!r}")
    return Preset(
        forgetting=0.98,
        sample_period=1e-3,
        initial_covariance=(100.0, 100.0),
        adaptation_gain=gains[cube],
        ai_method="rk4",
        grid=Grid(b=Axis(-500.0, 500.0, 41), k=Axis(1500.0, 39900.0, 193)),
        forgetting_rate=10.0,
    )


def scaled_preset(x: ArrayLike, v: ArrayLike, f: ArrayLike, dt: ArrayLike) -> Preset:
    """Settings for data of any size and speed, scaled from the data itself.

    The memory is half a period of the motion's dominant oscillation, the shortest that shows
    damping and stiffness apart. The multi-estimator gets 10^8 candidates, to three times the
    stiffness and damping that would explain the whole force alone.

    Parameters
    ----------
    x, v, f
        Displacement [m], velocity [m/s], force [N], each of shape (n,).
    dt
        Time since the sample before [s], of shape (n,), or one number for all.

    Raises
    ------
    ValueError
        As `Estimator.run`; or there is no motion or no force.
    """
    x, v, f, dt = checked_samples(x, v, f, dt)
    x_rms, v_rms, f_rms = (math.sqrt(float(np.mean(s**2))) if len(s) else 0.0 for s in (x, v, f))
    for what, size in (("displacement", x_rms), ("velocity", v_rms), ("force", f_rms)):
        if size == 0.0:
            raise ValueError(f"nothing to estimate from: the {what} is zero throughout")
    if np.ptp(x) == 0.0:
        raise ValueError("nothing to estimate from: the displacement is constant")
    b_scale, k_scale = f_rms / v_rms, f_rms / x_rms
    period = float(np.median(dt))
    memory = math.pi * float(np.std(x)) / v_rms
    return Preset(
        forgetting=math.exp(-period / memory),
        sample_period=period,
        initial_covariance=(1e4 / v_rms**2, 1e4 / x_rms**2),
        adaptation_gain=(4.0 / (memory * v_rms**2), 4.0 / (memory * x_rms**2)),
        ai_method="exact",
        grid=Grid(
            b=Axis(-3.0 * b_scale, 3.0 * b_scale, 10_001), k=Axis(0.0, 3.0 * k_scale, 10_001)
        ),
        forgetting_rate=0.5 / memory,
    )
