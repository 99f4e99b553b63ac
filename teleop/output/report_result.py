"""Prepare the result of a report page: k and b, whether they can be used, and their true values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from estimation.figures import Truth
from estimation.misfit import LARGEST_MISFIT
from estimation.quantities import DAMPING, STIFFNESS, Quantity
from teleop.output.console import small
from teleop.output.estimate_tables import interval_table
from teleop.output.result_tables import with_interval

DIGITS = 5
"""Number of significant digits of a true value."""


class Value(NamedTuple):
    """k or b on a report page."""

    name: str
    symbol: str
    value: str
    """Value with its unit, or "not determined"."""
    interval: str
    """The 95 % interval; empty if it is not known."""
    usable: bool
    reason: str
    """Reason why the value cannot be used; empty if it can."""
    true: str
    """True value with its unit; empty if it is not known."""


def values_of(result: Mapping[str, Any], true: Mapping[str, float] | None) -> list[Value]:
    """Return stiffness, stiffness at the tip (if it is known), and damping of a result."""
    k_reason = "" if result["identifiable"] else next(iter(result["reasons"]), "")
    found = [shown(STIFFNESS, STIFFNESS.name, "k", result, k_reason, true)]
    if tip := result["k_tip"]:
        ends = {"k_tip": tip["value"], "k_tip_low": tip["low"], "k_tip_high": tip["high"]}
        found.append(shown(STIFFNESS, f"{STIFFNESS.name} at the tip", "k_tip", ends, "", true))
    found.append(shown(DAMPING, DAMPING.name, "b", result, result["b_reason"], true))
    return found


def shown(
    quantity: Quantity,
    name: str,
    key: str,
    result: Mapping[str, Any],
    reason: str,
    true: Mapping[str, float] | None,
) -> Value:
    """Return one value of a result; `key` is its name in the result and in the true values."""
    value, low, high = (result[f"{key}{end}"] for end in ("", "_low", "_high"))
    text, interval = "not determined", ""
    if value is not None:
        text, _, interval = with_interval(quantity, low, value, high).partition(" (")
    known = f"{small(quantity.shown(true[key]), DIGITS)} {quantity.unit}" if true else ""
    usable = value is not None and not reason
    return Value(name, quantity.symbol, text, interval.rstrip(")"), usable, reason, known)


class EstimateRow(NamedTuple):
    """Final estimates of an online estimator on a report page."""

    cells: list[str]
    misfits: bool
    """Whether the misfit is too large: the estimates then cannot be used."""


def estimate_rows(
    rows: Mapping[str, Mapping[str, Any]], truth: Truth | None
) -> tuple[list[str], list[EstimateRow]]:
    """Return headings and rows of the table of the final estimates, with the true values below."""
    headings, cells = interval_table(rows)
    found = [
        EstimateRow(texts, row["misfit"] > LARGEST_MISFIT)
        for texts, row in zip(cells, rows.values(), strict=True)
    ]
    if truth:
        k = " to ".join(STIFFNESS.number(one) for one in sorted({truth.k_surface, truth.k_deepest}))
        empty = [""] * (len(headings) - 3)
        found.append(EstimateRow(["true", k, DAMPING.number(truth.b), *empty], False))
    return headings, found
