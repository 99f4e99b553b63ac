from __future__ import annotations

import json
import re
import shlex

import numpy as np
import pytest
from scipy.signal import lfilter

from estimation.filters import Play
from teleop.cli import main
from teleop.errors import InputError
from teleop.files import new_file
from teleop.recording.export_formats import TableFile
from teleop.rig import force_lag
from teleop.rig.force_lag import measure_lag, measure_simulated_lag


def test_lag_and_lost_motion_of_the_simulated_rig_are_found():
    measured, true = measure_simulated_lag()
    assert measured.lag.value == pytest.approx(true.force_lag, rel=0.03)
    lost_motion = true.transmission.lost_motion
    assert measured.lost_motion.value == pytest.approx(lost_motion, abs=3e-6)
    in_series = 1.0 / 5000.0 + true.transmission.compliance
    # The simulated force channel is linear between ticks of 1 ms, which makes a sine smaller by
    # (omega dt)^2 / 12: on average over the chirp from 0.5 to 4 Hz by 2e-5.
    in_series *= 1.0 + (2e-3 * np.pi) ** 2 * (0.25 + 2.0 + 16.0) / 3.0 / 12.0
    assert measured.k.low <= 1.0 / in_series <= measured.k.high
    compliance = measured.compliance(5000.0)
    assert compliance.low <= in_series - 1.0 / 5000.0 <= compliance.high
    assert compliance.high - compliance.low < 0.05e-6


def chirp(t):
    return 2e-3 * np.sin(2 * np.pi * (1.0 + 0.8 * t) * t)


def two_amplitudes(t):
    return np.where(t < 2.5, 2e-3, 0.6e-3) * np.sin(2 * np.pi * 2.0 * t)


def one_sine(t):
    return 2e-3 * np.sin(2 * np.pi * 2.0 * t)


def spring(lag, seed=0, noise=0.02, lost_motion=0.0, motion=chirp, rate=1000):
    """A spring of 8 kN/m behind lost motion and a lag, solved by the trapezoidal rule."""
    rng = np.random.default_rng(seed)
    dt = 1e-4
    t = np.arange(50_001) * dt  # n - 1 samples have small prime factors: quick transforms
    x = motion(t)
    tip, f = np.zeros_like(t), np.zeros_like(t)
    a = 0.5 * dt / lag
    for n in range(1, len(t)):
        tip[n] = min(max(tip[n - 1], x[n] - lost_motion), x[n] + lost_motion)
        f[n] = ((1.0 - a) * f[n - 1] + a * 8000.0 * (tip[n] + tip[n - 1])) / (1.0 + a)
    step = round(1.0 / (rate * dt))
    sampled = f[::step] + rng.normal(0.0, noise, len(t[::step]))
    return x[::step], sampled, np.full(len(sampled), 1.0 / rate)


@pytest.mark.parametrize(
    ("lag", "lost_motion", "motion"),
    [
        (1e-3, 100e-6, chirp),
        (10e-3, 5e-6, two_amplitudes),
    ],
)
def test_the_intervals_hold_lag_and_lost_motion_about_as_often_as_they_say(
    lag, lost_motion, motion
):
    """Of 12 records, 9 to 12 is what 95 % allow but once in 400 times."""
    x, f, dt = spring(lag, 0, 0.0, lost_motion, motion, rate=500)
    rng = np.random.default_rng(3)
    held = np.zeros(2)
    for _ in range(12):
        found = measure_lag(x, f + rng.normal(0.0, 0.2, len(f)), dt)
        assert found.separable
        held += (
            found.lag.low <= lag <= found.lag.high,
            found.lost_motion.low <= lost_motion <= found.lost_motion.high,
        )
    assert (held >= 9).all(), held


def test_lag_and_lost_motion_from_one_record_have_opposite_errors():
    found = measure_lag(*spring(3e-3, 0, 0.05, 4e-5, rate=200))
    assert -1.0 <= found.correlation < -0.5
    assert found.calibration().lag_lost_motion_correlation == found.correlation


@pytest.mark.parametrize(("lag", "lost_motion"), [(6e-3, 0.0), (4.4e-3, 40e-6), (1e-3, 100e-6)])
def test_one_amplitude_and_one_frequency_do_not_separate_them(lag, lost_motion):
    found = measure_lag(*spring(lag, 0, 0.02, lost_motion, one_sine))
    assert not found.separable
    assert found.lag.low <= lag <= found.lag.high
    assert found.lost_motion.low <= lost_motion <= found.lost_motion.high
    assert found.summary()["lost_motion_m"] is None


