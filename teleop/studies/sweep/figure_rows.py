"""Read those rows of a sweep's table of results that are shown in a figure."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from estimation.quantities import RESULTS as QUANTITIES
from teleop.errors import InputError
from teleop.output.sweep_figures import SweepRows
from teleop.studies.series.table import RESULTS
from teleop.studies.sweep.tasks import ESTIMATOR


def read_rows(path: Path, factors: Sequence[str], response: str) -> SweepRows:
    """Return those rows of a table of results that contain a value of the result `response`.

    Parameters
    ----------
    path
        The table results.csv of a sweep.
    factors
        Names of the factors (the settings that vary in the sweep).
    response
        The result that the figure shows: a key of `RESULTS`, such as `k`.

    Raises
    ------
    InputError
        No row contains this result.
    """
    heading = RESULTS[response]
    with path.open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if math.isfinite(float(row[heading] or "nan"))]
    if not rows:
        raise InputError(f"{path}: no point has a value of {heading}: nothing to plot")
    # The table has SI units, the figure the unit in which the quantity is shown.
    quantity = QUANTITIES.get(response)
    return SweepRows(
        {name: values_of([row[name] for row in rows]) for name in factors},
        np.array([row[ESTIMATOR] for row in rows]),
        np.array([float(row[heading]) for row in rows]) * (quantity.factor if quantity else 1.0),
        quantity.heading if quantity else heading,
    )


def values_of(cells: Sequence[str]) -> Sequence[float] | Sequence[str]:
    """Return the values of a column as numbers, or as texts if one of them is not a number."""
    try:
        return [float(cell) for cell in cells]
    except ValueError:
        return cells
