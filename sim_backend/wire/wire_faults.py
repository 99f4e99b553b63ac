"""Communication faults between emulated devices and the host, in one direction."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import TypeVar

import can

Frame = TypeVar("Frame")


class WireFault:
    """Base class of faults. A fault changes the frames or bytes that a receiver receives.

    The receiver is the host, which is the program that uses the emulated devices, or the devices on
    a wire. A frame is one message. Each direction of a wire has its own object of a fault. Each
    fault is a subclass, which overrides some of the methods. The methods of this class return all
    frames and bytes unchanged.
    """

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return the frames that are received now."""
        return frames

    def octets(self, data: bytes) -> bytes:
        """Return the bytes that are received on a serial line if `data` is sent."""
        return data

    def frame(self, frame: can.Message) -> can.Message:
        """Return the CAN frame that is received if `frame` is sent."""
        return frame

    def noise(self) -> bytes:
        """Return bytes that are received on a serial line although nobody has sent them."""
        return b""


class Random(WireFault):
    """Base class of faults that affect frames chosen at random."""

    def __init__(self, share: float = 1.0, seed: int = 0) -> None:
        self._share = share
        self._random = random.Random(seed)

    def is_affected(self) -> bool:
        """Decide at random whether the fault affects the next frame, and return the decision."""
        return self._random.random() < self._share


class Dropped(Random):
    """Fault: frames chosen at random are lost."""

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return the given frames except those that are lost, which are chosen at random."""
        return [frame for frame in frames if not self.is_affected()]


class Gaps(WireFault):
    """Fault: all frames are lost for a short time, periodically."""

    def __init__(self, every: float, length: float) -> None:
        self._every, self._length = every, length

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return the given frames, or an empty list in a gap."""
        return [] if now % self._every < self._length else frames


class Doubled(Random):
    """Fault: some frames, chosen at random, arrive twice."""

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return the given frames in their order. Frames chosen at random are repeated once."""
        return [frame for frame in frames for _ in range(1 + self.is_affected())]


class Reordered(Random):
    """Fault: pairs of successive frames, chosen at random, are received in exchanged order."""

    def __init__(self, share: float = 1.0, seed: int = 0) -> None:
        super().__init__(share, seed)
        self._held: list[object] = []
        """First frame of a pair whose second frame has not been sent yet; otherwise empty."""

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return the given frames, with random pairs of successive frames in exchanged order.

        If the last given frame is the first one of such a pair, it is stored. The next call with a
        frame then returns both frames of the pair.
        """
        out: list[Frame] = []
        for frame in frames:
            if not self._held and self.is_affected():
                self._held.append(frame)
            else:
                out += [frame, *self._held]  # type: ignore[list-item]
                self._held.clear()
        return out


class Delayed(WireFault):
    """Fault: all frames are received with a constant delay."""

    def __init__(self, delay: float) -> None:
        self._delay = delay
        self._queue: list[tuple[float, object]] = []
        """Frames that have not arrived yet, each after the time of its arrival [s]."""

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Store the given frames, and return the stored frames whose delay has ended."""
        self._queue += [(now + self._delay, frame) for frame in frames]
        due = [frame for time, frame in self._queue if time <= now]
        self._queue = [(time, frame) for time, frame in self._queue if time > now]
        return due  # type: ignore[return-value]


class Burst(WireFault):
    """Fault: frames are stored, and then all stored frames are received at once (a burst)."""

    def __init__(self, every: float) -> None:
        self._every = every
        self._next = -math.inf
        self._queue: list[object] = []

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Store the given frames, and return either all stored frames or none.

        All stored frames are returned when the time `every` has passed since this happened last.
        """
        self._queue += frames
        if now < self._next:
            return []
        self._next = now + self._every
        out, self._queue = self._queue, []
        return out  # type: ignore[return-value]


