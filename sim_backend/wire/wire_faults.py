"""Faults of a wire, between emulated devices and the host."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import TypeVar

import can

Frame = TypeVar("Frame")


class WireFault:
    """What befalls frames and bytes on their way to the host; by itself nothing."""

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """What becomes of the frames of this moment [s]."""
        return frames

    def octets(self, data: bytes) -> bytes:
        """What becomes of the bytes of a serial line."""
        return data

    def frame(self, frame: can.Message) -> can.Message:
        """What becomes of a CAN frame."""
        return frame

    def noise(self) -> bytes:
        """Bytes that nobody sent."""
        return b""


class Random(WireFault):
    """A fault that befalls this share of all frames.

    Parameters
    ----------
    share
        Between 0 and 1.
    seed
        Of the choice.
    """

    def __init__(self, share: float = 1.0, seed: int = 0) -> None:
        self._share = share
        self._random = random.Random(seed)

    def strikes(self) -> bool:
        """Whether it befalls the next frame."""
        return self._random.random() < self._share


class Dropped(Random):
    """Frames are lost."""

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """The others."""
        return [frame for frame in frames if not self.strikes()]


class Doubled(Random):
    """Frames come twice."""

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Each once or twice."""
        return [frame for frame in frames for _ in range(1 + self.strikes())]


class Reordered(Random):
    """A frame comes after the one that was sent after it."""

    def __init__(self, share: float = 1.0, seed: int = 0) -> None:
        super().__init__(share, seed)
        self._held: list[object] = []

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """The others, then those that were held back."""
        out: list[Frame] = []
        for frame in frames:
            if not self._held and self.strikes():
                self._held.append(frame)
            else:
                out += [frame, *self._held]  # type: ignore[list-item]
                self._held.clear()
        return out


class Delayed(WireFault):
    """Frames come late.

    Parameters
    ----------
    delay
        By this much [s].
    """

    def __init__(self, delay: float) -> None:
        self._delay = delay
        self._queue: list[tuple[float, object]] = []

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """Those whose time has come."""
        self._queue += [(now + self._delay, frame) for frame in frames]
        due = [frame for time, frame in self._queue if time <= now]
        self._queue = [(time, frame) for time, frame in self._queue if time > now]
        return due  # type: ignore[return-value]


class Burst(WireFault):
    """Frames are held back, and come all at once.

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
        """Nothing, or all."""
        self._queue += frames
        if now < self._next:
            return []
        self._next = now + self._every
        out, self._queue = self._queue, []
        return out  # type: ignore[return-value]


class Truncated(Random):
    """Frames end too early."""

    def octets(self, data: bytes) -> bytes:
        """The head of them."""
        return data[: len(data) // 2] if data and self.strikes() else data

    def frame(self, frame: can.Message) -> can.Message:
        """The head of its data."""
        return with_data(frame, frame.data[: len(frame.data) // 2]) if self.strikes() else frame


class WrongLength(Random):
    """Frames have bytes too many."""

    def octets(self, data: bytes) -> bytes:
        """With three more."""
        return data[:-1] + b"\x55\x55\x55" + data[-1:] if data and self.strikes() else data

    def frame(self, frame: can.Message) -> can.Message:
        """With a byte more, or less where there are eight."""
        if not self.strikes():
            return frame
        return with_data(frame, (frame.data + b"\x55") if len(frame.data) < 8 else frame.data[:7])


class Corrupted(Random):
    """A bit of a serial frame is flipped; on a CAN bus the controllers drop such a frame."""

    def octets(self, data: bytes) -> bytes:
        """With one bit flipped."""
        if not data or not self.strikes():
            return data
        flipped = bytearray(data)
        flipped[self._random.randrange(len(data))] ^= 1 << self._random.randrange(8)
        return bytes(flipped)


class Noise(Random):
    """Bytes that nobody sent come between the frames."""

    def noise(self) -> bytes:
        """Up to 20 of them."""
        return self._random.randbytes(self._random.randrange(1, 20)) if self.strikes() else b""


class BaudMismatch(WireFault):
    """The host listens at half the rate: each byte that it sees is made of two."""

    def octets(self, data: bytes) -> bytes:
        """Half as many, all wrong."""
        return bytes(
            (a << 4 | b >> 4) & 0xFF | 0x80 for a, b in zip(data[::2], data[1::2], strict=False)
        )


class Silent(WireFault):
    """Nothing comes any more, though the port is there: a wire is cut behind the adapter."""

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """None."""
        return []


class ErrorFrames(WireFault):
    """The bus is disturbed: error frames come among the frames.

    Parameters
    ----------
    identifier
        Linux's flags of the error, such as 0x40 for bus off and 0x4 for a controller problem.
    """

    def __init__(self, identifier: int) -> None:
        self._identifier = identifier

    def frames(self, frames: list[Frame], now: float) -> list[Frame]:
        """An error frame first."""
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
"""Faults of a bus by name."""
ON_CAN = ("error-frames", "bus-off")
"""Those of a CAN bus."""
ON_SERIAL_LINES = ("corrupt", "noise", "baud", "unplug", "replug")
"""Those of a serial line, that of an slcan adapter too."""


def with_data(frame: can.Message, data: bytes | bytearray) -> can.Message:
    """The frame with other data."""
    return can.Message(
        arbitration_id=frame.arbitration_id,
        is_extended_id=frame.is_extended_id,
        data=data,
    )
