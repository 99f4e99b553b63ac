"""Cells in shared memory, and the ticks that a page receives."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from teleop.live.cells import ARM, SIZE, STOP, CellReader, CellWriter
from teleop.live.history import CLEAR, HEAD, History, decimated
from teleop.streams.shared_file import SharedFile


@given(st.integers(0, 1000), st.lists(st.integers(0, 60), max_size=50), st.integers(1, 9))
def test_ticks_that_are_sent_are_a_step_apart_and_end_with_the_newest(first, counts, step):
    last, end, sent = first - 1, first, []
    for count in counts:
        start, end = last + 1, end + count
        chosen = decimated(start, end, last, step)
        assert all(start <= n < end for n in chosen)
        if chosen:
            assert chosen[-1] == end - 1
            last = chosen[-1]
        assert end - 1 - last < step
        sent += chosen
    assert all(later - earlier >= step for earlier, later in pairwise(sent))


def frames(history, first=0, clear=True):
    rows = []
    while True:
        frame, end = history.frame(first, clear)
        _, count, columns, flags, _ = HEAD.unpack_from(frame)
        assert bool(flags & CLEAR) == clear
        rows.append(np.frombuffer(frame, "<f8", offset=HEAD.size).reshape(count, columns))
        first, clear = end, False
        if end == history.end:
            return np.vstack(rows)


@given(st.lists(st.integers(0, 70), max_size=20))
def test_the_history_keeps_the_newest_rows_in_order(counts):
    history, n = History(3, rows=50), 0
    for count in counts:
        history.add(np.arange(n, n + count)[:, None] * np.ones(3))
        n += count
    kept = frames(history, history.start)
    assert kept[:, 0].tolist() == [*range(max(0, n - 50), n)]


def test_frames_of_a_long_history_are_small():
    history = History(100)
    history.add(np.zeros((2000, 100)))
    frame, end = history.frame(0, True)
    assert len(frame) <= 33_000
    assert end < 2000


def test_requests_and_pointer_arrive_and_a_torn_pointer_does_not(tmp_path):
    file = SharedFile.create(SIZE)
    other = SharedFile.open(file.path, writable=True)
    file.remove()
    assert not file.path.exists()
    writer, reader = CellWriter(other.buffer), CellReader(file.buffer)
    writer.count(STOP)
    writer.count(ARM)
    writer.count(ARM)
    assert (reader.counts[STOP], reader.counts[ARM]) == (1, 2)
    writer.point(0.004, True)
    assert reader.pointer() == (2, 0.004, True)
    writer._counts[5] += 1  # as if the writer was killed between the two
    assert reader.pointer() is None
