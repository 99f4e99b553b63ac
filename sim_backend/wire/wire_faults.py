"""Communication faults on the way from emulated devices to the host."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import TypeVar

import can

Frame = TypeVar("Frame")


class WireFault:
    """Base class of faults, which change the frames or bytes that the host receives.

    This class changes nothing.
    """

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return the frames that arrive at time `now` [s], if `frames` are sent at this time."""
        return frames

    def octets(self, data: bytes) -> bytes:
        """Return the bytes that the host receives from a serial line, if `data` are sent."""
        return data

    def frame(self, frame: can.Message) -> can.Message:
        """Return the CAN frame that the host receives, if `frame` is sent."""
        return frame

    def noise(self) -> bytes:
        """Return additional bytes that the host receives although no device has sent them."""
        return b""


class Random(WireFault):
    """Base class of faults that affect frames chosen at random.

    Parameters
    ----------
    share
        Probability that a frame is affected, from 0 to 1.
    seed
        Seed of the random choice.
    """

    def __init__(self, share: float = 1.0, seed: int = 0) -> None:
        self._share = share
        self._random = random.Random(seed)

    def is_affected(self) -> bool:
        """Choose at random whether the next frame is affected; return the result."""
        return self._random.random() < self._share


class Dropped(Random):
    """Fault: random frames are lost."""

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return the frames that are not lost."""
        return [frame for frame in frames if not self.is_affected()]


class Doubled(Random):
    """Fault: random frames are received twice."""

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return each frame once or twice."""
        return [frame for frame in frames for _ in range(1 + self.is_affected())]


class Reordered(Random):
    """Fault: random frames are received after the next frame."""

    def __init__(self, share: float = 1.0, seed: int = 0) -> None:
        super().__init__(share, seed)
        self._held: list[object] = []

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return the frames, with random pairs of successive frames in exchanged order."""
        out: list[Frame] = []
        for frame in frames:
            if not self._held and self.is_affected():
                self._held.append(frame)
            else:
                out += [frame, *self._held]  # type: ignore[list-item]
                self._held.clear()
        return out


class Delayed(WireFault):
    """Fault: all frames arrive with a constant delay.

    Parameters
    ----------
    delay
        Delay [s].
    """

    def __init__(self, delay: float) -> None:
        self._delay = delay
        self._queue: list[tuple[float, object]] = []

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return the frames whose delay has ended since the last call."""
        self._queue += [(now + self._delay, frame) for frame in frames]
        due = [frame for time, frame in self._queue if time <= now]
        self._queue = [(time, frame) for time, frame in self._queue if time > now]
        return due  # type: ignore[return-value]


class Burst(WireFault):
    """Fault: frames are collected and received in bursts.

    Parameters
    ----------
    every
        Time between two bursts [s].
    """

    def __init__(self, every: float) -> None:
        self._every = every
        self._next = -math.inf
        self._queue: list[object] = []

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return all collected frames if a burst is due, otherwise no frames."""
        self._queue += frames
        if now < self._next:
            return []
        self._next = now + self._every
        out, self._queue = self._queue, []
        return out  # type: ignore[return-value]


class Truncated(Random):
    """Fault: random frames are truncated to half of their length."""

    def octets(self, data: bytes) -> bytes:
        """Return the bytes. If the fault affects them, return only the first half."""
        return data[: len(data) // 2] if data and self.is_affected() else data

    def frame(self, frame: can.Message) -> can.Message:
        """Return the frame. If the fault affects it, return it with the first half of its data."""
        return with_data(frame, frame.data[: len(frame.data) // 2]) if self.is_affected() else frame


class WrongLength(Random):
    """Fault: random frames have a wrong length."""

    def octets(self, data: bytes) -> bytes:
        """Return the bytes. If the fault affects them, insert three bytes before the last one."""
        return data[:-1] + b"\x55\x55\x55" + data[-1:] if data and self.is_affected() else data

    def frame(self, frame: can.Message) -> can.Message:
        """Return the frame. If the fault affects it, return it with one byte more.

        A frame of eight bytes, which is the largest length, has one byte less instead.
        """
        if not self.is_affected():
            return frame
        return with_data(frame, (frame.data + b"\x55") if len(frame.data) < 8 else frame.data[:7])


class Corrupted(Random):
    """Fault: in random serial frames, one bit is inverted.

    CAN frames do not have this fault, because CAN controllers discard frames with bit errors.
    """

    def octets(self, data: bytes) -> bytes:
        """Return the bytes, with one bit inverted if the fault affects them."""
        if not data or not self.is_affected():
            return data
        flipped = bytearray(data)
        flipped[self._random.randrange(len(data))] ^= 1 << self._random.randrange(8)
        return bytes(flipped)


class Noise(Random):
    """Fault: random bytes are received between the frames."""

    def noise(self) -> bytes:
        """Return 1 to 19 random bytes, or none if the fault does not occur now."""
        return self._random.randbytes(self._random.randrange(1, 20)) if self.is_affected() else b""


class BaudMismatch(WireFault):
    """Fault: the host has half the line rate of the device, and receives two bytes as one byte."""

    def octets(self, data: bytes) -> bytes:
        """Return half as many bytes, with wrong values."""
        return bytes(
            (a << 4 | b >> 4) & 0xFF | 0x80 for a, b in zip(data[::2], data[1::2], strict=False)
        )


class Silent(WireFault):
    """Fault: the port exists, but no frames are received, as with a broken cable to the device."""

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return no frames."""
        return []


class ErrorFrames(WireFault):
    """Fault: error frames are received between the CAN frames, as on a disturbed bus.

    Parameters
    ----------
    identifier
        Identifier of the error frames. It consists of the error flags of Linux, for example 0x40
        for bus-off and 0x4 for a problem of the CAN controller.
    """

    def __init__(self, identifier: int) -> None:
        self._identifier = identifier

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Return a CAN error frame, and then the given frames."""
        error = can.Message(
            arbitration_id=self._identifier, is_error_frame=True, is_extended_id=False, dlc=8
        )
        return [error, *frames]  # type: ignore[list-item]


FAULTS: dict[str, Callable[[], WireFault]] = {
    "drop": lambda: Dropped(0.1),
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
"""For each fault of a bus, by name: a function that returns a new object of this fault."""
ON_CAN = ("error-frames", "bus-off")
"""Names of the faults that exist only on CAN buses."""
ON_SERIAL_LINES = ("corrupt", "noise", "baud", "unplug", "replug")
"""Names of the faults that exist only on serial lines, including the line of an slcan adapter."""


def with_data(frame: can.Message, data: bytes | bytearray) -> can.Message:
    """Return a copy of a CAN frame with other data."""
    return can.Message(
        arbitration_id=frame.arbitration_id,
        is_extended_id=frame.is_extended_id,
        data=data,
    )
