"""Failed steps are reported, every step is reverted, and processes claim different processors."""

from __future__ import annotations

import contextlib
import gc
import os
import subprocess
import sys

import pytest

from teleop.errors import InputError
from teleop.trial import realtime as steps
from teleop.trial.realtime import (
    DONE,
    FIFO,
    PRIORITY,
    PROCESSOR,
    SHARED_PRIORITIES,
    STEPS,
    avoid_claimed_processors,
    realtime,
)

pytestmark = pytest.mark.skipif(
    not hasattr(os, "sched_getscheduler"), reason="needs Linux's scheduler"
)


def policy():
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK


@pytest.fixture(autouse=True)
def names(monkeypatch):
    """Use names of claims that other processes of this machine do not use."""
    monkeypatch.setattr(
        "drivers.claims.address",
        lambda name: f"\0test {os.getpid()} {name}".encode(),
    )


@pytest.fixture
def processors(monkeypatch):
    """Simulate four processors; the affinity is stored but not applied."""
    state = {"affinity": {0, 1, 2, 3}}
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(state["affinity"]))
    monkeypatch.setattr(os, "sched_setaffinity", lambda pid, new: state.update(affinity=set(new)))
    return lambda: state["affinity"]


@pytest.fixture
def priorities(monkeypatch):
    """Record the priorities that are set."""
    taken = []

    def take(priority=PRIORITY):
        taken.append(priority)
        return taken.pop

    monkeypatch.setattr(steps, "set_fifo_priority", take)
    return taken


def test_each_step_is_reported_and_reverted():
    before = os.sched_getscheduler(0), os.sched_getaffinity(0), gc.isenabled()
    with realtime("try") as real_time:
        real_time.start()
        report = real_time.report
        assert list(report) == list(STEPS)
        assert report["no garbage collection"] == DONE
        assert not gc.isenabled()
        if report[FIFO] == DONE:
            assert policy() == os.SCHED_FIFO
        if report[PROCESSOR] == DONE:
            assert len(os.sched_getaffinity(0)) == 1
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0), gc.isenabled()) == before


LOCK = """
from pathlib import Path
from teleop.trial.realtime import realtime

def locked():
    (line,) = [l for l in Path("/proc/self/status").read_text().splitlines() if "VmLck" in l]
    return int(line.split()[1]) > 0

with realtime("try", ["locked memory"]) as real_time:
    print(real_time.report["locked memory"], locked(), end=" ")
print(locked())
"""


def test_the_memory_is_locked_and_released():
    done = subprocess.run([sys.executable, "-c", LOCK], capture_output=True, text=True, check=True)
    assert done.stdout in ("done True False\n", "not permitted False False\n")


def test_no_step_except_the_last_runs_at_the_real_time_priority(monkeypatch):
    policies = []
    for name in steps.SET_UP:
        monkeypatch.setitem(steps.SET_UP, name, lambda: policies.append(policy()) or (lambda: None))
    with realtime("try"):
        policies.append(policy())
    assert policies == [os.SCHED_OTHER] * 4


def test_the_recorder_has_a_real_time_priority_below_every_loop():
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as reader:
        with realtime("try", (FIFO,)) as real_time:
            real_time.start(reader.pid)
            if real_time.report[FIFO] == DONE:
                priority = os.sched_getparam(reader.pid).sched_priority
                assert 0 < priority < min(SHARED_PRIORITIES) < PRIORITY
        reader.communicate(b"\n")


def test_off_changes_nothing():
    with realtime("off") as real_time:
        real_time.start()
        assert real_time.report == {}
        assert gc.isenabled()


@pytest.mark.parametrize(
    ("error", "reported"),
    [
        (PermissionError(1, "Operation not permitted"), "not permitted"),
        (AttributeError("mlockall"), "not available on this system"),
        (OSError(12, "Cannot allocate memory"), "cannot allocate memory"),
    ],
)
def test_a_step_that_fails_is_reported_and_with_require_refused(monkeypatch, error, reported):
    def fail():
        raise error

    monkeypatch.setitem(steps.SET_UP, "locked memory", fail)
    with realtime("try") as real_time:
        assert real_time.report["locked memory"] == reported
    refused = pytest.raises(InputError, match=rf"locked memory \({reported}\).*--realtime try")
    with refused, realtime("require") as real_time:
        real_time.start()
    assert gc.isenabled()


def test_an_unknown_mode_is_refused():
    with pytest.raises(InputError, match="require, try, off"), realtime("hard"):
        pass


def test_processes_get_different_processors_and_one_remains_for_all(processors, priorities):
    with contextlib.ExitStack() as stack:
        for own in ({3}, {2}, {1}):
            process = stack.enter_context(realtime("try", (PROCESSOR, FIFO)))
            process.start()
            assert process.report == {PROCESSOR: DONE, FIFO: DONE}
            assert processors() == own
            os.sched_setaffinity(0, {0, 1, 2, 3})  # the affinity of the next process
        late = [stack.enter_context(realtime("try", (PROCESSOR, FIFO))) for _ in range(2)]
        for process in late:
            process.start()
            assert "no free processor, lower priority" in process.report[PROCESSOR]
            assert processors() == {0, 1, 2, 3}
        assert priorities == [PRIORITY] * 3 + [*SHARED_PRIORITIES[:2]]
    assert priorities == []
    with realtime("try", (PROCESSOR,)) as again:
        assert again.report == {PROCESSOR: DONE}


def test_with_require_a_process_without_a_claimed_processor_is_refused(processors, priorities):
    os.sched_setaffinity(0, {0})
    refused = pytest.raises(InputError, match=r"one processor \(no free processor")
    with refused, realtime("require", (PROCESSOR, FIFO)) as real_time:
        real_time.start()


def test_other_commands_do_not_run_on_a_claimed_processor(processors):
    with realtime("try", (PROCESSOR,)):
        os.sched_setaffinity(0, {0, 1, 2, 3})
        with avoid_claimed_processors():
            assert processors() == {0, 1, 2}
        assert processors() == {0, 1, 2, 3}
    with avoid_claimed_processors():
        assert processors() == {0, 1, 2, 3}


CLAIM = """
import os, sys
from drivers import claims
claims.address = lambda name: sys.argv[1].encode().replace(b"@", bytes(1)) + name.encode()
held = claims.claim("processor 1")
print(bool(held), flush=True)
sys.stdin.read()
"""


def test_a_claim_excludes_other_processes_and_ends_with_its_process_even_if_killed():
    from drivers import claims

    name = f"@test {os.getpid()} "
    process = subprocess.Popen(
        [sys.executable, "-c", CLAIM, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdout.readline() == b"True\n"
    assert claims.is_claimed("processor 1")
    assert claims.claimant("processor 1") == process.pid
    assert f"process {process.pid} (-c" in claims.process_text(process.pid)
    assert claims.claim("processor 1") is None
    process.kill()
    process.communicate()
    assert not claims.is_claimed("processor 1")
    with claims.claim("processor 1"):
        assert claims.is_claimed("processor 1")
    assert not claims.is_claimed("processor 1")
