"""Read the numbers of the paper's Table I."""

from __future__ import annotations

import csv
from functools import cache
from importlib.resources import files
from typing import NamedTuple

ESTIMATORS = ("rls", "ai", "me")


class Cell(NamedTuple):
    """A cell of Table I: average estimates and force error of one estimator in one trial."""

    b: float
    """Damping [N s/m]."""
    k: float
    """Stiffness [N/m]."""
    e_f: float
    """Average force error [N]."""


@cache
def table1() -> dict[tuple[str, str, str], Cell]:
    """Return the 27 cells of the paper's Table I, by (condition, cube, estimator)."""
    text = files(__package__).joinpath("table1.csv").read_text(encoding="utf-8")
    return {
        (row["condition"], row["cube"], row["estimator"]): Cell(
            float(row["b"]), float(row["k"]), float(row["e_f"])
        )
        for row in csv.DictReader(text.splitlines())
    }


CALIBRATED = ("free", "autonomous")
"""Conditions for which b and k from RLS were used to calibrate the simulated rig."""


def is_calibrated(condition: str, estimator: str) -> bool:
    """Return whether b and k of a cell were used to calibrate the simulated rig."""
    return estimator == "rls" and condition in CALIBRATED
