"""Show results with estimates as figures, tables and short texts, in Python and in notebooks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Protocol

from numpy.typing import ArrayLike

from estimation.bank import Bank
from estimation.compiled import Floats
from estimation.conditioning import Regression
from estimation.estimate_columns import estimate_arrays, estimate_columns
from estimation.estimator import LEVEL_95, Estimates
from estimation.least_squares import least_squares, no_fit

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from estimation.figures import Truth

LISTED = 3
"""Largest number of estimators that a text of one line names."""


class HasEstimates(Protocol):
    """Attributes that the methods of `Presented` use."""

    @property
    def t(self) -> Floats:
        """Time [s], shape (n,)."""

    @property
    def regression(self) -> Regression:
        """The n samples that the estimators processed."""

    @property
    def estimates(self) -> Mapping[str, Estimates]:
        """Estimates after each sample, by the name of the estimator."""

    @property
    def bank(self) -> Bank:
        """The estimators."""

    @property
    def about(self) -> str:
        """Short description of the object."""


class Presented:
    """Base class of results with estimates. It provides figures, a table and short texts.

    A derived class must have the attributes of `HasEstimates`.
    """

    @property
    def about(self: HasEstimates) -> str:
        """Short description: number of samples and duration."""
        return f"{len(self.t)} samples, {self.t[-1] - self.t[0]:.3g} s"

    def plot(
        self: HasEstimates, width: str = "screen", title: str = "", truth: Truth | None = None
    ) -> Figure:
        """Return a figure of stiffness, damping and motion over time, with 95 % intervals.

        The motion is not drawn if there are too many estimators for one panel.

        Parameters
        ----------
        width
            `screen`, `a4`, or `single` or `double` for one or two columns of an IEEE paper.
        title
            Title of the figure.
        truth
            True values of the simulated rig; None if they are not known.
        """
        from estimation.figure_style import figure_style
        from estimation.figures import estimates_figure

        x, v, *_ = self.regression
        with figure_style(width):
            return estimates_figure(title, self.t, x, v, self.estimates, truth)

    def plot_force(self: HasEstimates, width: str = "screen", title: str = "") -> Figure:
        """Return a figure of the measured force, and of its prediction by the first estimator.

        In the panel over displacement, the force is compared with a batch least-squares fit.

        Parameters
        ----------
        width, title
            As in `plot`.
        """
        from estimation.figure_style import figure_style
        from estimation.force_figure import force_figure

        name, first = next(iter(self.estimates.items()))
        x, v, f, _, further = self.regression
        fit = no_fit(*further.shape) if first.held.all() else least_squares(x, v, f, further)
        with figure_style(width):
            return force_figure(title, self.t, self.regression, name, first, fit)

    def to_dataframe(self: HasEstimates) -> pandas.DataFrame:
        """Return a table of signals and estimates with one row per sample. The index is time [s].

        Raises
        ------
        ImportError
            pandas is not installed.
        """
        import pandas

        x, v, f, *_ = self.regression
        columns: dict[str, ArrayLike] = {"x": x, "v": v, "f": f}
        arrays = estimate_arrays(dict(self.estimates))
        for column, values in zip(estimate_columns(self.bank), arrays, strict=True):
            columns[column.name] = values == 1.0 if column.name.endswith("_held") else values
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    def __repr__(self: HasEstimates) -> str:
        """Return one line of text with the estimates after the last sample."""
        return short_text(type(self).__name__, self.about, self.estimates)

    def _repr_html_(self: HasEstimates) -> str:
        return html_table(self.about, self.estimates)


def value_text(value: float, std: float) -> str:
    """Return the text of a value and the half width of its 95 % interval.

    Both have the same number of decimals, from 0 to 6. Within this range, the half width has two
    significant digits.

    Parameters
    ----------
    value
        The value.
    std
        Standard deviation of the value. If it is not a positive number, the text has no half
        width.
    """
    half = LEVEL_95 * std
    if not math.isfinite(half) or half <= 0.0:
        return f"{value:.4g}"
    decimals = min(max(1 - math.floor(math.log10(half)), 0), 6)
    return f"{value:.{decimals}f} \u00b1 {half:.{decimals}f}"


def last_values(estimates: Mapping[str, Estimates]) -> list[tuple[str, str, str]]:
    """Return name, stiffness [N/m] and damping [N s/m] of each estimator, as texts.

    The values are the estimates after the last sample, or the text `no estimate` if no sample
    changed the estimate.
    """
    found = []
    for name, e in estimates.items():
        k = b = "no estimate"
        if not e.held.all():
            k, b = value_text(e.k[-1], e.k_std[-1]), value_text(e.b[-1], e.b_std[-1])
        found.append((name, k, b))
    return found


def short_text(kind: str, about: str, estimates: Mapping[str, Estimates]) -> str:
    """Return one line of text with the estimates after the last sample, for `__repr__`.

    Parameters
    ----------
    kind
        Name of the class of the object.
    about
        Short description of the object.
    estimates
        Estimates by name of the estimator. Only the first `LISTED` estimators are in the text.
    """
    rows = last_values(estimates)
    texts = [
        f"{name} no estimate" if k == b == "no estimate" else f"{name} k = {k} N/m, b = {b} N s/m"
        for name, k, b in rows[:LISTED]
    ]
    if len(rows) > LISTED:
        texts.append(f"{len(rows) - LISTED} further estimators")
    return f"{kind}({'; '.join([about, *texts])})"


def html_table(about: str, estimates: Mapping[str, Estimates]) -> str:
    """Return an HTML table with the estimates after the last sample, for `_repr_html_`.

    Parameters
    ----------
    about
        Caption of the table.
    estimates
        Estimates by name of the estimator.
    """
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td>{k}</td><td>{b}</td></tr>"
        for name, k, b in last_values(estimates)
    )
    return (
        f"<table><caption>{escape(about)}; estimates at the end, \u00b1 95 % interval</caption>"
        f"<thead><tr><th></th><th>k [N/m]</th><th>b [N s/m]</th></tr></thead>"
        f"<tbody>{rows}</tbody></table>"
    )
