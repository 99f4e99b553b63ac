"""What a trial recorded, tick by tick, as named columns."""

from __future__ import annotations

from array import array
from collections.abc import Iterable

import numpy as np

from estimation.compiled import Floats
from teleop.clock import Tick
from teleop.controller import Record

UNITS = {
    "Time": "s",
    "Displacement": "m",
    "Force": "N",
    "Filtered displacement": "m",
    "Filtered velocity": "m/s",
    "Filtered force": "N",
    "Slave velocity": "m/s",
    "Desired slave velocity": "m/s",
    "Applied slave velocity": "m/s",
    "Master position": "m",
    "Master force": "N",
    "Drive force": "N",
    "Applied master velocity": "m/s",
    "Sample period": "s",
    "Lateness": "s",
    "Overrun": "-",
    "Skipped periods": "-",
    "Excitation": "-",
}
"""Column names and units, in the order in which they are kept."""


def estimate_columns(estimators: Iterable[str]) -> dict[str, str]:
    """Names and units of the columns of each estimator's b and k."""
    return {
        f"{name.upper()} {parameter}": unit
        for name in estimators
        for parameter, unit in (("b", "N s/m"), ("k", "N/m"))
    }


class Log:
    """Grows by a row a tick.

    Parameters
    ----------
    estimators
        Names of the estimators, in the bank's order.
    """

    def __init__(self, estimators: Iterable[str]) -> None:
        self.units = UNITS | estimate_columns(estimators)
        self._rows = array("d")

    def __len__(self) -> int:
        return len(self._rows) // len(self.units)

    def append(self, tick: Tick, record: Record) -> None:
        """Keep one tick."""
        m = record.measurement
        row = [
            record.t,
            m.slave_position,
            m.contact_force,
            record.x,
            record.v,
            record.f,
            m.slave_velocity,
            record.desired.slave_velocity,
            record.applied.slave_velocity,
            m.master_position,
            m.master_force,
            record.drive_force,
            record.applied.master_velocity,
            record.dt,
            tick.lateness,
            tick.overrun,
            tick.skipped,
            record.excitation,
        ]
        for estimate in record.estimates.values():
            row += estimate
        self._rows.extend(row)

    def columns(self) -> dict[str, Floats]:
        """Every column by name, arrays of shape (ticks,)."""
        rows = np.frombuffer(self._rows, dtype=np.float64).reshape(-1, len(self.units))
        return {name: rows[:, i].copy() for i, name in enumerate(self.units)}
