"""The recorder passes the newest data and the notes to the progress line."""

from __future__ import annotations

import math

import pytest

from estimation import paper_preset
from estimation.estimator import LEVEL_95
from teleop.recording.recorder import Recorder
from teleop.safety import Event
from teleop.safety.events import ACTIVE, Mode
from teleop.streams.columns import Layout

from ..streams.filled import FilledStream

NAN = math.nan
SESSION = {"path": None, "duration": 1.0, "show": False, "hint": "", "instructions": ""}


class Line:
    """A progress line that stores what it shows."""

    note = ""

    def __init__(self):
        self.shown = []

    def show(self, t, status):
        self.shown.append(status())


@pytest.fixture
def recorder():
    """A recorder without a file, whose line is a `Line`, and its stream."""
    stream = FilledStream(Layout({"rls": paper_preset().bank()["rls"]}), 100)
    made = Recorder({**SESSION, "cue": None}, stream.reader(), lambda message: None)
    made._progress = Line()
    return made, stream


@pytest.fixture
def shown(recorder):
    """Return a function that processes ticks, and returns what the line shows for each."""
    recorder, stream = recorder

    def process(*ticks):
        for i, (mode, contact, b, k, misfit) in enumerate(ticks):
            values = {"mode": mode, "contact": contact, "rls_b": b, "rls_k": k}
            values |= {"rls_b_std": 0.1 * b, "rls_k_std": 0.01 * k, "rls_misfit": misfit}
            stream.fill(stream.row(1e-3 * i, **values))
            recorder.advance()
        return [status.estimates for status in recorder._progress.shown]

    return process


def test_a_tick_without_a_sample_leaves_the_estimates_in_the_line(shown):
    found = shown(
        (Mode.ACTIVE, 1.0, 2.0, 900.0, 0.01),
        (Mode.ACTIVE, 1.0, NAN, NAN, NAN),
        (Mode.ACTIVE, 1.0, 3.0, 950.0, 0.01),
    )
    k_half, b_half = pytest.approx(LEVEL_95 * 9.0), pytest.approx(LEVEL_95 * 0.2)
    assert found[1] == found[0] == [("rls", 900.0, k_half, 2.0, b_half, 0.01)]
    k_half, b_half = pytest.approx(LEVEL_95 * 9.5), pytest.approx(LEVEL_95 * 0.3)
    assert found[2] == [("rls", 950.0, k_half, 3.0, b_half, 0.01)]


def test_after_a_fault_and_out_of_contact_the_line_has_no_earlier_estimates(shown):
    found = shown(
        (Mode.ACTIVE, 1.0, 2.0, 900.0, 0.01),
        (Mode.ACTIVE, 0.0, 2.0, 900.0, 0.01),
        (Mode.FAULT, 1.0, NAN, NAN, NAN),
    )
    assert found[1] is None
    assert math.isnan(found[2][0].k)


def test_notes_are_passed_to_the_line_and_no_other_events(recorder):
    recorder, stream = recorder
    for source, text in (("precision", "k ± 2 %: about 3 s more"), ("", "armed")):
        stream.event(Event(0.0, ACTIVE, text, source=source))
    recorder.advance()
    assert recorder._progress.note == "k ± 2 %: about 3 s more"
    stream.event(Event(0.0, ACTIVE, "no further estimates: it was killed", source="estimation"))
    recorder.advance()
    assert recorder._progress.note == "no further estimates: it was killed"
