"""Create a stream of ticks in private memory, of which a process that forks gets its own copy."""

from __future__ import annotations

import mmap
from collections.abc import Callable
from unittest import mock

from teleop.streams import stream as stream_module
from teleop.streams.columns import Layout
from teleop.streams.stream import Stream


def private_stream(layout: Layout, ticks: int, now: Callable[[], float]) -> Stream:
    """Return a stream for a number of ticks, all of whose times are those of the clock `now` [s].

    From now on, all streams of this process use this clock.
    """

    def private(_: int, size: int) -> mmap.mmap:
        return mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)

    stream_module.monotonic = now
    with mock.patch.object(stream_module, "mmap", private):
        return Stream(layout, ticks)
