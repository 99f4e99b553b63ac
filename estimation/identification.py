"""Estimate damping and stiffness from arrays of position and force, for example in a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from estimation.arrays import Floats
from estimation.bank import Bank
from estimation.checks import checked_samples
from estimation.conditioning import MatchedFilter, Regression
from estimation.estimator import Estimates
from estimation.excitation import dominant_frequency
from estimation.model import model_named
from estimation.presentation import Presented
from estimation.presets import Preset, scaled_preset
from estimation.registry import PAPER, named_estimators


@dataclass(frozen=True, repr=False)
class Identification(Presented):
    """Result of `identify`: the filtered signals and the estimates of damping and stiffness."""

    t: Floats
    """Time [s], shape (n,)."""
    regression: Regression
    """Filtered signals that the estimators processed."""
    estimates: dict[str, Estimates]
    """Estimates after each sample, by the name of the estimator."""
    bank: Bank
    """The estimators, in their state after the last sample."""
    preset: Preset
    """Settings of the estimators."""


def identify(
    position: ArrayLike,
    force: ArrayLike,
    dt: ArrayLike,
    estimators: str | Sequence[str] = PAPER,
    model: str = "kelvin-voigt",
    bandwidth: float | None = None,
    force_lag: float = 0.0,
    preset: Preset | None = None,
) -> Identification:
    """Filter recorded position and force, and estimate damping and stiffness.

    Parameters
    ----------
    position
        Displacement from the contact point, positive in compression [m], shape (n,).
    force
        Interaction force, positive in compression [N], shape (n,).
    dt
        Time since the previous sample [s], shape (n,), or one number for all samples.
    estimators
        Names of estimators (`METHODS`), as a sequence or as one string with commas between the
        names. `all` selects all estimators.
    model
        Name of a model (`MODELS`). Estimators that support only one model ignore this name.
    bandwidth
        Natural frequency [Hz] of the low-pass filter of position and force (`MatchedFilter`).
        Default: ten times the dominant frequency of the motion.
    force_lag
        Time constant [s] of the first-order lag with which the force was measured; 0 for no lag.
        The filter compensates this lag.
    preset
        Settings of the estimators. Default: the result of `scaled_preset` for the filtered signals.

    Raises
    ------
    ValueError
        The shapes differ, a value is not finite or too large, a `dt` is not positive, a name is
        unknown, or there is no motion.

    Examples
    --------
    >>> import numpy as np
    >>> from estimation import identify
    >>> t = np.arange(0.0, 5.0, 1e-3)
    >>> x = 4e-3 - 3e-3 * np.cos(2 * np.pi * t)
    >>> found = identify(x, 2100 * x + 15 * np.gradient(x, t), 1e-3, ["rls"])
    >>> round(found.estimates["rls"].k[-1])
    2100
    """
    names = named_estimators(estimators)
    chosen = model_named(model)
    samples = checked_samples(position, position, force, dt)
    if bandwidth is None:
        bandwidth = 10.0 * dominant_frequency(samples.phi[:, 0], samples.dt)
    conditioner = MatchedFilter(bandwidth, force_lag, chosen)
    regression = conditioner.run(position, force, dt)
    x, v, f, periods, _ = regression
    if preset is None:
        preset = replace(
            scaled_preset(x, v, f, periods),
            correlation=conditioner.correlation(float(np.median(periods))),
        )
    preset = replace(preset, model=chosen, estimators=names)
    bank = preset.bank()
    t = np.cumsum(periods) - periods[0]
    return Identification(t, regression, bank.run(*regression), bank, preset)
