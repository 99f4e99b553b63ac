"""The verdict about the loop follows from its timing, and names what would stop a rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from teleop.safety import Limits
from teleop.trial.loop_verdict import LoopTiming, LoopVerdict, verdict_of
from teleop.trial.other_programs import NOT_KNOWN

LIMITS = Limits()
RATE = 1000.0


def measured(n=60_000, *, late=None, skipped=None, busy=100e-6, rate=RATE, fault=""):
    """The timing of n ticks that begin in time, except those in `late` and `skipped`."""
    lateness, skips = np.zeros(n), np.zeros(n)
    for tick, seconds in (late or {}).items():
        lateness[tick] = seconds
    for tick, number in (skipped or {}).items():
        skips[tick] = number
    timing = LoopTiming.of_ticks(rate, lateness, skips, np.full(n, busy), np.zeros(0), NOT_KNOWN)
    return timing._replace(fault=fault)


def judged(watchdogs=None, limits=LIMITS, **timing) -> LoopVerdict:
    return verdict_of(measured(**timing), limits, watchdogs)


def test_a_punctual_loop_is_possible_without_a_remark():
    verdict = judged()
    assert (verdict.level, verdict.reasons) == ("yes", [])
    assert verdict.possible
    assert verdict.margin == pytest.approx(LIMITS.max_gap - 1e-3)
    assert verdict.text.startswith("1000 Hz: this computer can run the loop: measured for 60 s")


def test_the_statistics_are_those_of_the_ticks():
    timing = measured(n=1000, late={10: 0.6e-3, 20: 0.2e-3}, skipped={500: 3})
    assert timing.ticks == 1000
    assert timing.skipped == 3
    assert timing.late == 1
    assert timing.missed == pytest.approx(3 / 1003)
    assert timing.longest_gap == pytest.approx(4e-3)
    assert timing.seconds == pytest.approx(1.002)
    assert timing.lateness["max"] == 0.6e-3
    assert timing.document()["tick_us"]["busy"]["p90"] == pytest.approx(100.0)


@pytest.mark.parametrize("rate", [1000.0, 4000.0])
def test_a_tick_that_fills_its_period_is_refused_with_the_possible_rate(rate):
    verdict = judged(busy=0.95 / rate, rate=rate)
    assert not verdict.possible
    assert f"expected a rate of at most {0.9 * rate / 0.95:.0f} Hz" in verdict.reasons[0]
    assert judged(busy=0.85 / rate, rate=rate).possible


def test_a_loop_that_skips_more_periods_than_the_supervisor_permits_is_refused():
    limits = replace(LIMITS, max_skipped_fraction=0.1)
    every_ninth = dict.fromkeys(range(0, 60_000, 8), 1)
    verdict = judged(skipped=every_ninth, limits=limits)
    assert not verdict.possible
    assert "10% are permitted" in verdict.reasons[0]
    assert judged(skipped=every_ninth).level == "with delays"


def test_a_pause_is_compared_with_the_shortest_watchdog():
    pause = {"skipped": {100: 59}}
    assert judged(**pause).level == "with delays"  # 60 ms of the 80 ms of the supervisor
    refused = judged({"left": 0.2, "right": 0.05}, **pause)
    assert not refused.possible
    assert "60 ms, and the watchdog of right stops the rig after 50 ms" in refused.reasons[0]
    assert refused.margin == pytest.approx(-0.01)
    assert judged({"left": 0.2}, skipped={100: 29}).level == "yes"


@pytest.mark.parametrize(
    ("timing", "reason"),
    [
        ({"skipped": dict.fromkeys(range(1, 6000, 60), 1)}, "100 periods"),
        ({"late": dict.fromkeys(range(1, 6000, 60), 0.7e-3)}, "100 of 60000 ticks began late"),
    ],
)
def test_more_than_a_thousandth_of_disturbed_periods_is_remarked(timing, reason):
    verdict = judged(**timing)
    assert verdict.level == "with delays"
    assert reason in verdict.reasons[0]


def test_a_single_disturbed_period_of_a_short_measurement_is_chance():
    assert judged(n=200, skipped={50: 1}).level == "yes"
    assert judged(n=200, skipped={50: 1, 90: 1}).level == "with delays"


def test_a_fault_that_the_timing_caused_is_a_refusal():
    verdict = judged(fault="the loop overran: 90 ms")
    assert not verdict.possible
    assert "the loop overran" in verdict.reasons[0]


def test_a_tick_that_other_programs_interrupt_still_fits_into_its_period():
    calm = np.zeros(1000)
    interrupted = LoopTiming.of_ticks(
        RATE, calm, calm, calm + 5e-3, calm[:0], NOT_KNOWN, calm + 1e-4
    )
    verdict = verdict_of(interrupted, LIMITS)
    assert not verdict.possible
    assert verdict.fits
    assert verdict.cost == pytest.approx(1e-4)
