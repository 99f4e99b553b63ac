"""Position and force in, estimates out: the way of a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from estimation.bank import Bank
from estimation.checks import checked_samples
from estimation.compiled import Floats
from estimation.conditioning import MatchedFilter, Regression
from estimation.estimate_columns import estimate_arrays, estimate_columns
from estimation.estimator import LEVEL_95, Estimates
from estimation.excitation import dominant_frequency
from estimation.model import model_named
from estimation.presets import Preset, scaled_preset
from estimation.registry import PAPER, named_estimators

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Identification:
    """What the estimators made of a recording."""

    t: Floats
    """Time [s], shape (n,)."""
    regression: Regression
    """What they were given."""
    estimates: dict[str, Estimates]
    """What each said after each sample."""
    bank: Bank
    """The estimators, as they are after the last sample."""
    preset: Preset
    """Their settings."""

    def to_dataframe(self) -> pandas.DataFrame:
        """Signals and estimates, a row for each sample, indexed by time [s].

        Raises
        ------
        ImportError
            pandas is not installed.
        """
        import pandas

        x, v, f, *_ = self.regression
        columns: dict[str, ArrayLike] = {"x": x, "v": v, "f": f}
        arrays = estimate_arrays(self.estimates)
        for column, values in zip(estimate_columns(self.bank), arrays, strict=True):
            columns[column.name] = values == 1.0 if column.name.endswith("_held") else values
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    def plot(self) -> Figure:
        """Stiffness and damping over time with their 95 % intervals, as a matplotlib figure."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8.0, 5.0), layout="constrained")
        for place, parameter, unit in ((1, "k", "N/m"), (2, "b", "N s/m")):
            axes = figure.add_subplot(2, 1, place)
            for name, e in self.estimates.items():
                value, std = getattr(e, parameter), getattr(e, f"{parameter}_std")
                (line,) = axes.plot(self.t, value, label=name, linewidth=1.2)
                low, high = value - LEVEL_95 * std, value + LEVEL_95 * std
                axes.fill_between(self.t, low, high, color=line.get_color(), alpha=0.2, lw=0)
            settled = [getattr(e, parameter)[len(self.t) // 5 :] for e in self.estimates.values()]
            low, high = np.percentile(np.concatenate(settled), (0.5, 99.5))
            margin = 0.3 * (high - low) + 0.05 * max(abs(low), abs(high)) + 1e-12
            axes.set_ylim(low - margin, high + margin)
            axes.set_xlim(self.t[0], self.t[-1])
            axes.set_ylabel(f"{parameter} [{unit}]")
            axes.grid(alpha=0.3)
        figure.axes[0].legend(ncols=4, fontsize="small", frameon=False)
        figure.axes[1].set_xlabel("time [s]")
        return figure


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
    """Condition a recording and run estimators over it.

    Parameters
    ----------
    position
        Displacement from the contact datum [m], shape (n,).
    force
        Interaction force, positive in compression [N], shape (n,).
    dt
        Time since the sample before [s], shape (n,), or one number for all.
    estimators
        Names out of `METHODS`, in a sequence or with commas between, or `all`.
    model
        Name of the model for the estimators that take any, out of `MODELS`.
    bandwidth
        Bandwidth of the matched filter [Hz]; ten times the motion's dominant frequency by
        default.
    force_lag
        Lag of the force channel [s], which is made up for.
    preset
        Settings; scaled from the data by default.

    Raises
    ------
    ValueError
        The shapes differ, a value is not finite, a name is unknown, or nothing moves.

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
