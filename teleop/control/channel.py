"""Communication channel between master and slave: delay, jitter and loss of packets.

The channel has two directions. Each packet contains a value and the time at which the packet was
sent. A packet is either lost, or arrives after the one-way delay plus a random time between 0 and
the jitter. The receiver uses the value of the newest packet that has arrived. A packet is discarded
if it arrives after a packet that was sent later.
"""

from __future__ import annotations

import random
from collections import deque
from dataclasses import dataclass, fields
from typing import Generic, TypeVar

T = TypeVar("T")
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "%": 1e-2}
"""Factors that convert the units in a text for `parse_channel` to SI units."""
ROUNDING = 1e-9
"""Tolerance for rounding errors of times [s]."""
TIMES = ("delay", "jitter", "max_silence")
OF_TIME = "a time with its unit, such as 5ms, or a number in s"
EXAMPLE = "expected a text such as delay=100ms,jitter=20ms,loss=5%"


@dataclass(frozen=True)
class ChannelSettings:
    """Settings of a communication channel. They are the same in both directions."""

    delay: float = 0.0
    """One-way delay of each direction [s]. The jitter is added to this delay."""
    jitter: float = 0.0
    """Largest random time that is added to the delay of a packet [s]; uniformly distributed."""
    loss: float = 0.0
    """Probability that a packet is lost, 0 <= loss < 1."""
    max_silence: float = 0.1
    """Longest permitted time without a new packet [s]. After this time, the drives are stopped."""

    def __post_init__(self) -> None:
        for name in ("delay", "jitter"):
            value = getattr(self, name)
            if not 0.0 <= value <= 2.0:
                raise ValueError(f"{name} of the channel must be 0 to 2 s, got {value:g} s")
        if not 0.0 <= self.loss < 1.0:
            raise ValueError(f"loss of the channel must be at least 0 and below 1, got {self.loss}")
        if not 0.0 < self.max_silence <= 1.0:
            raise ValueError(
                "max_silence of the channel must be more than 0 and at most 1 s, "
                f"got {self.max_silence:g} s"
            )

    @property
    def text(self) -> str:
        """Settings as text for `parse_channel`, for example `delay=100ms,loss=5%`."""
        loss = f",loss={self.loss * 100.0:g}%" if self.loss else ""
        jitter = f",jitter={self.jitter * 1e3:g}ms" if self.jitter else ""
        silence = "" if self.max_silence == 0.1 else f",max_silence={self.max_silence * 1e3:g}ms"
        return f"delay={self.delay * 1e3:g}ms{jitter}{loss}{silence}"


def parse_channel(text: str) -> ChannelSettings:
    """Return the settings in a text such as `delay=100ms,jitter=20ms,loss=5%`."""
    known = [field.name for field in fields(ChannelSettings)]
    values: dict[str, float] = {}
    for part in text.split(","):
        name, equals, given = (piece.strip() for piece in part.partition("="))
        if not equals or name not in known or name in values:
            raise ValueError(
                f"channel {text!r}: {part.strip()!r}: {EXAMPLE}, with {', '.join(known)}"
            )
        number = given.rstrip("%umµs ").strip()
        unit = given[len(number) :].strip().replace("µ", "u")
        allowed = ("s", "ms", "us", "") if name in TIMES else ("%", "")
        try:
            if unit not in allowed:
                raise ValueError
            values[name] = float(number) * UNITS.get(unit, 1.0)
        except ValueError:
            wanted = OF_TIME if name in TIMES else "a fraction or a percentage"
            raise ValueError(f"channel {text!r}: {name} {given!r}: expected {wanted}") from None
    try:
        return ChannelSettings(**values)
    except ValueError as error:
        raise ValueError(f"channel {text!r}: {error}") from error


class Direction(Generic[T]):
    """One direction of the communication channel."""

    def __init__(self, settings: ChannelSettings, seed: str, initial: T) -> None:
        self._delay, self._jitter, self._loss = settings.delay, settings.jitter, settings.loss
        self._random = random.Random(seed).random
        self._expected = settings.delay + settings.jitter
        self._perfect = not (settings.delay or settings.jitter or settings.loss)
        self.reset(0.0, initial)

    def reset(self, now: float, initial: T) -> None:
        """Discard all packets. From the time `now` [s] on, the receiver uses `initial`."""
        self.value = initial
        """Value of the newest packet that has arrived."""
        self.sent = now
        """Time at which the newest packet that has arrived was sent [s]."""
        self.cut = False
        """Whether the connection is interrupted. All packets sent during this time are lost."""
        self.due = now + self._expected
        """Time at which the newest packet arrived [s].

        Until the first packet arrives, this is the latest time at which it should arrive.
        """
        self._queue: deque[tuple[float, float, T]] = deque()

    def exchange(self, now: float, value: T) -> T:
        """Send a value at the time `now` [s]; return the value that the receiver uses at this time.

        The receiver uses the value of the newest packet that has arrived.
        """
        if self._perfect and not self.cut:
            self.due = self.sent = now
            self.value = value
            return value
        self.send(now, value)
        return self.receive(now)

    def send(self, now: float, value: T) -> None:
        """Send a value at the time `now` [s]."""
        queue = self._queue
        if self.cut or (self._loss and self._random() < self._loss):
            return
        arrival = now + self._delay
        if self._jitter:
            arrival += self._jitter * self._random()
        while queue and queue[-1][0] >= arrival:
            queue.pop()  # it would arrive after this newer packet
        queue.append((arrival, now, value))

    def receive(self, now: float) -> T:
        """Return the value of the newest packet that has arrived until the time `now` [s]."""
        queue, latest = self._queue, now + ROUNDING
        while queue and queue[0][0] <= latest:
            _, self.sent, self.value = queue.popleft()
            self.due = now
        return self.value
