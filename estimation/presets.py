"""Define the settings of the estimators: those of the paper, or settings computed from data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from estimation.bank import Bank
from estimation.checks import check_size, checked_samples
from estimation.gate import Gate, GateSettings
from estimation.method_settings import SIZES, MethodSettings, OwnSettings
from estimation.methods.grid import Axis, Grid
from estimation.registry import METHODS, PAPER, named_estimators

GATE = GateSettings(force=0.1, speed=2e-3, window=0.02)
"""Settings of the default contact gate, chosen for palpation by hand.

The estimates change only while the gate is open, which means during contact and motion.
"""


@dataclass(frozen=True)
class Preset(MethodSettings):
    """Settings of a bank (a group of estimators that process the same samples).

    Use `dataclasses.replace(preset, forgetting=0.95)` to change a setting.
    """

    gate: GateSettings | None = GATE
    """Settings of the contact gate; None for no gate. The paper's estimators do not use the gate.

    The estimates change only while the gate is open, which means during contact and motion.
    """
    estimators: tuple[str, ...] = PAPER
    """Names of the estimators. `METHODS` contains all names."""
    own: Mapping[str, OwnSettings] = field(default_factory=dict)
    """Own settings of an estimator, which replace the shared settings; by name of the estimator."""

    def bank(self) -> Bank:
        """Construct the estimators with these settings, and return them as a new `Bank`.

        Raises
        ------
        ValueError
            A setting is out of its range, a name of an estimator is not in `METHODS`, or no
            estimator supports the model. If several estimators cannot be constructed, the message
            has one line for each of them.
        """
        for name in SIZES:
            check_size(name, getattr(self, name))
        for name in self.own:
            named_estimators([name])
        estimators = {}
        problems = []
        for name in named_estimators(self.estimators):
            try:
                own = self.own.get(name, OwnSettings())
                estimator = METHODS[name](replace(self, **own.stated))
                own.refuse_unused(estimator.used_settings)
                estimators[name] = estimator
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
        """Return the same settings with an adaptation gain for another depth of palpation.

        The gain is multiplied by (usual / depth)^2. The estimates of adaptive identification then
        converge as fast as before, because the rate of convergence is proportional to the gain and
        to the square of the depth.

        Parameters
        ----------
        depth
            New depth of the palpation [m].
        usual
            Depth [m] for which the gain in these settings was chosen.
        """
        scale = (usual / depth) ** 2
        gain_b, gain_k = self.adaptation_gain
        return replace(self, adaptation_gain=(scale * gain_b, scale * gain_k))


def paper_preset(cube: str = "soft") -> Preset:
    """Return the settings of the paper.

    The values are those of equations (17) to (19) of the paper. The forgetting factor is 0.98 per
    sample at 1 kHz. The forgetting rate of the multi-estimator is 10 1/s. The adaptation gain of
    equation (18) depends on the specimen. All other settings are the same for all specimens.

    Parameters
    ----------
    cube
        Specimen of the paper: the `soft`, `medium` or `hard` cube.

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
    """Compute the settings of the estimators from a recording of any amplitude and speed.

    Let x_rms, v_rms and f_rms be the root mean squares of displacement, velocity and force.

    - The time constant of forgetting is half a period of the dominant oscillation. This is the
      shortest time in which damping and stiffness can be distinguished.
    - The multi-estimator has a grid of 10^8 candidates (b, k). b is between -3 f_rms / v_rms and
      3 f_rms / v_rms, and k is between 0 and 3 f_rms / x_rms.
    - The contact gate is open while the force exceeds 2 % of f_rms and the speed exceeds 2 % of
      v_rms. The estimates change only while the gate is open.

    Parameters
    ----------
    x, v, f
        Displacement [m], velocity [m/s], force [N], each of shape (n,).
    dt
        Time since the previous sample [s], of shape (n,), or one number for all.

    Raises
    ------
    ValueError
        The shapes differ, a value is not finite or too large, a `dt` is not positive, or there is
        no motion or no force.
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
