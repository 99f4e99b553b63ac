"""Pack all recorded values of one tick (period of the control loop) into a message of doubles.

The message is a ROS 2 message in CDR encoding. PlotJuggler, Lichtblick and Foxglove show such
messages without a plug-in. numpy converts the messages of many ticks to an array in one step.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from estimation.estimate_columns import Column, estimate_columns, misfit_columns
from teleop.recording.cdr import CDR
from teleop.recording.tick_columns import COLUMNS, values_of

if TYPE_CHECKING:
    from estimation import Estimator
    from sim_backend import PointerOperator
    from teleop.control.tick_record import Record

REGRESSOR = "regressor_"
"""Prefix of the names of columns that contain regressors other than v and x."""
DROPPED = Column("dropped", "-", "ticks that the recorder has missed so far")
POINTER = (
    Column(
        "pointer_depth", "m", "where the pointer wants the hand; NaN before the drives are armed"
    ),
    Column("pointer_grip", "-", "1 while the pointer holds the handle"),
    Column("pointer_clock", "s", "time of the measurement on the clock of the loop"),
)
"""Additional columns if the pointer of the live page is the operator. With these columns, the trial
can be repeated exactly."""


class Layout:
    """Columns of a recording, and how the values of one tick are packed into a message (bytes).

    Parameters
    ----------
    bank
        The estimators by name.
    link
        Additional columns of a trial with a communication channel or with force feedback; empty
        for other trials.
    pointer
        The simulated operator whose hand follows the mouse pointer of the live page; None if the
        trial has no such operator.

    Attributes
    ----------
    estimators
        Names of the estimators.
    columns
        Name, unit and meaning of each double in the message.
    first_of_estimates
        Index of the first column after the columns that all recordings have. At this index, the
        regressors other than v and x begin. The estimates and the misfits follow, in this order.
    size
        Size of the message [bytes].
    """

    def __init__(
        self,
        bank: Mapping[str, Estimator],
        link: Iterable[Column] = (),
        pointer: PointerOperator | None = None,
    ) -> None:
        self.estimators = tuple(bank)
        self._pointer = pointer
        regressors_of = (e.model.further_regressors for e in bank.values())
        model = max(regressors_of, key=len, default=())
        regressors = (
            Column(f"{REGRESSOR}{name}", unit, f"regressor of {name}, as given to the estimators")
            for name, unit in model
        )
        self.first_of_estimates = len(COLUMNS) + 1
        self.columns = (
            *COLUMNS,
            DROPPED,
            *regressors,
            *estimate_columns(bank),
            *misfit_columns(bank),
            *link,
            *(POINTER if pointer else ()),
        )
        self._struct = struct.Struct(f"<4s{len(self.columns)}d")
        self.size = self._struct.size

    @property
    def definition(self) -> str:
        """Definition of the message in the message definition language of ROS 2."""
        lines = [f"float64 {c.name}  # [{c.unit}] {c.meaning}" for c in self.columns]
        return "\n".join(["# One tick of the control loop", *lines]) + "\n"

    def pack(self, record: Record, dropped: int = 0) -> bytes:
        """Return the message (bytes) of one tick, with the values in the order of `columns`.

        Parameters
        ----------
        record
            Recorded quantities and estimates of the tick.
        dropped
            Number of ticks that were not recorded so far, because the recorder was too slow.
        """
        further: tuple[float, ...] = ()
        if pointer := self._pointer:
            further = pointer.depth, pointer.grip, record.measurement.time
        return self._struct.pack(
            CDR,
            *values_of(record),
            dropped,
            *record.estimated.estimates,
            *record.link,
            *further,
        )
