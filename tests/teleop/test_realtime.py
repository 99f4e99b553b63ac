"""Steps that the system refuses are told, and every step is taken back."""

from __future__ import annotations

import gc
import os

import pytest

from teleop import realtime as steps
from teleop.errors import InputError
from teleop.realtime import DONE, STEPS, realtime


@pytest.mark.skipif(not hasattr(os, "sched_getscheduler"), reason="needs Linux's scheduler")
def test_each_step_is_reported_and_taken_back():
    before = os.sched_getscheduler(0), os.sched_getaffinity(0), gc.isenabled()
    with realtime("try") as report:
        assert list(report) == list(STEPS)
        assert report["no garbage collection"] == DONE
        assert not gc.isenabled()
        if report["SCHED_FIFO"] == DONE:
            assert os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
        if report["one processor"] == DONE:
            assert len(os.sched_getaffinity(0)) == 1
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0), gc.isenabled()) == before


def test_off_leaves_everything_as_it_is():
    with realtime("off") as report:
        assert report == {}
        assert gc.isenabled()


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (PermissionError(1, "Operation not permitted"), "not permitted"),
        (AttributeError("mlockall"), "not there on this system"),
        (OSError(12, "Cannot allocate memory"), "cannot allocate memory"),
    ],
)
def test_a_step_that_fails_is_told_and_with_require_refused(monkeypatch, error, told):
    def fail():
        raise error

    monkeypatch.setitem(steps.STEPS, "locked memory", fail)
    with realtime("try") as report:
        assert report["locked memory"] == told
    refused = pytest.raises(InputError, match=rf"locked memory \({told}\).*--realtime try")
    with refused, realtime("require"):
        pass
    assert gc.isenabled()


def test_an_unknown_mode_is_refused():
    with pytest.raises(InputError, match="require, try, off"), realtime("hard"):
        pass
