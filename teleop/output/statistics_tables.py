"""Tables of statistical tests and of the repeatability of results."""

from __future__ import annotations

from collections.abc import Sequence

from teleop.evaluation.across.mixed_model import MixedModel
from teleop.evaluation.across.response import RESPONSES
from teleop.output.console import small
from teleop.output.table_files import TextTable

SMALLEST_P = 0.001
"""Smallest p value that is shown as a number."""


def p_text(p: float) -> str:
    """Return a p value as text."""
    return f"< {SMALLEST_P:g}" if p < SMALLEST_P else f"{p:.3f}"


def effects_on_result_table(model: MixedModel, symbol: str, notes: Sequence[str]) -> TextTable:
    """Return the table of the tests, with one row for each effect."""
    headings = (f"effect on {symbol}", "F", "df", "p", "partial eta^2")
    rows = [
        [
            one.source.replace(" x ", " \N{MULTIPLICATION SIGN} "),
            f"{one.f:.1f}" if one.f < 1000.0 else f"{one.f:.0f}",
            f"{one.degrees}, {one.error_degrees}",
            p_text(one.p),
            f"{one.partial_eta_squared:.3f}",
        ]
        for one in model.effects
    ]
    return TextTable(headings, rows, 1, [("", text) for text in notes])


def measures_table(
    symbol: str, measures: Sequence[tuple[str, Sequence[float], str]], notes: Sequence[str]
) -> TextTable:
    """Return the table of repeatability; a measure has a name, value, low and high, and a unit."""
    quantity = RESPONSES[symbol]
    rows = []
    for name, interval, unit in measures:
        shown = [quantity.shown(value) if unit else value for value in interval]
        label = f"{name} [{quantity.unit}]" if unit else name
        rows.append([label, *(small(value) for value in shown)])
    headings = (f"repeatability of {symbol}", "value", "low", "high")
    return TextTable(headings, rows, 1, [("", text) for text in notes])