class Truncated(Random):
    """Fault: frames chosen at random lose the second half of their bytes."""

    def octets(self, data: bytes) -> bytes:
        """Return `data`, or only the first half of `data` if the fault affects this frame."""
        return data[: len(data) // 2] if data and self.is_affected() else data

    def frame(self, frame: can.Message) -> can.Message:
        """Return the frame. If the fault affects it, only the first half of its data remains."""
        if frame.is_remote_frame or not self.is_affected():
            return frame
        half = len(frame.data) // 2
        return with_data(frame, frame.data[: max(n for n in lengths(frame) if n <= half)])


class WrongLength(Random):
    """Fault: frames chosen at random have a wrong number of bytes."""

    def octets(self, data: bytes) -> bytes:
        """Return `data`. If the fault affects this frame, insert bytes before the last byte."""
        return data[:-1] + b"\x55\x55\x55" + data[-1:] if data and self.is_affected() else data

    def frame(self, frame: can.Message) -> can.Message:
        """Return the frame. If the fault affects it, its data have the next larger length.

        If the data already have the largest length of a CAN frame, they have the next smaller one.
        """
        if frame.is_remote_frame or not self.is_affected():
            return frame
        longer = [length for length in lengths(frame) if length > len(frame.data)]
        if not longer:
            return with_data(frame, frame.data[: lengths(frame)[-2]])
        return with_data(frame, frame.data.ljust(longer[0], b"\x55"))


class Corrupted(Random):
    """Fault: in frames chosen at random, one bit is inverted.

    This fault does not exist for CAN frames, because CAN controllers discard frames with bit
    errors.
    """

    def octets(self, data: bytes) -> bytes:
        """Return `data`. If the fault affects this frame, invert one bit, chosen at random."""
        if not data or not self.is_affected():
            return data
        flipped = bytearray(data)
        flipped[self._random.randrange(len(data))] ^= 1 << self._random.randrange(8)
        return bytes(flipped)


class Noise(Random):
    """Fault: on a serial line or by UDP, random bytes are received between the frames."""

    def noise(self) -> bytes:
        """Return some random bytes with the probability `share`, and otherwise no bytes."""
        return self._random.randbytes(self._random.randrange(1, 20)) if self.is_affected() else b""


class BaudMismatch(WireFault):
    """Fault: the receiver reads at half the line rate, and so receives wrong bytes."""

    def octets(self, data: bytes) -> bytes:
        """Return one byte with a wrong value for every two bytes of `data`."""
        return bytes(
            (a << 4 | b >> 4) & 0xFF | 0x80 for a, b in zip(data[::2], data[1::2], strict=False)
        )


class Silent(WireFault):
    """Fault: the port can be opened, but no frames arrive, as with a broken cable."""

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Discard the given frames, and return an empty list."""
        return []


class ErrorFrames(WireFault):
    """Fault: the host receives error frames besides the frames of the devices.

    An error frame is a message in which the CAN controller reports an error of the bus.
    """

    def __init__(self, identifier: int) -> None:
        self._identifier = identifier

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return a list of one CAN error frame, followed by the given frames."""
        error = can.Message(
            arbitration_id=self._identifier, is_error_frame=True, is_extended_id=False, dlc=8
        )
        return [error, *frames]  # type: ignore[list-item]


FAULTS: dict[str, Callable[[], WireFault]] = {
    "drop": lambda: Dropped(0.1),
    "gaps": lambda: Gaps(0.05, 5e-3),
    "double": lambda: Doubled(0.1),
    "reorder": lambda: Reordered(0.1),
    "delay": lambda: Delayed(0.1),
    "truncate": lambda: Truncated(0.1),
    "corrupt": lambda: Corrupted(0.1),
    "length": lambda: WrongLength(0.1),
    "burst": lambda: Burst(0.01),
    "noise": lambda: Noise(0.1),
    "baud": BaudMismatch,
    "silence": Silent,
    "error-frames": lambda: ErrorFrames(0x4),
    "bus-off": lambda: ErrorFrames(0x40),
}
"""Functions that return a new object of a fault, by the name of the fault."""
ON_CAN = ("error-frames", "bus-off")
"""Names of the faults that exist only on CAN buses."""
NOT_ON_CAN = ("corrupt", "noise", "baud", "unplug", "replug")
"""Names of the faults that no CAN bus has, except one with an slcan adapter."""
NOT_ON_UDP = ("baud",)
"""Names of the faults that UDP datagrams do not have."""


def lengths(frame: can.Message) -> tuple[int, ...]:
    """Return the possible numbers of data bytes of a CAN frame, or of a CAN FD frame."""
    return (*range(9), 12, 16, 20, 24, 32, 48, 64) if frame.is_fd else tuple(range(9))


def with_data(frame: can.Message, data: bytes | bytearray) -> can.Message:
    """Return a CAN frame with the identifier of `frame`, and with the given data."""
    return can.Message(
        arbitration_id=frame.arbitration_id,
        is_extended_id=frame.is_extended_id,
        is_fd=frame.is_fd,
        bitrate_switch=frame.bitrate_switch,
        data=data,
    )
