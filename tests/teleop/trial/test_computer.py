"""The properties of a computer are read from its kernel, and what to change follows from them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from teleop.safety import Limits
from teleop.trial.computer import Computer, changes, latency_timers, this_computer
from teleop.trial.loop_verdict import LoopTiming, verdict_of
from teleop.trial.other_programs import OtherPrograms

IDEAL = Computer("Linux", 4, "PREEMPT_RT", ("performance",), "3", virtual=False)
QUIET = OtherPrograms(4, 0.01, 0.0, ())
APPLIED = dict.fromkeys(
    ("locked memory", "no garbage collection", "one processor", "SCHED_FIFO"), "done"
)


def verdict(skipped=0, others=QUIET):
    calm = np.zeros(1000)
    skips = calm + skipped * (np.arange(1000) % 100 == 0)
    return verdict_of(
        LoopTiming.of_ticks(1000.0, calm, skips, calm + 1e-4, calm[:0], others), Limits()
    )


def written(folder: Path, **files: str) -> Path:
    for name, text in files.items():
        path = folder / name.replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n")
    return folder


def test_the_kernel_states_governor_isolated_processors_and_a_virtual_machine(tmp_path):
    sys = written(
        tmp_path / "sys",
        devices__system__cpu__cpu0__cpufreq__scaling_governor="powersave",
        devices__system__cpu__cpu1__cpufreq__scaling_governor="performance",
        devices__system__cpu__isolated="1",
        kernel__realtime="1",
    )
    proc = written(tmp_path / "proc", cpuinfo="processor: 0\nflags\t: fpu hypervisor lm")
    found = this_computer(sys, proc)
    assert found.governors == ("performance", "powersave")
    assert (found.isolated, found.kernel, found.virtual) == ("1", "PREEMPT_RT", True)


def test_a_system_that_states_nothing_is_no_error(tmp_path):
    found = this_computer(tmp_path, tmp_path)
    assert (found.governors, found.isolated, found.virtual) == ((), "", False)


def test_the_latency_timer_of_a_serial_adapter_is_found(tmp_path):
    written(tmp_path, ttyUSB0__device__latency_timer="16", ttyUSB1__other="x")
    assert latency_timers(["/dev/ttyUSB0", "/dev/ttyUSB1"], tmp_path) == {"ttyUSB0": 16}


def test_nothing_is_to_be_changed_on_an_ideal_computer():
    assert changes(verdict(skipped=1), IDEAL, APPLIED, {"ttyUSB0": 1}) == []


@pytest.mark.parametrize(
    ("computer", "realtime", "timers", "words"),
    [
        (IDEAL, {"SCHED_FIFO": "not permitted"}, {}, "allow rtprio and memlock"),
        (IDEAL, {"one processor": "no free processor"}, {}, "at least two processors"),
        (IDEAL._replace(governors=("powersave",)), {}, {}, "echo performance | sudo tee"),
        (IDEAL, {}, {"ttyUSB0": 16}, "echo 1 | sudo tee /sys/class/tty/ttyUSB0/device/latency"),
    ],
)
def test_what_is_likely_to_disturb_the_loop_is_named_even_if_it_was_punctual(
    computer, realtime, timers, words
):
    (found,) = changes(verdict(), computer, {**APPLIED, **realtime}, timers)
    assert words in found


@pytest.mark.parametrize(
    ("computer", "words"),
    [
        (IDEAL._replace(virtual=True), "virtual machine"),
        (IDEAL._replace(kernel="PREEMPT_DYNAMIC"), "PREEMPT_RT"),
        (IDEAL._replace(isolated=""), "isolcpus=3, and teleop with taskset -c 0-3"),
    ],
)
def test_the_kernel_is_to_be_changed_only_if_the_loop_had_delays(computer, words):
    assert changes(verdict(), computer, APPLIED) == []
    (found,) = changes(verdict(skipped=1), computer, APPLIED)
    assert words in found


def test_other_programs_are_named():
    busy = OtherPrograms(4, 1.2, 0.5, (("python3", 4711, 1.0),))
    first, second = changes(verdict(others=busy), IDEAL, APPLIED)
    assert "end python3 (process 4711)" in first
    assert "host" in second
    not_known = OtherPrograms(4, math.nan, math.nan, ())
    assert changes(verdict(others=not_known), IDEAL, APPLIED) == []
