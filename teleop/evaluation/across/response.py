"""Collect one quantity of the results of recordings, with the errors that their intervals state."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from estimation.quantities import DAMPING, STIFFNESS
from teleop.errors import InputError
from teleop.evaluation.across.comparison import RESULT, Compared, values_of
from teleop.evaluation.across.means import Value

TIP = "k_tip"
"""Name of the stiffness at the tip. k is that of specimen and transmission in series."""
RESPONSES = {"k": STIFFNESS, TIP: replace(STIFFNESS, name="stiffness at the tip"), "b": DAMPING}
"""Quantities of a result that can be analysed, by their names."""
IN_SERIES = (
    f"k is that of specimen and transmission in series; {TIP} is that of the specimen at the tip."
)


class Responses(NamedTuple):
    """Values of a quantity from the results of recordings, shape (n,) each."""

    rows: list[Compared]
    """The recordings."""
    values: Floats
    """Stiffnesses [N/m] or dampings [N s/m], or the natural logarithms of these."""
    std: Floats
    """Standard deviations of the errors, from the 95 % intervals, in the unit of the values."""
    notes: list[str]
    """Sentences on recordings that are left out, or whose value cannot be used alone."""


def responses(rows: Sequence[Compared], symbol: str, logarithm: bool = False) -> Responses:
    """Return a quantity of `RESPONSES` (`symbol`) of the recordings that determine it.

    Values of different kinds are different physical quantities. Only those of the most frequent
    kind are returned. With `logarithm`, the natural logarithms are returned, for a spread that is
    proportional to the value.

    Raises InputError if no recording has a value, or for the logarithm of a negative value.
    """
    found = [(row, value_of(row, symbol)) for row in rows]
    known = [(row, value) for row, value in found if value]
    if not known:
        raise InputError(f"no recording has a result with {symbol}")
    notes = []
    if missing := len(found) - len(known):
        notes.append(f"Without {symbol}, and left out: {missing} of {len(found)} recordings.")
    kinds = Counter(value.kind for _, value in known)
    kind, count = kinds.most_common(1)[0]
    if len(kinds) > 1:
        others = ", ".join(f"{number} with the kind {name}" for name, number in kinds.items())
        notes.append(
            f"The values of {symbol} are different quantities ({others}): only the {count} of the "
            f"kind {kind} are used."
        )
        known = [(row, value) for row, value in known if value.kind == kind]
    if symbol == "k" and any(row.result.k_tip for row, _ in known):
        notes.append(IN_SERIES)
    if symbol == "b" and (unusable := sum(bool(row.result.b_reason) for row, _ in known)):
        notes.append(
            f"The b of {unusable} of {len(known)} recordings cannot be used alone: see their "
            "remarks. An error that all recordings have, such as a lag of the force, is not in the "
            "intervals."
        )
    values = np.array([value.value for _, value in known])
    std = np.array([value.half for _, value in known]) / LEVEL_95
    if logarithm:
        if not values.min() > 0.0:
            low = min(known, key=lambda one: one[1].value)[0]
            raise InputError(
                f"--log: {symbol} of {low.file} is {values.min():.4g}: expected positive values"
            )
        values, std = np.log(values), std / values
    return Responses([row for row, _ in known], values, std, notes)


def value_of(row: Compared, symbol: str) -> Value | None:
    """Return a quantity of the result of a recording; None if it is not determined."""
    if symbol != TIP:
        return values_of(row, RESULT).get(symbol)
    tip = row.result.k_tip
    return Value(tip.value, 0.5 * (tip.high - tip.low), row.result.kinds["k"]) if tip else None
