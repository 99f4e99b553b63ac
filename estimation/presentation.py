"""Show estimates of stiffness and damping as figures, tables and short texts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Protocol

from numpy.typing import ArrayLike

from estimation.arrays import Floats
from estimation.bank import Bank
from estimation.batch_fit import least_squares, no_fit
from estimation.conditioning import Regression
from estimation.estimate_columns import estimate_arrays, estimate_columns
from estimation.estimator import LEVEL_95, Estimates
from estimation.quantities import DAMPING, STIFFNESS, Quantity
from telepalpation import needs

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from estimation.figures import Truth

LISTED = 3
"""Largest number of estimators in the text of one line that `short_text` returns."""


class HasEstimates(Protocol):
    """Attributes that a class must have so that it can use the methods of `Presented`."""

    @property
    def t(self) -> Floats:
        """Time [s], shape (n,)."""

    @property
    def regression(self) -> Regression:
        """The n samples that the estimators processed: x, v, f, dt and further regressors."""

    @property
    def estimates(self) -> Mapping[str, Estimates]:
        """Estimates of stiffness and damping after each sample, by the name of the estimator."""

    @property
    def bank(self) -> Bank:
        """The estimators, by name."""

    @property
    def about(self) -> str:
        """Short description of the data, for example the number of samples and the duration."""


class Presented:
    """Base class of results that contain estimates. Its methods return figures, tables and texts.

    A derived class must have the attributes that are listed in `HasEstimates`.
    """

    @property
    def about(self: HasEstimates) -> str:
        """Short description of the data: number of samples and duration."""
        return f"{len(self.t)} samples, {self.t[-1] - self.t[0]:.3g} s"

    def plot(
        self: HasEstimates, width: str = "screen", title: str = "", truth: Truth | None = None
    ) -> Figure:
        """Return a figure of the estimated stiffness and damping, and of the motion, over time.

        The 95 % confidence intervals are also drawn. If there are more than five estimators, each
        estimator has its own panels. In this case the motion (displacement and velocity) is not
        drawn.

        Parameters
        ----------
        width
            Name of the width of the figure: `screen`, `a4`, `single` (one column of an IEEE paper)
            or `double` (two columns).
        title
            Title of the figure.
        truth
            True stiffness and damping of a simulated specimen, which are also drawn; None if they
            are not known.
        """
        from estimation.figure_style import figure_style
        from estimation.figures import estimates_figure

        x, v, *_ = self.regression
        with figure_style(width):
            return estimates_figure(title, self.t, x, v, self.estimates, truth)

    def plot_force(self: HasEstimates, width: str = "screen", title: str = "") -> Figure:
        """Return a figure of the measured force and the force that the first estimator predicts.

        Both forces are drawn over time. A further panel shows the measured force over displacement,
        and a least-squares fit of the model to all samples.

        Parameters
        ----------
        width
            Name of the width of the figure: `screen`, `a4`, `single` (one column of an IEEE paper)
            or `double` (two columns).
        title
            Title of the figure.
        """
        from estimation.figure_style import figure_style
        from estimation.figures import force_figure

        name, first = next(iter(self.estimates.items()))
        x, v, f, _, further = self.regression
        fit = no_fit(*further.shape) if first.held.all() else least_squares(x, v, f, further)
        with figure_style(width):
            return force_figure(title, self.t, self.regression, name, first, fit)

    def to_dataframe(self: HasEstimates) -> pandas.DataFrame:
        """Return a table of signals and estimates with one row per sample.

        The signals are `x` [m], `v` [m/s] and `f` [N]. The index of the table is the time [s].

        Raises
        ------
        ImportError
            pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise ImportError(needs("a data frame", "pandas", "notebook")) from error

        x, v, f, *_ = self.regression
        columns: dict[str, ArrayLike] = {"x": x, "v": v, "f": f}
        arrays = estimate_arrays(dict(self.estimates))
        for column, values in zip(estimate_columns(self.bank), arrays, strict=True):
            columns[column.name] = values == 1.0 if column.name.endswith("_held") else values
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    def __repr__(self: HasEstimates) -> str:
        """Return one line of text with the class name and the estimates after the last sample."""
        return short_text(type(self).__name__, self.about, self.estimates)

    def _repr_html_(self: HasEstimates) -> str:
        return html_table(self.about, self.estimates)


def value_text(quantity: Quantity, value: float, std: float) -> str:
    """Return an SI value and the half width of its 95 % interval as text, in the shown unit.

    Both numbers have the same number of decimals. It is chosen such that the half width has two
    significant digits, but is limited to the range from 0 to 6.
    If `std` is not a positive finite number, the text contains only the value.
    """
    value, half = quantity.shown(value), quantity.shown(LEVEL_95 * std)
    if not math.isfinite(half) or half <= 0.0:
        return f"{value:.4g}"
    decimals = min(max(1 - math.floor(math.log10(half)), 0), 6)
    return f"{value:.{decimals}f} \u00b1 {half:.{decimals}f}"


def last_values(estimates: Mapping[str, Estimates]) -> list[tuple[str, str, str]]:
    """Return the name and the last estimates of stiffness and damping as texts.

    There is one tuple (name, stiffness, damping) for each estimator. If no sample changed the
    estimate, the text `no estimate` replaces stiffness and damping.
    """
    found = []
    for name, e in estimates.items():
        k = b = "no estimate"
        if not e.held.all():
            k = value_text(STIFFNESS, e.k[-1], e.k_std[-1])
            b = value_text(DAMPING, e.b[-1], e.b_std[-1])
        found.append((name, k, b))
    return found


def short_text(kind: str, about: str, estimates: Mapping[str, Estimates]) -> str:
    """Return one line of text with the estimates after the last sample, for `__repr__`.

    Only the first `LISTED` estimators are in the text.
    """
    rows = last_values(estimates)
    texts = [
        f"{name} no estimate"
        if k == b == "no estimate"
        else f"{name} k = {k} {STIFFNESS.unit}, b = {b} {DAMPING.unit}"
        for name, k, b in rows[:LISTED]
    ]
    if len(rows) > LISTED:
        texts.append(f"{len(rows) - LISTED} further estimators")
    return f"{kind}({'; '.join([about, *texts])})"


def html_table(about: str, estimates: Mapping[str, Estimates]) -> str:
    """Return an HTML table with the estimates after the last sample, for `_repr_html_`."""
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td>{k}</td><td>{b}</td></tr>"
        for name, k, b in last_values(estimates)
    )
    return (
        f"<table><caption>{escape(about)}; estimates at the end, \u00b1 95 % interval</caption>"
        f"<thead><tr><th></th><th>{STIFFNESS.heading}</th><th>{DAMPING.heading}</th></tr></thead>"
        f"<tbody>{rows}</tbody></table>"
    )
