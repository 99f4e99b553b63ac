"""Estimates that are computed after the ticks, in blocks, for trials in virtual time.

The estimators process a block of samples much faster than the same samples one by one, with exactly
the same results. In real time, the estimates are computed within each tick, because they are shown
while the trial runs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimation import Bank, Conditioner
from teleop.control.alignment import Pair
from teleop.control.estimation import Estimated, Estimation
from teleop.recording.message import Layout
from teleop.recording.sinks import Outcome, Sink
from teleop.safety import Event

BLOCK = 10_000
"""Largest number of ticks in a block."""


class LaterEstimates(Estimation, Sink):
    """Sink that adds the estimates to the messages of ticks, and passes them to other sinks.

    The ticks wait until a block is complete, or until an event occurs. If an estimator raises an
    exception, the ticks of this block and of all later blocks are passed on without estimates. The
    method `update` raises the same exception at the next tick.

    Parameters
    ----------
    conditioner
        Computes the regressors from slave position and contact force.
    bank
        The estimators.
    layout
        Layout of the message of a tick.
    sinks
        The other sinks.

    Attributes
    ----------
    error
        The exception of an estimator; None if there was no exception.
    """

    def __init__(
        self, conditioner: Conditioner, bank: Bank, layout: Layout, sinks: Sequence[Sink]
    ) -> None:
        super().__init__(conditioner, bank)
        self.error: Exception | None = None
        self._sinks = sinks
        self._pushed = 0
        self._messages: list[bytes] = []
        self._message = np.dtype([("head", "S4"), ("values", "<f8", (len(layout.columns),))])
        self._places = {column.name: place for place, column in enumerate(layout.columns)}
        self._first = layout.first_of_estimates

    def update(self, pair: Pair) -> Estimated:
        """Return NaN for all estimates, because they are computed later.

        If an estimator raised an exception in an earlier block, this method raises it again.
        """
        if self.error:
            raise self.error
        return self.unknown

    def push(self, message: bytes) -> None:
        """Store the message of one tick."""
        self._messages.append(message)
        if len(self._messages) >= BLOCK:
            self._pass_on()

    def event(self, event: Event) -> None:
        """Pass on the waiting ticks, and then the event."""
        self._pass_on()
        for sink in self._sinks:
            sink.event(event)

    def close(self) -> Outcome:
        """Pass on the waiting ticks. The other sinks are not closed."""
        self._pass_on()
        return Outcome(None, self._pushed, 0, "")

    def _pass_on(self) -> None:
        """Compute the estimates of the waiting ticks, and pass these ticks on."""
        messages, self._messages = self._messages, []
        self._pushed += len(messages)
        try:
            if not self.error:
                messages = self._completed(messages)
        except Exception as error:
            self.error = error
        finally:
            for message in messages:
                for sink in self._sinks:
                    sink.push(message)
            self.dropped = sum(sink.dropped for sink in self._sinks)

    def _completed(self, messages: list[bytes]) -> list[bytes]:
        """Compute the estimates, and return the messages with these estimates.

        Estimates are computed only for ticks with a pair of slave position and contact force.
        """
        data = bytearray().join(messages)
        values, places = np.frombuffer(data, self._message)["values"], self._places
        ticks = np.flatnonzero(~np.isnan(values[:, places["paired_dt"]]))
        if not len(ticks):
            return messages
        pairs = (
            values[ticks, places[name]] for name in ("paired_position", "paired_force", "paired_dt")
        )
        series = self.run(*pairs)
        for name in ("x", "v", "f", "excitation", "contact"):
            values[ticks, places[name]] = getattr(series, name)
        for place, column in enumerate(series.estimates, self._first):
            values[ticks, place] = column
        size = self._message.itemsize
        return [bytes(data[start : start + size]) for start in range(0, len(data), size)]