def delayed_spring(seed, share, lag, lost_motion):
    """A spring whose force has a pure delay of `share * lag`, then a lag of first order."""
    rng = np.random.default_rng(seed)
    step, rate = 1e-4, 500
    t = np.arange(50_001) * step
    x = chirp(t)
    tip = x.copy()
    for n in range(1, len(t)):
        tip[n] = min(max(tip[n - 1], x[n] - lost_motion), x[n] + lost_motion)
    f = 8000.0 * np.interp(t - share * lag, t, tip)
    constant = (1.0 - share) * lag
    if constant:
        a = step / (2.0 * constant + step)
        f = lfilter([a, a], [1.0, 2.0 * a - 1.0], f)
    every = round(1.0 / (rate * step))
    f = f[::every] + rng.normal(0.0, 0.2, len(f[::every]))
    return x[::every], f, np.full(len(f), 1.0 / rate)


@pytest.mark.parametrize(("share", "lag", "lost_motion"), [(0.5, 4.4e-3, 40e-6), (1.0, 6e-3, 0.0)])
def test_a_lag_that_is_a_pure_delay_is_measured_like_a_first_order_lag(share, lag, lost_motion):
    """Of 10 records, 7 to 10 is what 95 % allow but once in 1000 times."""
    held = np.zeros(3)
    for seed in range(10):
        found = measure_lag(*delayed_spring(seed, share, lag, lost_motion))
        held += (
            found.lag.low <= lag <= found.lag.high,
            found.lost_motion.low <= lost_motion <= found.lost_motion.high,
            found.k.low <= 8000.0 <= found.k.high,
        )
        assert found.lag.high - found.lag.low < 0.02 * lag
    assert (held >= 7).all(), held


def covered(found, lag, lost_motion, k):
    """Return whether each of the three intervals contains the true value."""
    return np.array(
        [
            found.lag.low <= lag <= found.lag.high,
            found.lost_motion.low <= lost_motion <= found.lost_motion.high,
            found.k.low <= k <= found.k.high,
        ]
    )


@pytest.mark.parametrize(("rate", "step", "noise"), [(1000, 4e-6, 0.002), (100, 1e-7, 0.2)])
def test_neither_a_coarse_encoder_nor_a_slow_rate_moves_lag_and_lost_motion(rate, step, noise):
    """Of 12 records, 9 to 12 is what 95 % allow but once in 400 times."""
    x, f, dt = spring(3e-3, 0, 0.0, 60e-6, two_amplitudes, rate)
    rng = np.random.default_rng(4)
    held = np.zeros(3)
    for _ in range(12):
        position = np.round((x + rng.normal(0.0, 0.5 * step, len(x))) / step) * step
        found = measure_lag(position, f + rng.normal(0.0, noise, len(f)), dt)
        held += covered(found, 3e-3, 60e-6, 8000.0)
    assert (held >= 9).all(), held


def test_the_intervals_contain_coloured_noise_of_the_force():
    """Of 12 records, 9 to 12 is what 95 % allow but once in 400 times."""
    x, f, dt = spring(3e-3, 0, 0.0, 60e-6, two_amplitudes, 500)
    rng = np.random.default_rng(5)
    held = np.zeros(3)
    for _ in range(12):
        noise = lfilter([0.1], [1.0, -0.9], rng.normal(0.0, 1.0, len(f)))
        held += covered(measure_lag(x, f + noise, dt), 3e-3, 60e-6, 8000.0)
    assert (held >= 9).all(), held


def test_the_play_by_strokes_is_that_of_each_sample():
    x = np.cumsum(np.random.default_rng(6).normal(size=2000))
    np.testing.assert_allclose(force_lag.Strokes(x).played(2.5), Play(2.5).run(x), atol=1e-12)


def test_one_sine_does_not_determine_the_stiffness_better_than_its_lost_motion():
    x, f, dt = spring(2e-3, 0, 0.02, 60e-6, one_sine)
    found = measure_lag(x, f, dt)
    assert not found.separable
    assert found.k.low <= 8000.0 <= found.k.high


def test_a_lag_alone_is_not_taken_for_lost_motion():
    found = measure_lag(*spring(6e-3))
    assert found.lost_motion.low == 0.0
    assert found.lost_motion.high < 1e-6


def test_a_recording_that_does_not_fit_a_lagging_spring_is_reported():
    x, f, dt = spring(6e-3)
    with pytest.raises(InputError, match="positive in compression"):
        measure_lag(x, -f, dt)
    with pytest.raises(InputError, match="ahead of the position by 12.5"):
        measure_lag(x, 8000.0 * x + 100.0 * np.gradient(x, 1e-3), dt)
    with pytest.raises(InputError, match="zero throughout"):
        measure_lag(x, 0.0 * f, dt)


