from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from estimation.excitation import dominant_frequency
from teleop.errors import InputError
from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.online.datum import moving_part
from teleop.evaluation.reading.signals import Signals, periods, read_signals
from teleop.evaluation.settings import EstimateSettings

MACH1 = Path(__file__).parents[3] / "examples" / "data" / "mach1"
BATCH = {"0.2Hz": (940_800, 66_400), "0.5Hz": (980_000, 23_000), "1Hz": (1_007_800, 10_400)}
"""Batch least squares (k, b), from the README beside the data."""


def preloaded(b=20.0, k=2000.0, f0=7.0, x0=3e-3, name="Position", jitter=0.0):
    """A rest, ten cycles of a 1 Hz sine about a preload, a rest; at 200 Hz."""
    rng = np.random.default_rng(0)
    t = np.cumsum(5e-3 * (1.0 + jitter * rng.uniform(-1.0, 1.0, 2400)))
    s = np.clip(t - 1.0, 0.0, 10.0)
    w = 2 * np.pi
    x, v = 1e-3 * np.sin(w * s), 1e-3 * w * np.cos(w * s) * ((s > 0) & (s < 10.0))
    f = f0 + k * x + b * v + rng.normal(0.0, 1e-3, t.size)
    return Signals(t, x0 + x, f, periods(t), name)


@pytest.mark.parametrize("frequency", BATCH)
def test_measured_indentation_agrees_with_batch_least_squares(frequency):
    path = MACH1 / f"sinusoid_{frequency}.csv"
    k, b = BATCH[frequency]
    evaluation = evaluate(read_signals(path), EstimateSettings())
    summary = evaluation.summary()
    rls, me, batch = (*map(summary["estimates"].get, ("rls", "me")), summary["least_squares"])
    assert rls["k"] == pytest.approx(k, rel=0.03)
    assert rls["b"] == pytest.approx(b, rel=0.15)
    assert me["k"] == pytest.approx(k, rel=0.03)
    assert batch["k"] == pytest.approx(k, rel=0.01)
    assert rls["one_step_rms"] < 1.2 * batch["one_step_rms"]
    assert summary["estimates"]["ai"]["k"] == pytest.approx(k, rel=0.05)


@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_finds_the_parameters_about_a_preload(jitter):
    summary = evaluate(preloaded(jitter=jitter), EstimateSettings()).summary()
    for name in ("rls", "me"):
        assert summary["estimates"][name]["k"] == pytest.approx(2000.0, rel=0.03)
        assert summary["estimates"][name]["b"] == pytest.approx(20.0, rel=0.15)
    assert summary["least_squares"]["b"] == pytest.approx(20.0, rel=0.02)
    assert summary["jitter"] == pytest.approx(jitter, abs=0.05)


def test_rest_before_and_after_the_motion_is_left_out_unless_asked_for():
    recording = preloaded()
    part = evaluate(recording, EstimateSettings())
    whole = evaluate(recording, EstimateSettings(whole=True))
    assert part.t[0] == pytest.approx(1.0, abs=0.02)
    assert part.t[-1] == pytest.approx(11.0, abs=0.02)
    assert len(whole.t) == len(recording.t)


def test_moving_part_of_a_recording_without_rest_is_all_of_it():
    x = np.sin(np.linspace(0.0, 20.0, 1000))
    assert len(x[moving_part(x)]) >= 990


@pytest.mark.parametrize(
    ("datum", "x0", "f0"),
    [
        ("file", 0.0, 0.0),
        ("start", 3e-3, 7.0),
        ("mean", 3e-3, 7.0),
        ("2.5mm,1.5N", 2.5e-3, 1.5),
        ("-10um, 2e3mN", -1e-5, 2.0),
    ],
)
def test_datum_is_where_it_is_asked_for(datum, x0, f0):
    got = evaluate(preloaded(), EstimateSettings(datum=datum)).datum
    assert got.x == pytest.approx(x0, abs=2e-5)
    assert got.f == pytest.approx(f0, abs=0.05)


def test_the_name_of_a_column_does_not_change_the_answer():
    one, other = (
        evaluate(preloaded(name=name), EstimateSettings()) for name in ("Displacement", "Position")
    )
    assert one.datum == other.datum
    assert one.datum.source == "mean of the motion"
    assert one.analysis.result == other.analysis.result


def test_the_papers_preset_takes_the_papers_settings():
    evaluation = evaluate(preloaded(x0=0.0, f0=0.0), EstimateSettings(preset="paper", cube="hard"))
    assert evaluation.preset.grid.candidates == 7913
    assert evaluation.preset.adaptation_gain == (50_000.0, 1e7)
    assert evaluation.bandwidth == 20.0


def test_a_glitch_of_the_sensor_does_not_discard_the_recording():
    recording = preloaded()
    recording.x[1200] += 0.1
    assert evaluate(recording, EstimateSettings()).t[0] == pytest.approx(1.0, abs=0.02)


def test_a_drift_does_not_hide_the_motion():
    recording = preloaded()
    drift = recording.x + 0.5e-3 * recording.t
    assert dominant_frequency(drift, recording.dt) == pytest.approx(1.0, rel=0.1)


def test_too_few_moving_samples_are_reported():
    recording = Signals(*(channel[195:206] for channel in preloaded()[:4]), "Position")
    with pytest.raises(InputError, match="samples move: expected at least 10"):
        evaluate(recording, EstimateSettings())


def test_dominant_frequency_is_that_of_the_motion():
    recording = preloaded()
    motion = moving_part(recording.x)
    assert dominant_frequency(recording.x[motion], recording.dt[motion]) == pytest.approx(
        1.0, rel=0.05
    )


@pytest.mark.parametrize("conditioning", ["matched", "svf", "foaw", "difference"])
def test_every_conditioning_finds_the_stiffness(conditioning):
    summary = evaluate(preloaded(), EstimateSettings(conditioning=conditioning)).summary()
    assert summary["estimates"]["rls"]["k"] == pytest.approx(2000.0, rel=0.05)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x": np.zeros(2400)}, "nothing moves"),
        ({"f": np.zeros(2400)}, "the force is the same in every sample"),
        ({"x": np.arange(2400) * 5e-324}, "the position changes by 1.*e-320 in SI units"),
        ({"f": np.arange(2400) * 1e-300}, "the force changes by 2.*e-297 in SI units"),
    ],
)
def test_a_recording_that_shows_nothing_is_reported(change, message):
    recording = preloaded()._replace(**change)
    with pytest.raises(InputError, match=message):
        evaluate(recording, EstimateSettings())


@pytest.mark.parametrize(
    "datum", ["middle", "1mm", "1mm,2", "1mm,2N,3", "1N,2mm", "", "mm,N", "1..2mm,3N", "1e400mm,1N"]
)
def test_a_datum_that_cannot_be_read_is_reported(datum):
    with pytest.raises(InputError, match="expected auto, contact, file, start, mean"):
        evaluate(preloaded(), EstimateSettings(datum=datum))


def test_a_bandwidth_that_is_not_positive_is_reported():
    with pytest.raises(InputError, match="bandwidth must be positive"):
        evaluate(preloaded(), EstimateSettings(bandwidth=0.0))


@pytest.mark.parametrize("resolution", [1e300, 1e-300, -1.0])
def test_a_resolution_that_no_position_sensor_has_is_refused(resolution):
    with pytest.raises(InputError, match="resolution of the position .*: expected 1e-12 to 1 m"):
        evaluate(preloaded(), EstimateSettings(resolution=resolution))
