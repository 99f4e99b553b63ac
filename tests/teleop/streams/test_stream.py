"""The stream of a trial: ticks, their estimates and events, as every reader gets them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation import paper_preset
from teleop.errors import InputError
from teleop.json_documents import dumps
from teleop.safety import Event, Fault
from teleop.safety.events import ACTIVE, FAULT
from teleop.settings.trial_settings import TrialSettings
from teleop.streams import stream as streams
from teleop.streams.columns import Layout
from teleop.streams.ring import RingReader
from teleop.streams.shared_file import SharedFile
from teleop.streams.stream import (
    EVENT_SIZE,
    LONGEST_TEXT,
    PATIENCE,
    Stream,
    StreamReader,
    event_record,
)
from teleop.trial.run import run_trial

from .filled import FilledStream, record_at

LAYOUT = Layout({})
VALUES = len(LAYOUT.schema.estimation)


class Trial:
    """A stream whose ticks are at their number [s], and whose estimates of x are ten times that."""

    def __init__(self, ticks=100, shared=False):
        self.stream = Stream(LAYOUT, ticks, shared)
        self.estimates = self.stream.reader().estimates_writer()

    def tick(self, count=1):
        for _ in range(count):
            self.stream.write(record_at(float(self.stream.newest + 1)))

    def estimate(self, count=1):
        numbers = np.arange(self.estimates.newest + 1.0, self.estimates.newest + 1.0 + count)
        self.estimates.write(np.repeat(10.0 * numbers[:, np.newaxis], VALUES, axis=1))

    def event(self, text=""):
        self.stream.event(Event(float(self.stream.newest), ACTIVE, text))

    def readable(self):
        """Number of ticks that can be read when the ring is full."""
        ring = self.stream.reader().ticks
        return ring.newest + 1 - ring.oldest


@pytest.fixture
def trial():
    return Trial()


@pytest.fixture
def clock(monkeypatch):
    """Return a function that changes the time of the stream [s]."""
    now = [100.0]
    monkeypatch.setattr(streams, "monotonic", lambda: now[0])

    def wait(seconds):
        now[0] += seconds

    return wait


def column(batch, name):
    names = [one.name for one in LAYOUT.schema.columns]
    return batch.rows[:, names.index(name)]


def numbers(batch):
    return [] if batch is None else column(batch, "time").tolist()


def test_a_reader_gets_each_tick_once_with_the_time_at_which_it_was_written(trial, clock):
    reader = trial.stream.reader()
    assert reader.read() is None
    trial.tick(2)
    clock(0.5)
    trial.tick()
    trial.estimate(3)
    batch = reader.read()
    assert (batch.first, numbers(batch), batch.is_after_gap) == (1, [1.0, 2.0, 3.0], False)
    assert batch.written.tolist() == [100.0, 100.0, 100.5]
    assert reader.read() is None
    assert not reader.is_behind


def test_ticks_are_joined_with_their_estimates_by_number(trial):
    reader = trial.stream.reader()
    reader.patience = 0.0
    trial.tick(5)
    trial.estimate(3)
    batch = reader.read()
    np.testing.assert_array_equal(column(batch, "x"), [10.0, 20.0, 30.0, np.nan, np.nan])
    trial.estimate(3)
    trial.tick(2)
    np.testing.assert_array_equal(column(reader.read(), "x"), [60.0, np.nan])
    np.testing.assert_array_equal(
        reader.columns(4, 8)["x"], [40.0, 50.0, 60.0, np.nan]
    )  # those that were late are in the ring


def test_estimates_that_are_overwritten_while_ticks_are_read_are_not_those_of_other_ticks(trial):
    reader, read = trial.stream.reader(), RingReader.read
    trial.tick(150)
    trial.estimate(150)

    def interrupted(first, end):
        found = read(reader.ticks, first, end)
        trial.tick(60)
        trial.estimate(60)
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reader.ticks, "read", interrupted)
        batch = reader.read()
    x, t = column(batch, "x"), column(batch, "time")
    known = np.isfinite(x)
    assert 50 < known.sum() < 150
    np.testing.assert_array_equal(x[known], 10.0 * t[known])


def test_a_tick_is_withheld_until_its_estimates_are_computed(trial):
    reader = trial.stream.reader()
    reader.patience = math.inf
    trial.tick(5)
    assert reader.read() is None
    assert reader.is_behind
    trial.estimate(3)
    assert numbers(reader.read()) == [1.0, 2.0, 3.0]
    assert reader.read() is None


def test_a_reader_waits_for_estimates_no_longer_than_its_patience(trial, clock):
    reader = trial.stream.reader()
    reader.patience = 2.0
    trial.tick(2)
    clock(1.9)
    trial.tick()
    assert reader.read() is None
    clock(0.2)
    assert numbers(reader.read()) == [1.0, 2.0, 3.0]


def test_after_late_estimates_nothing_is_withheld_until_there_are_new_ones(trial, clock):
    reader = trial.stream.reader()
    trial.tick(2)
    trial.estimate()
    clock(PATIENCE + 0.1)
    assert numbers(reader.read()) == [1.0, 2.0]
    trial.tick()
    assert numbers(reader.read()) == [3.0]  # at once: the estimation is known to be late
    trial.estimate(2)
    trial.tick()
    assert reader.read() is None
    trial.estimate()
    batch = reader.read()
    assert (numbers(batch), column(batch, "x").tolist()) == ([4.0], [40.0])


def test_an_event_follows_the_ticks_up_to_its_own_and_not_before_that_is_read(trial):
    reader = trial.stream.reader()
    reader.patience = math.inf
    trial.event("before the first tick")
    assert [(n, e["text"]) for n, e in reader.read().events] == [(0, "before the first tick")]
    for text in ("a", "b"):
        trial.tick(2)
        trial.event(text)
    trial.event("c")
    trial.estimate(3)
    batch = reader.read()
    assert (numbers(batch), [(n, e["text"]) for n, e in batch.events]) == ([1, 2, 3], [(2, "a")])
    trial.estimate()
    assert [(n, e["text"]) for n, e in reader.read().events] == [(4, "b"), (4, "c")]
    trial.event("d")
    assert [(n, e["text"]) for n, e in reader.read().events] == [(4, "d")]
    assert [event["text"] for event in trial.stream.events[1:]] == ["a", "b", "c", "d"]


def test_ticks_that_a_reader_missed_are_counted_and_marked_as_a_gap():
    trial = Trial(shared=True)
    reader = StreamReader.open(trial.stream.document, "recorder")
    other = trial.stream.reader()
    reader.patience = other.patience = 0.0
    trial.tick(10)
    assert not reader.read().is_after_gap
    trial.tick(30)
    other.read()
    trial.tick(1000)
    kept = trial.readable()
    batch = reader.read()
    lost = 1040 - 10 - kept
    assert (batch.first, len(batch.rows), batch.is_after_gap) == (11 + lost, kept, True)
    assert numbers(batch) == [*map(float, range(11 + lost, 1041))]
    assert (reader.missed, column(batch, "dropped").tolist()) == (lost, [lost] * kept)
    assert trial.stream.missed["recorder"] == lost
    assert trial.stream.missed["live page"] == 0
    trial.tick()
    batch = reader.read()
    assert not batch.is_after_gap
    other.read()
    assert column(batch, "dropped").tolist() == [lost]
    assert trial.stream.reader().columns(1041, 1042)["dropped"].tolist() == [lost]
    trial.stream.unlink()


def test_the_ticks_that_must_be_stored_can_be_read_together():
    for ticks in (1, 7, 100, 1000):
        trial = Trial(ticks)
        trial.tick(3 * ticks + 500)
        assert trial.readable() >= ticks


def test_a_batch_has_at_most_the_wanted_number_of_ticks(trial):
    reader = trial.stream.reader()
    trial.tick(7)
    trial.event("at 7")
    trial.estimate(7)
    assert numbers(reader.read(3)) == [1.0, 2.0, 3.0]
    assert numbers(reader.read(3)) == [4.0, 5.0, 6.0]
    batch = reader.read(3)
    assert (numbers(batch), [n for n, _ in batch.events]) == ([7.0], [7])


ACTIONS = st.lists(
    st.tuples(st.sampled_from(["tick", "estimate", "event", "read"]), st.integers(1, 60)),
    max_size=60,
)


@given(ACTIONS, st.sampled_from([0.0, math.inf]), st.integers(1, 50))
def test_no_tick_and_no_event_is_returned_twice_in_another_order_or_without_being_counted(
    actions, patience, most
):
    trial = Trial(ticks=40)
    reader = trial.stream.reader()
    reader.patience = patience
    ticks, events, expected = [], [], []

    def read():
        before = reader.missed
        while batch := reader.read(most):
            assert len(batch.rows) <= most
            got = numbers(batch)
            assert got == [float(batch.first + i) for i in range(len(got))]
            assert batch.is_after_gap == (reader.missed > before)
            before = reader.missed
            x = column(batch, "x")
            known = ~np.isnan(x)
            np.testing.assert_array_equal(x[known], 10.0 * np.array(got)[known])
            if patience and not reader.missed:
                old = np.array(got) <= trial.estimates.newest
                assert old.all()
            ticks.extend(got)
            events.extend(batch.events)
            assert all(number <= reader.position for number, _ in batch.events)

    for action, count in actions:
        if action == "tick":
            trial.tick(count)
        elif action == "estimate":
            trial.estimate(min(count, trial.stream.newest - trial.estimates.newest))
        elif action == "event":
            trial.event(f"{len(expected)}")
            expected.append((trial.stream.newest, f"{len(expected)}"))
        else:
            read()
    trial.estimate(trial.stream.newest - trial.estimates.newest)
    read()
    assert ticks == sorted(set(ticks))
    assert len(ticks) + reader.missed == reader.position == trial.stream.newest
    assert [(number, event["text"]) for number, event in events] == expected


def test_another_process_reads_what_the_loop_writes_by_name():
    layout = Layout(paper_preset().bank())
    stream = FilledStream(layout, 50, shared=True)
    stream.fill(stream.row(0.5), stream.row(0.501))
    document = stream.document
    reader = StreamReader.open(document, "live page")
    stream.unlink()
    with pytest.raises(OSError, match="No such file"):
        StreamReader.open(document, "live page")
    assert reader.schema == layout.schema
    stream.fill(stream.row(0.502))  # the names are gone, and the memory remains
    columns = reader.columns(1, 4)
    assert list(columns) == [one.name for one in layout.schema.columns]
    np.testing.assert_array_equal(columns["time"], [0.5, 0.501, 0.502])
    expected = stream.row(0.5)
    for place, name in enumerate(columns):
        assert columns[name][0] == expected[place], name


def test_the_longest_event_fits_into_its_ring():
    text = 2000 * "\N{COLLISION SYMBOL}"  # a character outside the basic plane needs most bytes
    event = Event(-1e-300 / 3, FAULT, text, Fault.NOT_FOLLOWING, text, *3 * [-1e-300 / 3])
    assert len(dumps(event_record(event))) <= EVENT_SIZE
    stream = Stream(LAYOUT, 10)
    stream.event(event)
    ((_, found),) = stream.reader().read().events
    assert found["text"] == text[:LONGEST_TEXT]
    assert found == stream.events[0]


@pytest.mark.parametrize("possible", [0, 1, 2, 3])
def test_no_file_is_left_if_the_memory_is_full(monkeypatch, tmp_path, possible):
    def create(size):
        if len(list(tmp_path.iterdir())) == possible:
            raise OSError(28, "No space left on device")
        return complete(size)

    complete = SharedFile.create
    monkeypatch.setattr("teleop.streams.shared_file.MEMORY", tmp_path)
    monkeypatch.setattr(SharedFile, "create", create)
    with pytest.raises(InputError, match="no memory for the ticks of the trial: no space left"):
        run_trial(TrialSettings(duration=0.1, rate=50.0))
    assert list(tmp_path.iterdir()) == []