def written(path, x, f, dt):
    """Write a recording as CSV, and return its path."""
    columns = {"Time": np.cumsum(dt), "Displacement": x, "Force": f}
    with new_file(path) as file:
        TableFile(file).write((columns, {"Time": "s", "Displacement": "m", "Force": "N"}))
    return path


@pytest.mark.parametrize("lost_motion", [0.0, 50e-6])
def test_a_force_without_lag_is_measured(lost_motion):
    x = chirp(np.arange(0.0, 5.0, 1e-3))
    tip = x.copy()
    for n in range(1, len(x)):
        tip[n] = min(max(tip[n - 1], x[n] - lost_motion), x[n] + lost_motion)
    force = 8000.0 * tip + np.random.default_rng(5).normal(0.0, 0.02, len(x))
    found = measure_lag(x, force, np.full(len(x), 1e-3))
    assert found.lag.low == 0.0
    assert found.lag.high < 2e-5
    assert found.lost_motion.low <= lost_motion <= found.lost_motion.high


def test_the_measured_values_of_a_known_spring_correct_results(tmp_path, capsys):
    """The spring of 8 kN/m is the one of 9 kN/m in series with the transmission."""
    path = written(tmp_path / "spring.csv", *spring(4e-3, lost_motion=40e-6))
    out = tmp_path / "transmission.toml"
    assert main(["lag", str(path), "--stiffness", "9000N/m", "--out", str(out), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    true = 1.0 / 8000.0 - 1.0 / 9000.0
    # the difference of two compliances, each known to 0.02 %
    assert printed["compliance_m_per_n"] == pytest.approx(true, abs=2e-4 / 8000.0)
    assert main(["estimate", str(path), "--transmission", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)["result"]
    assert result["k_tip"]["value"] == pytest.approx(9000.0, rel=1e-3)
    assert result["b_low"] <= 0.0 <= result["b_high"]
    assert main(["lag", str(path), "--out", str(out)]) == 2
    assert "exists" in capsys.readouterr().err
    assert main(["lag", str(path), "--stiffness", "7000N/m"]) == 2
    assert "expected at most that of the spring" in capsys.readouterr().err


def test_the_command_measures_a_recording(tmp_path, capsys):
    path = written(tmp_path / "spring.csv", *spring(6e-3))
    assert main(["lag", str(path), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["lag_s"] == pytest.approx(6e-3, rel=0.02)
    assert printed["lag_low_s"] < 6e-3 < printed["lag_high_s"]
    assert printed["lost_motion_low_m"] <= printed["lost_motion_m"] <= printed["lost_motion_high_m"]
    assert main(["lag"]) == 0
    out = capsys.readouterr().out
    assert "true lag (simulated)" in out
    assert "  0% of it is a pure delay, 95 % interval 0% to 3%\n" in out


def test_the_printed_command_corrects_for_all_measured_values(tmp_path, capsys):
    assert main(["lag", "--json"]) == 0
    measured = json.loads(capsys.readouterr().out)
    assert main(["lag"]) == 0
    (command,) = re.findall(r"correct the results with: teleop (.*)", capsys.readouterr().out)
    path = written(tmp_path / "spring.csv", *spring(6e-3))
    words = [str(path) if word == "FILE" else word for word in shlex.split(command)]
    assert main([*words, "--json"]) == 0
    used = json.loads(capsys.readouterr().out)["transmission"]
    for name in ("force_lag_s", "lost_motion_m", "compliance_m_per_n"):
        assert used[name] == pytest.approx(measured[name.replace("force_", "")], rel=1e-3)


def test_the_command_says_when_a_recording_cannot_separate_them(tmp_path, capsys):
    samples = spring(4.4e-3, lost_motion=40e-6, motion=one_sine)
    path = written(tmp_path / "spring.csv", *samples)
    assert main(["lag", str(path)]) == 0
    assert "cannot be separated" in capsys.readouterr().out


def test_a_file_with_too_many_samples_is_refused(tmp_path, refused, monkeypatch):
    monkeypatch.setattr(force_lag, "MOST_SAMPLES", 2)
    path = tmp_path / "long.csv"
    path.write_text("Time [s],Position [mm],Force [N]\n0,0,0\n0.1,1,2\n0.2,2,4\n")
    assert "long.csv: 3 samples: expected at most 2" in refused("lag", path)
