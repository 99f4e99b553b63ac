"""A CAN bus, drained once a tick."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import can

from drivers.rig import RigError, reason
from drivers.transports.bus import Bus
from drivers.transports.slcan import SlcanBus, StatusFlags

LATEST = 1.0
"""A time stamp that is older is another clock's, not the kernel's [s]."""
STATUS_EVERY = 0.01
"""Between two questions to an slcan adapter how it is [s]."""
MOST = 4096
"""Most frames that are taken at once."""
BUS_OFF = 0x40
"""Flag in the identifier of Linux's error frames: the controller has left the bus."""
EXTENDED = 1 << 31
"""Marks an identifier of 29 bits, as in DBC files."""


class CanBus(Bus):
    """A CAN bus; frames go to what is attached to their identifiers.

    Parameters
    ----------
    name
        What the rig file calls it.
    now
        The controller's clock [s].
    interface
        python-can's name of the adapter's interface; `slcan` is our own bulk reader.
    channel
        The interface's name of the bus, such as `can0` or `/dev/ttyACM0`.
    bitrate
        Bit rate [bit/s]; None to leave it as it is set up.
    options
        What else python-can's interface wants to know.
    """

    def __init__(
        self,
        name: str,
        now: Callable[[], float],
        interface: str,
        channel: str,
        bitrate: int | None,
        options: Mapping[str, Any],
    ) -> None:
        super().__init__(name, now)
        self.interface = interface
        self.channel = channel
        self._bitrate = bitrate
        self._options = options
        self._bus: can.BusABC | None = None
        self._drain: Callable[[], list[can.Message]] = list
        self._routes: dict[int, Callable[[can.Message, float], object]] = {}
        self._polled = now()
        self._asked = -math.inf
        self.received = 0
        """Frames so far."""
        self.errors = 0
        """Error frames so far."""

    def attach(
        self, identifiers: Iterable[int], receive: Callable[[can.Message, float], object]
    ) -> None:
        """From now on call `receive` with each frame of these identifiers and its arrival [s].

        Identifiers of 29 bits have bit 31 set in addition.
        """
        self._routes.update(dict.fromkeys(identifiers, receive))

    def open(self) -> None:
        """Open the adapter."""
        try:
            if self.interface == "slcan":
                bus = SlcanBus(self.channel, bitrate=self._bitrate, **self._options)
                self._bus, self._drain = bus, bus.drain
            else:
                options = dict(self._options)
                if self._bitrate:
                    options["bitrate"] = self._bitrate
                other = can.Bus(interface=self.interface, channel=self.channel, **options)
                self._bus, self._drain = other, lambda: waiting(other)
        except (can.CanError, OSError, ValueError, TypeError, ImportError) as error:
            raise RigError(
                f"{self.name}: CAN bus {self.channel} ({self.interface}) cannot be opened: "
                f"{reason(error)}"
            ) from error
        self._polled = self.now()

    def poll(self) -> None:
        """Hand on each frame that has arrived, with its time of arrival."""
        try:
            frames = self._drain()
        except (can.CanError, OSError) as error:
            raise self._gone(error) from error
        now = self.now()
        if isinstance(self._bus, SlcanBus) and now - self._asked > STATUS_EVERY:
            self._asked = now
            self._watch_adapter(self._bus)
        middle, self._polled = 0.5 * (self._polled + now), now
        if not frames:
            return
        self.received += len(frames)
        wall = time.time()
        for frame in frames:
            if frame.is_error_frame:
                self.errors += 1
                if frame.arbitration_id & BUS_OFF:
                    raise RigError(f"{self.name}: CAN bus {self.channel} is off")
                continue
            receive = self._routes.get(frame.arbitration_id | frame.is_extended_id * EXTENDED)
            if receive:
                age = wall - frame.timestamp
                stamped = self.interface != "slcan" and 0.0 <= age < LATEST
                receive(frame, now - age if stamped else middle)

    def _watch_adapter(self, bus: SlcanBus) -> None:
        """Ask an slcan adapter how it is: it hands on no error frames."""
        flags = bus.status()
        if flags and flags & StatusFlags.BUS_ERROR:
            raise RigError(
                f"{self.name}: CAN bus {self.channel} is off: the adapter says bus error"
            )
        if flags and flags & (StatusFlags.ERROR_WARNING | StatusFlags.ERROR_PASSIVE):
            self.errors += 1

    def send(self, identifier: int, data: bytes, extended: bool = False) -> None:
        """Send a data frame without waiting.

        Raises
        ------
        RigError
            The adapter is gone or takes no more.
        """
        self._put(
            can.Message(arbitration_id=identifier, data=data, is_extended_id=extended, check=False)
        )

    def request(self, identifier: int, length: int = 8) -> None:
        """Send a remote frame, which asks for the data frame of that identifier."""
        self._put(
            can.Message(
                arbitration_id=identifier, dlc=length, is_remote_frame=True, is_extended_id=False
            )
        )

    def _put(self, frame: can.Message) -> None:
        assert self._bus
        try:
            self._bus.send(frame)
        except (can.CanError, OSError) as error:
            raise self._gone(error) from error

    def close(self) -> None:
        """Close the adapter."""
        if self._bus:
            with contextlib.suppress(can.CanError, OSError):
                self._bus.shutdown()
        self._bus = None

    def _gone(self, error: Exception) -> RigError:
        where = "" if self.interface == "slcan" else f"CAN bus {self.channel} ({self.interface}): "
        return RigError(f"{self.name}: {where}{reason(error)}")


def waiting(bus: can.BusABC) -> list[can.Message]:
    """All frames that have arrived on any python-can bus."""
    frames: list[can.Message] = []
    while len(frames) < MOST and (frame := bus.recv(0)) is not None:
        frames.append(frame)
    return frames
