"""Settings of a bank: the paper's own, and settings scaled to the data."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimation.bank import Bank
from estimation.checks import checked_samples
from estimation.gate import Gate, GateSettings
from estimation.method_settings import MethodSettings
from estimation.methods.grid import Axis, Grid
from estimation.registry import METHODS, PAPER, named_estimators

GATE = GateSettings(force=0.1, speed=2e-3, window=0.02)
"""For palpation by hand."""


@dataclass(frozen=True)
class Preset(MethodSettings):
    """Settings of a bank, from which every method has its own.

    `dataclasses.replace(preset, forgetting=0.95)` changes one.
    """

    gate: GateSettings | None = GATE
    """Where estimates hold, but for the paper's; None for nowhere."""
    estimators: tuple[str, ...] = PAPER
    """Names of the estimators, out of `METHODS`."""

    def bank(self) -> Bank:
        """A fresh bank with these settings.

        Raises
        ------
        ValueError
            A setting is out of its range, or a name is none of `METHODS`.
        """
        made = {}
        for name in named_estimators(self.estimators):
            try:
                made[name] = METHODS[name](self)
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from error
        if self.model.further and not any(e.model.further for e in made.values()):
            raise ValueError(f"model {self.model.name}: none of {', '.join(made)} takes it")
        return Bank(made, Gate(self.gate) if self.gate else None)


def paper_preset(cube: str = "soft") -> Preset:
    """The paper's settings: (17), (18) for this cube, (19), beta = 0.98 at 1 kHz, lambda = 10.

    What the paper does not have is the same for all cubes.

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
    stiffness and damping that would explain the whole force alone. Samples count while force
    and speed are above a fiftieth of their root mean squares.

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
    phi, force, periods, _ = checked_samples(x, v, f, dt)
    signals = (phi[:, 1], phi[:, 0], force)
    x_rms, v_rms, f_rms = (math.sqrt(float(np.mean(s**2))) if len(s) else 0.0 for s in signals)
    for what, size in (("displacement", x_rms), ("velocity", v_rms), ("force", f_rms)):
        if size == 0.0:
            raise ValueError(f"nothing to estimate from: the {what} is zero throughout")
    if np.ptp(phi[:, 1]) == 0.0:
        raise ValueError("nothing to estimate from: the displacement is constant")
    b_scale, k_scale = f_rms / v_rms, f_rms / x_rms
    period = float(np.median(periods))
    memory = math.pi * float(np.std(phi[:, 1])) / v_rms
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
        x_size=x_rms,
        v_size=v_rms,
        f_size=f_rms,
        segment=2.0 * memory,
        gate=GateSettings(force=0.02 * f_rms, speed=0.02 * v_rms, window=0.2 * memory),
    )
