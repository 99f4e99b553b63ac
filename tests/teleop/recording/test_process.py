"""The recorder process passes the newest data to the progress line."""

from __future__ import annotations

import math
import struct

import pytest
from teleop.recording.process import FRAME, TICK, FrameReader

from teleop.safety.events import Mode

ESTIMATE = ("rls_b", "rls_b_std", "rls_k", "rls_k_std", "rls_misfit")
COLUMNS = ("time", "mode", "contact", "target", "slave_position", *ESTIMATE)
NAN = math.nan


class Line:
    """A progress line that stores what it shows."""

    def __init__(self):
        self.shown = []

    def show(self, t, status):
        self.shown.append(status())


@pytest.fixture
def shown():
    """Return a function that processes ticks, and returns what the line shows for each."""
    session = {
        "columns": [(name, "", "") for name in COLUMNS],
        "estimators": ["rls"],
        "level": 2.0,
    }

    def process(*ticks):
        line = Line()
        reader = FrameReader(session, None, line)
        for i, (mode, contact, b, k, misfit) in enumerate(ticks):
            values = (1e-3 * i, mode, contact, NAN, 0.0, b, 0.1 * b, k, 0.01 * k, misfit)
            content = b"\0\1\0\0" + struct.pack(f"<{len(values)}d", *values)
            reader.process(FRAME.pack(TICK, len(content)) + content)
        return [status.estimates for status in line.shown]

    return process


def test_a_tick_without_a_sample_leaves_the_estimates_in_the_line(shown):
    found = shown(
        (Mode.ACTIVE, 1.0, 2.0, 900.0, 0.01),
        (Mode.ACTIVE, 1.0, NAN, NAN, NAN),
        (Mode.ACTIVE, 1.0, 3.0, 950.0, 0.01),
    )
    assert found[1] == found[0] == [("rls", 900.0, 18.0, 2.0, pytest.approx(0.4), 0.01)]
    assert found[2] == [("rls", 950.0, 19.0, 3.0, pytest.approx(0.6), 0.01)]


def test_after_a_fault_and_out_of_contact_the_line_has_no_earlier_estimates(shown):
    found = shown(
        (Mode.ACTIVE, 1.0, 2.0, 900.0, 0.01),
        (Mode.ACTIVE, 0.0, 2.0, 900.0, 0.01),
        (Mode.FAULT, 1.0, NAN, NAN, NAN),
    )
    assert found[1] is None
    assert math.isnan(found[2][0].k)
