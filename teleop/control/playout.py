"""Play out the received motion of the master with a constant delay, as a jitter buffer does.

Over a channel with jitter and loss, packets arrive at irregular times, and packets that were
overtaken are not used. If the slave used each packet from its arrival to the next one, its desired
motion would have steps. Here the packets are stored, and the motion at the time now - D is
interpolated between them, where D is the largest age that the newest packet had recently, at most
the largest expected delay of the channel. After a longer outage, the newest packet is used. Without
jitter and loss, D is the delay of the channel, and the motion is that of the newest packet.
"""

from __future__ import annotations

import math
from collections import deque

from drivers import new_tuple
from teleop.control.channel import ROUNDING
from teleop.control.feedback.law import MasterMotion

MARGIN = 2.0
"""Ticks by which D may exceed the largest expected delay, because of packets that are lost."""
SHORTENED = 0.01
"""Rate at which the delay D becomes shorter after the jitter has become smaller [s/s]."""


class Playout:
    """Interpolates the motion of the master between the packets that have arrived.

    `longest` is the largest expected delay of the channel [s].
    """

    def __init__(self, longest: float = math.inf) -> None:
        self._longest = longest
        self.reset(0.0, MasterMotion(0.0))

    def reset(self, now: float, motion: MasterMotion) -> None:
        """Discard all packets. The motion is `motion` until the first packet is played out."""
        self._packets: deque[tuple[float, MasterMotion]] = deque([(now, motion)])
        self._delay = 0.0
        self._now = self.time = now
        """Time at which the master sent the present motion [s]."""

    def update(self, now: float, sent: float, motion: MasterMotion) -> MasterMotion:
        """Process the newest packet that has arrived; return the present motion.

        `sent` is the time at which this packet was sent [s]. The velocity is that of the returned
        position: it is 0 while D increases, and while the newest packet is older than D.
        """
        packets = self._packets
        if sent > packets[-1][0]:
            packets.append((sent, motion))
        dt, self._now = now - self._now, now
        age = now - sent
        shorter = self._delay - SHORTENED * dt
        delay = age if age > shorter else shorter
        longest = self._longest + MARGIN * dt
        self._delay = delay = delay if delay < longest else longest
        time = now - delay
        waits = time - self.time < ROUNDING or time > packets[-1][0] + ROUNDING
        self.time = time if time < packets[-1][0] else packets[-1][0]
        while len(packets) > 1 and packets[1][0] <= time:
            packets.popleft()
        start, first = packets[0]
        if start >= time or len(packets) == 1:
            velocity = 0.0 if waits else first.velocity
            return new_tuple(MasterMotion, (first.position, velocity, first.energy))
        end, second = packets[1]
        span = end - start
        s = (time - start) / span
        # cubic Hermite interpolation of the position
        rest = 1.0 - s
        position = rest * rest * (
            (1.0 + 2.0 * s) * first.position + s * span * first.velocity
        ) + s * s * ((1.0 + 2.0 * rest) * second.position - rest * span * second.velocity)
        velocity = 0.0 if waits else rest * first.velocity + s * second.velocity
        return new_tuple(MasterMotion, (position, velocity, first.energy))
