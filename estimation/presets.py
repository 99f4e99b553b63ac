"""Define the settings of a bank of estimators: those of the paper, or computed from the data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from estimation.bank import Bank
from estimation.checks import checked_samples
from estimation.gate import Gate, GateSettings
from estimation.method_settings import MethodSettings
from estimation.methods.grid import Axis, Grid
from estimation.own_settings import OwnSettings, with_own_settings
from estimation.registry import METHODS, PAPER, named_estimators

GATE = GateSettings(force=0.1, speed=2e-3, window=0.02)
"""Settings of the default contact gate. They are chosen for palpation by hand."""


@dataclass(frozen=True)
class Preset(MethodSettings):
    """Settings that all estimators of a bank share.

    Use `dataclasses.replace(preset, forgetting=0.95)` to change a setting.
    """

    gate: GateSettings | None = GATE
    """Settings of the contact gate; None for no gate. The paper's estimators have no gate."""
    estimators: tuple[str, ...] = PAPER
    """Names of the estimators, keys of `METHODS`."""
    own: Mapping[str, OwnSettings] = field(default_factory=dict)
    """Settings that replace the shared settings for one estimator, by the name of the estimator."""

    def bank(self) -> Bank:
        """Return a new bank with these settings.

        Raises
        ------
        ValueError
            A setting is out of its range, a name is not in `METHODS`, or no estimator supports the
            model. The message has one line for each estimator that cannot be constructed.
        """
        for name in self.own:
            named_estimators([name])
        estimators = {}
        problems = []
        for name in named_estimators(self.estimators):
            try:
                estimators[name] = with_own_settings(name, METHODS[name], self, self.own)
            except ValueError as error:
                problems.append(f"{name}: {error}")
        if problems:
            raise ValueError("\n".join(problems))
        if self.model.further and not any(e.model.further for e in estimators.values()):
            raise ValueError(
                f"model {self.model.name}: none of {', '.join(estimators)} supports it"
            )
        return Bank(estimators, Gate(self.gate) if self.gate else None)

    def for_depth(self, depth: float, usual: float) -> Preset:
        """Return the settings, with the adaptation gain changed for another depth of palpation.

        The rate of convergence remains the same. This rate is proportional to the gain and to the
        square of the depth.

        Parameters
        ----------
        depth
            Depth of the palpation [m].
        usual
            Depth for which the present gain was chosen [m].
        """
        scale = (usual / depth) ** 2
        gain_b, gain_k = self.adaptation_gain
        return replace(self, adaptation_gain=(scale * gain_b, scale * gain_k))


def paper_preset(cube: str = "soft") -> Preset:
    """Return the settings of the paper.

    The settings are those of equations (17) to (19). The forgetting factor is 0.98 per sample at
    1 kHz. The forgetting rate of the multi-estimator is 10 1/s. The adaptation gain of equation
    (18) depends on the cube. All other settings are the same for all cubes.

    Parameters
    ----------
    cube
        `soft`, `medium` or `hard`.

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
    """Return settings that are computed from the data. The data may have any amplitude and speed.

    The time constant of forgetting is half a period of the dominant oscillation. This is the
    shortest time in which damping and stiffness can be distinguished. The grid of the
    multi-estimator has 10^8 candidates. b is between -3 f_rms / v_rms and 3 f_rms / v_rms, and k is
    between 0 and 3 f_rms / x_rms. x_rms, v_rms and f_rms are the root mean squares of displacement,
    velocity and force in the data. The gate is open while the force exceeds 2 % of f_rms and the
    speed exceeds 2 % of v_rms.

    Parameters
    ----------
    x, v, f
        Displacement [m], velocity [m/s], force [N], each of shape (n,).
    dt
        Time since the previous sample [s], of shape (n,), or one number for all.

    Raises
    ------
    ValueError
        As in `Estimator.run`; or there is no motion or no force.
    """
    phi, force, periods, _ = checked_samples(x, v, f, dt)
    signals = (phi[:, 1], phi[:, 0], force)
    x_rms, v_rms, f_rms = (math.sqrt(float(np.mean(s**2))) if len(s) else 0.0 for s in signals)
    for what, size in (("displacement", x_rms), ("velocity", v_rms), ("force", f_rms)):
        if size == 0.0:
            raise ValueError(f"cannot estimate: the {what} is zero in all samples")
    if np.ptp(phi[:, 1]) == 0.0:
        raise ValueError("cannot estimate: the displacement is constant")
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
