"""For a sine, k and b are k' and k''/omega, whatever the number of cycles."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from estimation.filters import Play
from estimation.testing_records import relaxed
from estimation.transmission import TransmissionCalibration
from teleop.cli import main
from teleop.evaluation.batch.analysis import analyse, motion_of
from teleop.evaluation.batch.smoothed_record import smoothed_signals
from teleop.evaluation.batch.thresholds import SINE_SHARE
from teleop.evaluation.reading.signals import Signals, periods

FREQUENCY = 0.5
OMEGA = 2.0 * math.pi * FREQUENCY
TIMES = ((200.0, 0.3), (150.0, 5.0))
STORAGE = 300.0 + sum(k * (OMEGA * tau) ** 2 / (1.0 + (OMEGA * tau) ** 2) for k, tau in TIMES)
DAMPING = 2.0 + sum(k * tau / (1.0 + (OMEGA * tau) ** 2) for k, tau in TIMES)


def relaxing_sine(cycles: int) -> Signals:
    t = np.arange(round(cycles / FREQUENCY * 1000.0)) / 1000.0
    x = 6e-3 + 2e-3 * np.sin(OMEGA * t)
    f = 300.0 * x + 4e-3 * OMEGA * np.cos(OMEGA * t)
    f += sum(k * relaxed(x, 1000.0, tau) for k, tau in TIMES)
    t, x, f = t[::20], x[::20], f[::20]
    f = f + np.random.default_rng(cycles).normal(0.0, 5e-3, len(f))
    return Signals(t, x, f, periods(t), "position")


@pytest.mark.parametrize("cycles", [3, 5, 8, 15])
def test_b_of_a_relaxing_body_is_the_equivalent_viscous_damping(cycles):
    found = analyse(relaxing_sine(cycles))
    result = found.result
    assert result.b == pytest.approx(DAMPING, rel=0.05)
    assert result.b_low <= DAMPING <= result.b_high
    assert result.k == pytest.approx(STORAGE, rel=0.02)
    assert result.k_low <= STORAGE <= result.k_high
    assert result.damping_at_hz == pytest.approx(FREQUENCY, rel=0.01)
    assert found.complex_stiffness()["loss_n_per_m"] == pytest.approx(DAMPING * OMEGA, rel=0.05)


def test_b_of_a_ramp_and_hold_has_no_frequency():
    t = np.arange(0.0, 30.0, 0.01)
    x = np.interp(t, [0.0, 2.0, 4.0], [0.0, 0.0, 4e-3])
    f = 300.0 * x + 200.0 * relaxed(x, 100.0, 2.0)
    f += np.random.default_rng(0).normal(0.0, 2e-3, len(t))
    result = analyse(Signals(t, x, f, periods(t), "position")).result
    assert result.k is not None
    assert result.damping_at_hz is None


def test_the_command_states_the_frequency_of_the_damping(tmp_path, capsys):
    signals = relaxing_sine(5)
    path = tmp_path / "sine.csv"
    columns = np.column_stack([signals.t, signals.x * 1e3, signals.f])
    np.savetxt(path, columns, delimiter=",", header="Time [s],Position [mm],Force [N]", comments="")
    assert main(["estimate", str(path)]) == 0
    assert "equivalent viscous damping" in capsys.readouterr().out
    assert main(["estimate", str(path), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)["result"]
    assert result["damping_at_hz"] == pytest.approx(FREQUENCY, rel=0.01)


def test_a_sine_with_outliers_of_the_position_is_a_sine():
    t = np.arange(2000) / 200.0
    rng = np.random.default_rng(0)
    x = 3e-3 + 1e-3 * np.sin(2.0 * np.pi * t)
    f = 5.0 + 2000.0 * (x - 3e-3) + rng.normal(0.0, 0.01, len(t))
    x[rng.choice(len(t), 5, replace=False)] += 0.02
    assert smoothed_signals(Signals(t, x, f, periods(t), "position")).sinusoidal


def test_an_oscillation_of_the_drive_within_the_lost_motion_leaves_a_sine_a_sine():
    t = np.arange(10_000) / 1000.0
    tip = 2e-3 * np.sin(4.0 * np.pi * t)
    x = tip + 2e-5 * np.sin(30.0 * np.pi * t)
    f = 20.0 + 5000.0 * tip + np.random.default_rng(0).normal(0.0, 0.01, len(t))
    record = smoothed_signals(Signals(t, x, f, periods(t), "position"))
    assert record.sinusoidal
    assert record.fundamental_share == pytest.approx(1.0 / (1.0 + 0.075**2), abs=2e-3)


def test_a_sine_with_gaps_is_a_sine():
    t = np.arange(10_000) / 1000.0
    t = t[np.abs(t % 3.7 - 3.0) > 0.15]
    x = 2e-3 * np.sin(2.0 * np.pi * t)
    f = 20.0 + 5000.0 * x + np.random.default_rng(0).normal(0.0, 0.01, len(t))
    gaps = tuple((1 + np.flatnonzero(np.diff(t) > 0.1)).tolist())
    record = smoothed_signals(Signals(t, x, f, periods(t), "position", gaps))
    assert len(record.starts) == 3
    assert record.sinusoidal


def test_a_slow_motion_with_small_cycles_is_no_sine():
    t = np.arange(10_000) / 1000.0
    x = 2e-3 * np.sin(0.2 * np.pi * t) + 3e-4 * np.sin(2.0 * np.pi * t)
    f = 20.0 + 5000.0 * x + np.random.default_rng(0).normal(0.0, 0.01, len(t))
    assert not smoothed_signals(Signals(t, x, f, periods(t), "position")).sinusoidal


def test_a_sum_of_sines_of_equal_amplitude_is_no_sine():
    """The velocity is mainly at the two highest frequencies, so that its own share is 0.93."""
    t = np.arange(10_000) / 500.0
    tones = ((0.4, 0.0), (1.1, 1.3), (2.3, 2.9), (3.7, 4.0))
    x = 5e-3 + sum(8e-4 * np.sin(2.0 * np.pi * f * t + p) for f, p in tones)
    force = 500.0 * x + 400.0 * relaxed(x, 500.0, 0.15) + 1.5 * np.gradient(x, t)
    force += np.random.default_rng(0).normal(0.0, 0.01, len(t))
    found = analyse(Signals(t, x, force, periods(t), "position"))
    assert not found.record.sinusoidal
    (time,) = found.result.times
    assert time.low < 0.15 < time.high
    assert time.value == pytest.approx(0.15, rel=0.05)
    assert found.result.b == pytest.approx(1.5, abs=0.05)


def test_the_fundamental_share_of_a_triangle_wave_is_that_of_its_fourier_series():
    t = np.arange(10_000) / 1000.0
    x = 2e-3 * (1.0 + 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * t)))
    f = 5.0 + 5000.0 * x + np.random.default_rng(0).normal(0.0, 0.01, len(t))
    record = smoothed_signals(Signals(t, x, f, periods(t), "position"))
    assert not record.sinusoidal
    assert record.fundamental_share == pytest.approx(
        1.0 / sum(n**-2.0 for n in (1, 3, 5, 7, 9)), abs=0.01
    )


def test_stiffness_and_damping_of_two_kinds_are_not_compared_between_files(tmp_path, capsys):
    sine = relaxing_sine(5)
    t = np.arange(0.0, 30.0, 0.01)
    x = np.interp(t, [0.0, 2.0, 4.0], [0.0, 0.0, 4e-3])
    f = 300.0 * x + 200.0 * relaxed(x, 100.0, 2.0)
    f += np.random.default_rng(0).normal(0.0, 2e-3, len(t))
    files = []
    for name, columns in (("sine", (sine.t, sine.x, sine.f)), ("hold", (t, x, f))):
        files.append(str(tmp_path / f"{name}.csv"))
        table = np.column_stack([columns[0], columns[1] * 1e3, columns[2]])
        header = "Time [s],Position [mm],Force [N]"
        np.savetxt(files[-1], table, delimiter=",", header=header, comments="")
    assert main(["estimate", *files, "--json"]) == 0
    together = json.loads(capsys.readouterr().out)["together"]
    assert not together["ratios"]  # k' of the sine, and the tangent of the hold
    for symbol in ("k", "b"):
        assert any(one.startswith(f"{symbol} is not compared") for one in together["reasons"])


@pytest.mark.parametrize("hold", [0.0, 0.15, 0.3])
def test_the_kind_of_b_follows_from_the_shape_of_the_motion(hold):
    """Minimum-jerk strokes on an elastic body in contact, with holds between the strokes."""
    t = np.arange(0.0, 20.0, 4e-3)
    phase, stroke = t % 1.0, 0.5 - hold
    shares = (np.clip((phase - start) / stroke, 0.0, 1.0) for start in (0.0, 0.5))
    inwards, outwards = (s**3 * (10.0 - 15.0 * s + 6.0 * s**2) for s in shares)
    rng = np.random.default_rng(0)
    x = 4e-3 + 3e-3 * (inwards - outwards)
    f = 2000.0 * x + 3.0 * np.gradient(x, t) + rng.normal(0.0, 0.02, len(t))
    x = x + rng.normal(0.0, 1e-6, len(t))
    found = analyse(Signals(t, x, f, periods(t), "position"))
    assert found.result.k == pytest.approx(2000.0, rel=0.01)
    sine = found.record.fundamental_share > SINE_SHARE
    assert sine == (hold == 0.0)
    assert (found.result.damping_at_hz is not None) == sine
    assert motion_of(found.record).fundamental_share == found.record.fundamental_share


def test_a_relaxing_body_behind_lost_motion_has_its_storage_stiffness():
    """The tip rests at each reversal, and polynomials would take the relaxation for curvature."""
    lost = 1e-4
    t = np.arange(0.0, 24.0, 1e-3)
    x = 6e-3 + 2e-3 * np.sin(OMEGA * t)
    tip = Play(lost).run(x)
    f = 300.0 * tip + 2.0 * np.gradient(tip, t)
    f += sum(k * relaxed(tip, 1000.0, tau) for k, tau in TIMES)
    t, tip, f = t[::5], tip[::5], f[::5]
    f = f + np.random.default_rng(1).normal(0.0, 1e-3, len(f))
    signals = Signals(t, tip, f, periods(t), "position")
    result = analyse(signals, TransmissionCalibration(lost_motion=lost)).result
    assert result.storage_at_hz == pytest.approx(FREQUENCY, rel=0.01)
    assert result.k == pytest.approx(STORAGE, rel=1e-3)
    assert result.b == pytest.approx(DAMPING, rel=0.01)


def test_the_loss_of_a_nonlinear_elastic_body_behind_lost_motion_is_that_of_its_damping():
    """The fundamental of its elastic force has another phase than that of the position."""
    lost = 1.5e-4
    t = np.arange(0.0, 24.0, 5e-3)
    tip = Play(lost).run(6e-3 + 2e-3 * np.sin(OMEGA * t))
    u = tip - 6e-3
    f = 3.0 + 800.0 * u + 1e5 * u**2 + 4e7 * u**3 + 1.0 * np.gradient(tip, t)
    f += np.random.default_rng(2).normal(0.0, 1e-3, len(t))
    signals = Signals(t, tip, f, periods(t), "position")
    result = analyse(signals, TransmissionCalibration(lost_motion=lost)).result
    assert result.damping_at_hz == pytest.approx(FREQUENCY, rel=0.01)
    assert result.b == pytest.approx(1.0, rel=0.05)
