"""Ring in shared memory: what one process writes, others read unchanged, or they miss it."""

from __future__ import annotations

import mmap
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.streams.ring import HEAD, RingReader, RingWriter, margin, ring_size
from teleop.streams.shared_file import SharedFile

PAIR = np.dtype((np.float64, 2))


def make(slots, record=PAIR):
    memory = mmap.mmap(-1, ring_size(record, slots))
    return RingWriter(memory, record, slots), RingReader(memory, record, slots)


def numbered(first, count):
    """Records whose values are their number, and its negative."""
    numbers = np.arange(first, first + count, dtype=float)
    return np.stack([numbers, -numbers], axis=1)


def assert_whole(first, records):
    np.testing.assert_array_equal(records, numbered(first, len(records)))


class Interrupted:
    """The places of a ring, with a function that is called in the middle of each access."""

    def __init__(self, slots, between):
        self.slots, self.between = slots, between

    def __getitem__(self, places):
        half = len(places) // 2
        first = self.slots[places[:half]]
        self.between()
        return np.concatenate([first, self.slots[places[half:]]])

    def __setitem__(self, places, values):
        half = len(places) // 2
        self.slots[places[:half]] = values[:half]
        self.between()
        self.slots[places[half:]] = values[half:]
        self.between()


@given(st.lists(st.integers(1, 40), max_size=30), st.integers(8, 80))
def test_records_are_read_as_they_were_written_or_are_missed(counts, slots):
    writer, reader = make(slots)
    position = missed = read = 0
    for count in counts:
        writer.write(numbered(writer.newest + 1, count))
        first, records = reader.read(position + 1, reader.newest + 1)
        assert_whole(first, records)
        missed += first - position - 1
        read += len(records)
        position = first + len(records) - 1
        assert position == reader.newest == writer.newest
    assert read + missed == sum(counts)
    assert missed == 0 or max(counts) > slots - margin(slots)


@given(st.lists(st.integers(1, 40), min_size=1, max_size=15), st.integers(8, 80))
def test_while_a_block_is_written_every_readable_record_is_whole(counts, slots):
    writer, reader = make(slots)
    states = []

    def look():
        first, records = reader.read(1, 10**9)
        assert_whole(first, records)
        states.append(len(records))

    writer._slots = Interrupted(writer._slots, look)
    for count in counts:
        writer.write(numbered(writer.newest + 1, count))
    assert len(states) >= 2 * len(counts)
    assert max(states) <= slots - margin(slots)


@given(st.integers(0, 200), st.integers(8, 80))
def test_while_one_record_is_written_at_its_place_every_readable_record_is_whole(before, slots):
    writer, reader = make(slots)
    for _ in range(before):
        writer.write(numbered(writer.newest + 1, 1))
    place, size = writer.place, PAIR.itemsize
    writer.memory[place : place + size] = bytes(size)
    assert_whole(*reader.read(1, 10**9))
    writer.memory[place : place + size] = numbered(before + 1, 1).tobytes()
    assert reader.newest == before
    writer.publish()
    first, records = reader.read(before + 1, before + 2)
    assert (first, len(records)) == (before + 1, 1)
    assert_whole(first, records)


@given(st.integers(0, 100), st.integers(0, 200), st.integers(8, 80))
def test_records_that_are_overwritten_while_they_are_copied_are_not_returned(before, more, slots):
    writer, reader = make(slots)
    writer.write(numbered(1, before))

    def write_more():
        writer.write(numbered(writer.newest + 1, more))

    reader._slots = Interrupted(reader._slots, write_more)
    first, records = reader.read(1, before + 1)
    assert_whole(first, records)
    assert first + len(records) - 1 <= before
    if more == 0:
        assert len(records) == min(before, slots - margin(slots))


def test_records_that_do_not_exist_yet_are_not_returned():
    writer, reader = make(16)
    assert reader.read(1, 5)[1].shape == (0, 2)
    writer.write(numbered(1, 3))
    assert reader.read(3, 9)[0] == 3
    assert len(reader.read(4, 9)[1]) == 0
    assert len(reader.read(9, 20)[1]) == 0


def test_a_reader_of_another_process_cannot_write_to_the_ring():
    file = SharedFile.create(ring_size(PAIR, 16))
    other = SharedFile.open(file.path)
    file.remove()
    assert not file.path.exists()
    reader = RingReader(other.buffer, PAIR, 16)
    assert not reader._slots.flags.writeable
    with pytest.raises(TypeError):
        other.buffer[HEAD] = 1


WIDTH, SLOTS, RECORDS = 40, 256, 60_000
WIDE = np.dtype((np.float64, WIDTH))
WRITE = f"""
import sys, time
from pathlib import Path
import numpy as np
from teleop.streams.ring import RingWriter
from teleop.streams.shared_file import SharedFile
record = np.dtype((np.float64, {WIDTH}))
writer = RingWriter(SharedFile.open(Path(sys.argv[1]), True).buffer, record, {SLOTS})
sys.stdin.read(1)
while writer.newest < {RECORDS}:
    count = min(1 + writer.newest % 29, {RECORDS} - writer.newest)
    numbers = np.arange(writer.newest + 1.0, writer.newest + 1.0 + count)
    writer.write(np.repeat(numbers[:, None], {WIDTH}, axis=1))
    if writer.newest % 31 == 0:
        time.sleep(1e-4)
"""
READ = f"""
import sys
from pathlib import Path
import numpy as np
from teleop.streams.ring import RingReader
from teleop.streams.shared_file import SharedFile
record = np.dtype((np.float64, {WIDTH}))
reader = RingReader(SharedFile.open(Path(sys.argv[1])).buffer, record, {SLOTS})
print("ready", flush=True)
position = read = missed = torn = 0
while position < {RECORDS}:
    first, records = reader.read(position + 1, reader.newest + 1)
    numbers = np.arange(first, first + len(records))
    torn += int((records != numbers[:, None]).any(axis=1).sum())
    missed += first - position - 1
    read += len(records)
    position = first + len(records) - 1
print(read, missed, torn, flush=True)
"""


@pytest.mark.real_time
def test_readers_in_threads_and_processes_beside_a_writer_get_whole_records_only():
    file = SharedFile.create(ring_size(WIDE, SLOTS))
    pipe = subprocess.PIPE
    command = [sys.executable, "-c"]
    reading = [
        subprocess.Popen([*command, READ, str(file.path)], stdout=pipe, text=True) for _ in "ab"
    ]
    writing = subprocess.Popen([*command, WRITE, str(file.path)], stdin=pipe, text=True)
    results = []

    def read():
        reader = RingReader(file.buffer, WIDE, SLOTS)
        position = count = missed = torn = 0
        end = time.monotonic() + 60.0
        while position < RECORDS and time.monotonic() < end:
            first, records = reader.read(position + 1, reader.newest + 1)
            numbers = np.arange(first, first + len(records))
            torn += int((records != numbers[:, np.newaxis]).any(axis=1).sum())
            missed += first - position - 1
            count += len(records)
            position = first + len(records) - 1
            time.sleep(1e-3)
        results.append((count, missed, torn))

    threads = [threading.Thread(target=read) for _ in range(2)]
    for thread in threads:
        thread.start()
    for process in reading:
        assert process.stdout.readline() == "ready\n"
    writing.communicate("x")
    results.extend(tuple(map(int, one.communicate()[0].split())) for one in reading)
    for thread in threads:
        thread.join()
    file.remove()
    assert len(results) == 4
    for count, missed, torn in results:
        assert count + missed == RECORDS
        assert torn == 0
        assert count > 100
