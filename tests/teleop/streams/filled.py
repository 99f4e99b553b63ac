"""Streams that tests fill without a control loop."""

from __future__ import annotations

import math
from time import monotonic

import numpy as np

from drivers import STANDSTILL, Ages, Measurement
from teleop.control.alignment import Pair
from teleop.control.clock import ON_TIME
from teleop.control.tick_record import Record, Timing
from teleop.safety import Mode
from teleop.streams.stream import Stream

NAN = math.nan
NO_TIME = Timing(0.0, 0.0, 0.0)


def record_at(t, position=NAN, force=NAN, dt=NAN):
    """The record of a tick at t [s], by default without a pair of position and force."""
    measurement = Measurement(t, 0.0, 0.0, 0.0, 0.0, 0.0, Ages(*[0.0] * 5))
    commands = (STANDSTILL,) * 3
    pair = Pair(position, force, dt)
    parts = (0.0, NAN, *commands, pair, Mode.ACTIVE, 0, ON_TIME, NO_TIME, ())
    return Record(t, 1e-3, measurement, *parts)


class FilledStream(Stream):
    """A stream into which a test writes rows of all columns, with the estimates."""

    def __init__(self, layout, ticks, shared=False):
        super().__init__(layout, ticks, shared)
        self.estimates = self.reader().estimates_writer()
        names = self.names = [column.name for column in self.schema.columns]
        self._of_loop = [names.index(name) for name in self.schema.loop]
        self._of_estimation = [names.index(name) for name in self.schema.estimation]

    def fill(self, *rows):
        """Write ticks with their estimates, one after another."""
        for row in np.array(rows, dtype=float):
            self._ticks.write(np.array([[monotonic(), *row[self._of_loop]]]))
            self.estimates.write(row[self._of_estimation][np.newaxis])

    def row(self, t, **values):
        """A row at the time t [s] whose other values are the numbers of their columns."""
        row = np.arange(float(len(self.names)))
        row[self.names.index("dropped")] = 0.0
        for name, value in {"time": t, **values}.items():
            row[self.names.index(name)] = value
        return row
