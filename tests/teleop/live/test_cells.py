"""Ring and cells in shared memory: what one process writes, another reads, or nothing."""

from __future__ import annotations

import mmap
import struct
import threading
import time
from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from teleop.live.cells import ARM, SIZE, STOP, CellReader, CellWriter
from teleop.live.history import CLEAR, HEAD, History, decimated
from teleop.streams.ring import RingReader, RingWriter, ring_size
from teleop.streams.shared_file import SharedFile


def make(slots, size):
    buffer = mmap.mmap(-1, ring_size(slots, size))
    return RingWriter(buffer, slots, size, lambda: 1.5), RingReader(buffer, slots, size)


def messages(slots_read):
    _, slots = slots_read
    return [slot["message"][: slot["length"]].tobytes() for slot in slots]


@given(st.lists(st.binary(max_size=37), max_size=40), st.integers(100, 200))
def test_messages_are_read_as_they_were_written(written, slots):
    writer, reader = make(slots, 37)
    for message in written:
        writer.write(message)
    found = reader.read(range(1, len(written) + 1))
    assert reader.newest == len(written)
    assert found[0] == [*range(1, len(written) + 1)]
    assert messages(found) == written


def test_overwritten_messages_are_not_returned():
    writer, reader = make(100, 8)
    for number in range(1, 251):
        writer.write(struct.pack("<Q", number))
    found, slots = reader.read(range(1, 260))
    assert found == [*range(151, 251)]
    assert slots["message"].view("<u8")[:, 0].tolist() == found
    assert reader.oldest > 151


def test_a_slot_that_is_being_written_is_not_returned():
    writer, reader = make(100, 8)
    for number in range(1, 4):
        writer.write(struct.pack("<Q", number))
    words = writer._words
    for changed in (0, 4):  # the number before, and the number after the message
        word = (64 + 2 * writer._stride) // 8 + changed
        kept, words[word] = words[word], 102
        assert reader.read([1, 2, 3])[0] == [1, 3]
        words[word] = kept
    assert reader.read([1, 2, 3])[0] == [1, 2, 3]


def test_a_reader_beside_a_writer_gets_whole_messages_only():
    writer, reader = make(128, 800)
    done = threading.Event()

    def write():
        while not done.is_set():
            writer.write(struct.pack("<Q", writer.newest + 1) * 100)
            if writer.newest % 32 == 0:
                time.sleep(0.0)  # else a whole ring may be written before the reader runs

    thread = threading.Thread(target=write)
    thread.start()
    count = 0
    try:
        while count < 5000:
            end = reader.newest + 1
            found, slots = reader.read(range(max(1, end - 128), end))
            values = np.ascontiguousarray(slots["message"]).view("<u8")
            assert (values == np.array(found, dtype=np.uint64).reshape(-1, 1)).all()
            count += len(found)
    finally:
        done.set()
        thread.join()


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


def test_the_reader_of_the_ring_cannot_write_to_it():
    file = SharedFile.create(ring_size(10, 8))
    other = SharedFile.open(file.path, writable=False)
    file.remove()
    reader = RingReader(other.buffer, 10, 8)
    assert not reader._slots.flags.writeable
