"""Draw the agreement of two levels of a factor (Bland-Altman plot)."""

from __future__ import annotations

from matplotlib.figure import Figure

from estimation.figure_style import BLUE, GREY, common_legend, new_figure, tidy
from teleop.evaluation.across.agreement import Agreement
from teleop.evaluation.across.response import RESPONSES
from teleop.output.figure_files import plain


def agreement_figure(found: Agreement, symbol: str, over: str, is_ratio: bool = False) -> Figure:
    """Return a figure of the difference over the mean of the two values of each object.

    Horizontal lines are the bias and the limits of agreement, with their 95 % intervals. With
    `is_ratio`, ratios are drawn instead of differences.
    """
    quantity = RESPONSES[symbol]
    figure = new_figure(0.6)
    axes = figure.subplots()
    factor = 1.0 if is_ratio else quantity.factor
    axes.plot(
        [quantity.shown(value) for value in found.means],
        [factor * value for value in found.differences],
        "o",
        color=BLUE,
        markersize=4.0,
        alpha=0.8,
        label="object",
    )
    for line, style, text in (
        (found.bias, "-", "bias"),
        (found.lower, "--", "limits of agreement"),
        (found.upper, "--", ""),
    ):
        axes.axhline(
            factor * line.value, color="#000000", linestyle=style, linewidth=1.2, label=text or "_"
        )
        axes.axhspan(
            factor * line.low,
            factor * line.high,
            color=GREY,
            alpha=0.2,
            linewidth=0,
            label="95 % interval" if text == "bias" else "_",
        )
    first, second = (plain(f"{over} = {level}") for level in found.columns)
    kind = "geometric mean" if is_ratio else "mean"
    axes.set_xlabel(f"{kind} of {quantity.name} [{quantity.unit}]")
    if is_ratio:
        axes.set_ylabel(f"ratio ({second} / {first})")
    else:
        axes.set_ylabel(f"difference ({second} minus {first}) [{quantity.unit}]")
    tidy(axes, "y")
    common_legend(figure, figure.axes)
    return figure
