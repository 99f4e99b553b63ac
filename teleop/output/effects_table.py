"""Create the table of an analysis of variance (ANOVA) of the results of several trials."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from teleop.output.table_files import TextTable


def effects_table(effects: Iterable[Mapping[str, Any]], response: str, design: str) -> TextTable:
    """Return the table of an analysis of variance, with one row for each effect."""
    headings = (f"effect on {response}", "F", "df", "p", "eta^2", "partial eta^2")
    return TextTable(headings, effect_cells(effects), 1, [("", design)])


def effect_cells(effects: Iterable[Mapping[str, Any]]) -> list[list[str]]:
    """Return the text of the cells of the table of `effects_table`, one row for each effect.

    The columns are the name of the factor, F, the degrees of freedom, p, eta^2 and partial eta^2.
    """
    return [
        [
            effect["source"].replace(" x ", " \N{MULTIPLICATION SIGN} "),
            f"{effect['f']:.1f}" if effect["f"] < 1000.0 else f"{effect['f']:.0f}",
            f"{effect['degrees']}, {effect['error_degrees']}",
            "< 0.001" if effect["p"] < 0.001 else f"{effect['p']:.3f}",
            f"{effect['eta_squared']:.3f}",
            f"{effect['partial_eta_squared']:.3f}",
        ]
        for effect in effects
    ]
