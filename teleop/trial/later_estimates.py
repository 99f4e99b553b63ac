"""Compute the estimates of a trial in virtual time in blocks of many ticks.

The estimators process a block of samples much faster than the same samples one by one, with exactly
the same results. In a trial in real time or with the live page, the estimates are computed within
each tick instead, because they are shown while the trial runs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimation import Bank, Conditioner
from teleop.control.alignment import Pair
from teleop.control.estimates import Estimated, Estimation
from teleop.control.failures import failure
from teleop.recording.columns import Layout
from teleop.recording.sinks import Outcome, Sink
from teleop.safety import Event

BLOCK = 10_000
"""Largest number of ticks in a block."""


class LaterEstimates(Estimation, Sink):
    """Sink that adds the estimates to messages, and then passes the messages to other sinks.

    A sink receives a message with the data of each tick. This sink stores the messages until it has
    `BLOCK` messages, until an event occurs, or until it is closed. Then it computes the estimates
    of all stored ticks together, and passes their messages on.

    If an estimator raises an exception, the messages of this block and of all later blocks are
    passed on without estimates. The next call of `update` raises the same exception.

    Attributes
    ----------
    error
        The exception that an estimator raised; None if there was no exception.
    """

    def __init__(
        self, conditioner: Conditioner, bank: Bank, layout: Layout, sinks: Sequence[Sink]
    ) -> None:
        super().__init__(conditioner, bank)
        self.error: Exception | None = None
        self._sinks = sinks
        self._pushed = 0
        self._messages: list[bytes] = []
        self._layout = layout

    def update(self, pair: Pair) -> Estimated:
        """Return NaN for all estimates of a tick, because the estimates are computed later.

        If an estimator raised an exception in an earlier block of ticks, this method raises the
        same exception.
        """
        if self.error:
            raise self.error
        return self.unknown

    def push(self, message: bytes) -> None:
        """Store the message of one tick. If `BLOCK` messages are stored, process them."""
        self._messages.append(message)
        if len(self._messages) >= BLOCK:
            self._pass_on()

    def event(self, event: Event) -> None:
        """Compute the estimates of the stored messages, send these messages, and then the event."""
        self._pass_on()
        for sink in self._sinks:
            sink.event(event)

    def close(self) -> Outcome:
        """Pass the stored messages with their estimates to the other sinks.

        The result contains the number of received ticks. The other sinks are not closed.
        """
        self._pass_on()
        return Outcome(None, self._pushed, 0, "")

    def _pass_on(self) -> None:
        """Add the estimates to the stored messages, and pass the messages to the other sinks."""
        messages, self._messages = self._messages, []
        self._pushed += len(messages)
        try:
            if not self.error:
                messages = self._completed(messages)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # an estimator of another package can raise SystemExit
            _, self.error = failure(error)
        finally:
            for message in messages:
                for sink in self._sinks:
                    sink.push(message)
            self.dropped = sum(sink.dropped for sink in self._sinks)

    def _completed(self, messages: list[bytes]) -> list[bytes]:
        """Compute the estimates of ticks, and return the messages of the ticks with the estimates.

        A force sensor can be slower than the control loop. Then only some ticks have a pair of
        slave position and contact force. Only these ticks have estimates.
        """
        data, layout = bytearray().join(messages), self._layout
        values = np.frombuffer(data, layout.dtype)
        ticks = np.flatnonzero(~np.isnan(values["paired_dt"]))
        if not len(ticks):
            return messages
        pairs = (values[name][ticks] for name in ("paired_position", "paired_force", "paired_dt"))
        series = self.run(*pairs)
        for name in ("x", "v", "f", "k_bound", "b_bound", "contact"):
            values[name][ticks] = getattr(series, name)
        for name, column in zip(layout.of_estimators, series.estimates, strict=True):
            values[name][ticks] = column
        return [
            bytes(data[start : start + layout.size]) for start in range(0, len(data), layout.size)
        ]
