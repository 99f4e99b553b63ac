"""Emulated CAN device that sends the messages of a DBC file (description of CAN messages)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle, product
from typing import TYPE_CHECKING, Any

import can
import cantools
from cantools.database.can import Database, Message, Signal

from sim_backend.wire.emulated_device import EmulatedCanDevice, Mount

if TYPE_CHECKING:
    from drivers.devices.dbc import DbcSettings

CYCLE = 1e-3
"""Period of a message without `GenMsgCycleTime` in the DBC file [s]."""
BACKLOG = 5
"""Largest number of overdue frames of a message that are sent at once; the others are omitted."""

Selection = dict[str, int]
"""Value of each multiplexer in a frame, by the name of the multiplexer.

A multiplexer is a signal whose value determines which other signals the frame contains.
"""


class EmulatedDbcDevice(EmulatedCanDevice):
    """A CAN device that sends the messages of a DBC file periodically.

    The values of the signals come from the simulated telemanipulator. A message can contain a
    multiplexer, a signal whose value determines which other signals a frame contains. In successive
    frames, the multiplexer takes all its values, so that all signals are sent.
    """

    def __init__(self, name: str, settings: DbcSettings, mount: Mount) -> None:
        super().__init__(name, settings, mount)
        database = cantools.database.load_file(settings.file, "dbc")
        assert isinstance(database, Database)
        wanted = settings.messages
        messages = [m for m in database.messages if not wanted or m.name in wanted]
        every = [signal.name for message in messages for signal in message.signals]
        self._senders = [Sender(message, every) for message in messages]

    def receive(self, frame: can.Message, now: float) -> None:
        """Do nothing, because the device only sends CAN frames."""

    def due(self) -> float:
        """Return the time at which the device sends its next CAN frame [s]."""
        return min(sender.next for sender in self._senders)

    def emit(self, now: float) -> list[can.Message]:
        """Return the CAN frames that the device sends at time `now` [s]."""
        return [frame for sender in self._senders for frame in sender.due(now, self.mount)]


class Sender:
    """Periodic sender of one message of a DBC file.

    Parameters
    ----------
    message
        The message.
    every
        Names of all signals that the device sends, from all its messages. If two messages contain a
        signal of the same name, the rig file calls the signal MESSAGE.SIGNAL, with the name of the
        message first.
    """

    def __init__(self, message: Message, every: Sequence[str]) -> None:
        self._message = message
        self._prefixed = {s.name for s in message.signals if every.count(s.name) > 1}
        self._signals = {signal.name: signal for signal in message.signals}
        self._period = (message.cycle_time or 0) * 1e-3 or CYCLE
        self._selections = cycle(list(selections(message.signal_tree)))
        self.next = math.nan
        """Time of the next frame [s]."""

    def due(self, now: float, mount: Mount) -> Iterator[can.Message]:
        """Yield the CAN frames of the message that are due at time `now` [s].

        If more than `BACKLOG` frames are due, only `BACKLOG` frames are sent.

        Parameters
        ----------
        now
            Present time [s].
        mount
            Interface to the simulated telemanipulator, which gives the values of the signals.
        """
        if math.isnan(self.next):
            self.next = now
        count = max(0, math.ceil((now - self.next) / self._period))
        self.next += count * self._period
        for _ in range(min(count, BACKLOG)):
            yield can.Message(
                arbitration_id=self._message.frame_id,
                is_extended_id=self._message.is_extended_frame,
                is_fd=self._message.length > 8,
                data=self._message.encode(dict(self._values(mount)), strict=False),
            )

    def _values(self, mount: Mount) -> Iterator[tuple[str, float]]:
        selection = next(self._selections)
        for name, signal in self._signals.items():
            chosen = selection.get(name)
            if chosen is None:
                sensed = f"{self._message.name}.{name}" if name in self._prefixed else name
                yield name, within(signal, mount.sense(sensed))
            else:
                yield name, signal.scale * chosen + signal.offset


def selections(tree: Sequence[Any]) -> Iterator[Selection]:
    """Yield all combinations of values that the multiplexers of a message can have.

    A multiplexer is a signal whose value determines which other signals a frame contains. A message
    without multiplexers has one combination, which is empty.

    Parameters
    ----------
    tree
        The attribute `signal_tree` of a message of the library cantools. This list contains the
        names of the signals. Instead of the name of a multiplexer, it contains a dictionary from
        this name to a second dictionary. The second dictionary gives a list for each value of the
        multiplexer. This list has the same form as `tree`, and contains the further signals.
    """
    ways = [
        [
            {name: value} | deeper
            for value, branch in branches.items()
            for deeper in selections(branch)
        ]
        for node in tree
        if isinstance(node, Mapping)
        for name, branches in node.items()
    ]
    for choice in product(*ways):
        yield {name: value for part in choice for name, value in part.items()}


def within(signal: Signal, value: float) -> float:
    """Return the physical value, limited to the range that the bits of the signal represent."""
    if signal.is_float:
        return value
    half = 1 << signal.length - 1
    least, most = (-half, half - 1) if signal.is_signed else (0, 2 * half - 1)
    low, high = sorted(signal.scale * raw + signal.offset for raw in (least, most))
    return min(max(value, low), high)
