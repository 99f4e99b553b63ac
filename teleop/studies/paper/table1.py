"""Read the numbers of the paper's Table I: estimated damping and stiffness, and force errors."""

from __future__ import annotations

import csv
from functools import cache
from importlib.resources import files
from typing import NamedTuple

from estimation.quantities import DAMPING, FORCE_ERROR, STIFFNESS
from teleop.names import ConditionName

TABLE_1 = (DAMPING, STIFFNESS, FORCE_ERROR)
"""Columns of Table I."""
ESTIMATORS = ("rls", "ai", "me")
"""Estimators of the paper: recursive least squares, adaptive identification, multi-estimator."""


class Cell(NamedTuple):
    """A cell of the paper's Table I: results of one estimator in one trial.

    A trial has one control condition and one cube. The estimates are averages over the trial.
    """

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


CONDITIONS: tuple[ConditionName, ...] = ("free", "mimic", "autonomous")
"""Control conditions of the paper. Further conditions of the program are no part of its study."""
CALIBRATED = ("free", "autonomous")
"""Conditions for which b and k from RLS were used to calibrate the simulated rig."""


def is_calibrated(condition: str, estimator: str) -> bool:
    """Return whether b and k of a cell of the paper's Table I were used in the calibration.

    The simulated rig is calibrated such that its results agree with these b and k. A cell has one
    control condition, one cube and one estimator. The result is the same for all cubes.
    """
    return estimator == "rls" and condition in CALIBRATED
