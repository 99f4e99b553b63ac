"""Prepare the result of a report page: k and b, whether they can be used, and their true values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from estimation.figures import Truth
from estimation.misfit import LARGEST_MISFIT
from estimation.quantities import DAMPING, STIFFNESS, Quantity
from teleop.output.estimate_tables import interval_table
from teleop.output.result_tables import true_numbers, with_interval


class Value(NamedTuple):
    """k or b on a report page."""

    name: str
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
    k_true = tip_true = b_true = ""
    if true:
        k, k_tip, b, b_tip = true_numbers(true)
        k_true, tip_true = (f"{one} {STIFFNESS.unit}" for one in (k, k_tip))
        b_true = f"{b} {DAMPING.unit} ({b_tip} at the tip)"
    found = [shown(STIFFNESS, "stiffness k", ends(result, "k"), k_reason, k_true)]
    if tip := result["k_tip"]:
        interval = (tip["low"], tip["value"], tip["high"])
        found.append(shown(STIFFNESS, "stiffness k at the tip", interval, "", tip_true))
    found.append(shown(DAMPING, "damping b", ends(result, "b"), result["b_reason"], b_true))
    return found


def ends(result: Mapping[str, Any], part: str) -> tuple[float, float, float] | None:
    """Return lower end, value and upper end of k or b (`part`); None if it is not determined."""
    value = result[part]
    return None if value is None else (result[f"{part}_low"], value, result[f"{part}_high"])


def shown(
    quantity: Quantity,
    name: str,
    interval: tuple[float, float, float] | None,
    reason: str,
    true: str,
) -> Value:
    """Return one value of a result, from the ends of its interval and the value between them."""
    if interval is None:
        return Value(name, "not determined", "", False, reason, true)
    text, _, around = with_interval(quantity, *interval).partition(" (")
    return Value(name, text, around.rstrip(")"), not reason, reason, true)


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
