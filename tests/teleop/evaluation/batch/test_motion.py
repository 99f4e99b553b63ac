"""Frequency of the motion and contact point of a record with rests before and after the motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from teleop.evaluation.batch.analysis import Analysis, analyse, motion_of
from teleop.evaluation.batch.strokes import cycle_frequency
from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.reading.signals import Signals, periods
from teleop.evaluation.settings import EstimateSettings
from teleop.output.result_tables import motion_line

RATE = 200.0


def rest_motion_rest(frequency: float, before: float, after: float, middle: bool) -> Analysis:
    t = np.arange(round(RATE * (before + 8.0 + after))) / RATE
    phase = 2.0 * np.pi * frequency * np.clip(t - before, 0.0, 8.0)
    x = 3e-3 + 1e-3 * (np.sin(phase) if middle else -np.cos(phase))
    rng = np.random.default_rng(0)
    f = 5.0 + 2000.0 * (x - 3e-3) + rng.normal(0.0, 0.01, len(t))
    x = x + rng.normal(0.0, 1e-6, len(t))
    return analyse(Signals(t, x, f, periods(t), "position"))


@pytest.mark.parametrize("middle", [True, False])
@pytest.mark.parametrize(("before", "after"), [(0.0, 0.0), (3.0, 3.0), (10.0, 0.0), (0.0, 15.0)])
def test_a_rest_before_or_after_changes_neither_frequency_nor_contact(
    before: float, after: float, middle: bool
) -> None:
    analysis = rest_motion_rest(1.0, before, after, middle)
    assert motion_of(analysis.record).frequency_hz == pytest.approx(1.0, rel=0.02)
    assert analysis.phases.contact_point is None


def test_a_record_at_rest_has_no_frequency() -> None:
    t = np.arange(2000) / RATE
    rng = np.random.default_rng(0)
    x, f = 3e-3 + rng.normal(0.0, 1e-6, 2000), 5.0 + rng.normal(0.0, 0.01, 2000)
    analysis = analyse(Signals(t, x, f, periods(t), "position"))
    assert np.isnan(motion_of(analysis.record).frequency_hz)
    assert analysis.phases.contact_point is None


@pytest.mark.parametrize(("cycles", "strokes"), [(0.5, 0), (0.9, 1), (1.6, 2), (2.6, 4), (3.6, 6)])
def test_a_motion_of_few_cycles_has_whole_strokes_and_a_frequency_from_five_strokes_on(
    cycles: float, strokes: int
) -> None:
    t = np.arange(round(400.0 * cycles)) / 400.0
    rng = np.random.default_rng(0)
    x = 3e-3 + 1e-3 * np.sin(2.0 * np.pi * t + 1.0) + rng.normal(0.0, 1e-6, len(t))
    f = 5.0 + 2000.0 * (x - 3e-3) + rng.normal(0.0, 0.01, len(t))
    analysis = analyse(Signals(t, x, f, periods(t), "position"))
    motion = motion_of(analysis.record)
    assert motion.strokes == strokes
    assert np.isfinite(motion.frequency_hz) == (strokes >= 5)
    line = motion_line({"motion": motion._asdict()})
    assert ("no cycles" in line) == (strokes == 0)
    assert (f"{strokes} whole stroke" in line) == (0 < strokes < 5)


@settings(deadline=None)
@given(st.floats(0.5, 5.0), st.floats(0.0, 20.0), st.floats(0.0, 20.0), st.floats(0.0, 6.3))
def test_the_frequency_of_a_sine_does_not_depend_on_the_rests(
    frequency: float, before: float, after: float, start: float
) -> None:
    t = np.arange(round(RATE * (before + after + 12.0 / frequency))) / RATE
    x = np.sin(start + 2.0 * np.pi * frequency * np.clip(t - before, 0.0, 12.0 / frequency))
    assert cycle_frequency(x, 1.0 / RATE) == pytest.approx(frequency, rel=0.01)


@pytest.mark.parametrize("rate", [10.0, 20.0, 50.0])
def test_the_bandwidth_of_the_conditioning_is_at_most_half_of_the_sampling_rate(
    rate: float,
) -> None:
    t = np.arange(round(30.0 * rate)) / rate
    x = 1e-3 * np.sin(2.0 * np.pi * t)
    f = 2000.0 * x + np.random.default_rng(0).normal(0.0, 0.01, len(t))
    signals = Signals(t, x, f, periods(t), "position")
    assert evaluate(signals, EstimateSettings()).bandwidth <= 0.5 * rate * (1.0 + 1e-9)


@pytest.mark.parametrize("corner", [0.1, 0.4])
def test_the_amplitude_of_a_motion_with_corners_is_not_that_of_the_smoothed_position(
    corner: float,
) -> None:
    """The tip rests for 0.05 and 0.2 s at the highest position."""
    t = np.arange(0.0, 10.0, 2e-3)
    x = 3e-3 + 1e-3 * np.interp(
        t % 1.0, [0.0, 0.5 - 0.5 * corner, 0.5, 1.0], [-1.0, 1.0, 1.0, -1.0]
    )
    rng = np.random.default_rng(0)
    f = 500.0 * x + rng.normal(0.0, 5e-3, len(t))
    signals = Signals(t, x + rng.normal(0.0, 2e-7, len(t)), f, periods(t), "position")
    motion = motion_of(analyse(signals).record)
    assert motion.amplitude_m == pytest.approx(1e-3, rel=0.01)
    assert motion.travel_m == pytest.approx(2e-3, rel=0.005)
