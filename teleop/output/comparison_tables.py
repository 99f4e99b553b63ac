"""Tables of a comparison: the recordings, their groups, and the analysis of variance."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from teleop.evaluation.comparison import Compared, Group, Mean
from teleop.output.console import plain_console, print_table
from teleop.output.result_tables import with_half
from teleop.output.table_files import shortened

CAPTION = (
    "batch: mean of the results of n recordings. Other rows: mean of the averages of an online "
    "estimator over each record. \u00b1: 95 % interval of the mean, from the spread between the "
    "recordings; for n = 1 that of the recording."
)
"""Text below the table of groups, which explains its rows."""


def group_table(groups: Iterable[Group], by: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    """Return headings and cells of the table of groups, one row per group and method."""
    headings = [*by, "method", "n", "k [N/m]", "b [N s/m]", "e_f [N]"]
    cells = [
        [
            *group.levels,
            method,
            str(means["k"].recordings),
            mean_text(means["k"]),
            mean_text(means["b"]),
            mean_text(means["e_f"]) if "e_f" in means else "-",
        ]
        for group in groups
        for method, means in group.means.items()
    ]
    return headings, cells


def mean_text(mean: Mean) -> str:
    """Return a mean and half of its 95 % interval as text; a dash for a mean that is not finite."""
    if not math.isfinite(mean.value):
        return "-"
    if not math.isfinite(mean.half):
        return f"{mean.value:.4g}" if abs(mean.value) < 1e4 else f"{mean.value:.0f}"
    return with_half(mean.value, mean.half)


def print_comparison(rows: Sequence[Compared], groups: Sequence[Group], by: Sequence[str]) -> None:
    """Print the results of the recordings, and the table of their groups."""
    console = plain_console()
    print_table(
        console,
        "results, with 95 % intervals",
        ("recording", "k [N/m]", "b [N s/m]"),
        [[row.file, result_text(row, "k"), result_text(row, "b")] for row in rows],
    )
    for row in rows:
        if not row.result.identifiable:
            reasons = "; ".join(row.result.reasons)
            console.print(f"  {row.file}: no result: {reasons}", style="yellow")
    headings, cells = group_table(groups, by)
    title = f"by {', '.join(by)}" if by else "all"
    print_table(console, title, headings, shortened(cells, len(by) + 1), len(by) + 1)
    console.print(f"  {CAPTION}")


def result_text(row: Compared, symbol: str) -> str:
    """Return k or b (`symbol`) with half of its 95 % interval as text; a dash for no result."""
    low, value, high = (getattr(row.result, f"{symbol}{end}") for end in ("_low", "", "_high"))
    if value is None:
        return "-"
    return with_half(value, 0.5 * (high - low))


def effect_cells(effects: Iterable[Mapping[str, Any]]) -> list[list[str]]:
    """Return the analysis of variance of one response as text, one row per effect."""
    return [
        [
            effect["source"].replace(" x ", " \N{MULTIPLICATION SIGN} "),
            f"{effect['f']:.1f}",
            f"{effect['degrees']}, {effect['error_degrees']}",
            "< 0.001" if effect["p"] < 0.001 else f"{effect['p']:.3f}",
            f"{effect['eta_squared']:.3f}",
            f"{effect['partial_eta_squared']:.3f}",
        ]
        for effect in effects
    ]


EFFECT_HEADINGS = ("", "F", "df", "p", "eta^2", "partial eta^2")
"""Headings of the table of an analysis of variance."""
