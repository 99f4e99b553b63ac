"""What a trial recorded, tick by tick, as named columns."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from estimation.compiled import Floats
from teleop.clock import Tick
from teleop.controller import Record


class Column(NamedTuple):
    """A quantity that is kept of each tick."""

    name: str
    unit: str
    value: Callable[[Tick, Record], float]


COLUMNS = (
    Column("Time", "s", lambda tick, r: r.t),
    Column("Displacement", "m", lambda tick, r: r.measurement.slave_position),
    Column("Force", "N", lambda tick, r: r.measurement.contact_force),
    Column("Filtered displacement", "m", lambda tick, r: r.x),
    Column("Filtered velocity", "m/s", lambda tick, r: r.v),
    Column("Filtered force", "N", lambda tick, r: r.f),
    Column("Slave velocity", "m/s", lambda tick, r: r.measurement.slave_velocity),
    Column("Desired slave velocity", "m/s", lambda tick, r: r.desired.slave_velocity),
    Column("Applied slave velocity", "m/s", lambda tick, r: r.applied.slave_velocity),
    Column("Master position", "m", lambda tick, r: r.measurement.master_position),
    Column("Master force", "N", lambda tick, r: r.measurement.master_force),
    Column("Drive force", "N", lambda tick, r: r.drive_force),
    Column("Applied master velocity", "m/s", lambda tick, r: r.applied.master_velocity),
    Column("Sample period", "s", lambda tick, r: r.dt),
    Column("Lateness", "s", lambda tick, r: tick.lateness),
    Column("Overrun", "-", lambda tick, r: tick.overrun),
    Column("Skipped periods", "-", lambda tick, r: tick.skipped),
    Column("Excitation", "-", lambda tick, r: r.excitation),
)


def estimate_units(estimators: Iterable[str]) -> dict[str, str]:
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
        self.units = {column.name: column.unit for column in COLUMNS}
        self.units |= estimate_units(estimators)
        self._values = [column.value for column in COLUMNS]
        self._rows = array("d")

    def __len__(self) -> int:
        return len(self._rows) // len(self.units)

    def append(self, tick: Tick, record: Record) -> None:
        """Keep one tick."""
        row = [value(tick, record) for value in self._values]
        for estimate in record.estimates.values():
            row += estimate
        self._rows.extend(row)

    def columns(self) -> dict[str, Floats]:
        """Every column by name, arrays of shape (ticks,)."""
        rows = np.frombuffer(self._rows, dtype=np.float64).reshape(-1, len(self.units))
        return {name: rows[:, i].copy() for i, name in enumerate(self.units)}
