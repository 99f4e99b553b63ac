from __future__ import annotations

import json

import numpy as np
import pytest

from teleop.cli import main
from teleop.errors import InputError
from teleop.files import new_file
from teleop.recording.export_formats import write_table
from teleop.rig.force_lag import measure_lag
from teleop.rig.reference_spring import measure_simulated_lag


@pytest.mark.parametrize("cube", ["soft", "medium", "hard"])
def test_the_lag_of_the_simulated_channel_is_found_within_two_percent(cube):
    measured, true = measure_simulated_lag(cube)
    assert measured.lag.value == pytest.approx(true, rel=0.02)
    assert measured.k == pytest.approx(5000.0, rel=0.01)


def spring(lag, seed=0, noise=0.02):
    """Return a chirp on a spring of 8 kN/m with a lagging force, from the trapezoidal rule."""
    rng = np.random.default_rng(seed)
    dt = 1e-4
    t = np.arange(0.0, 5.0, dt)
    x = 2e-3 * np.sin(2 * np.pi * (1.0 + 0.8 * t) * t)
    f = np.zeros_like(t)
    for n in range(1, len(t)):
        a = 0.5 * dt / lag
        f[n] = ((1.0 - a) * f[n - 1] + a * 8000.0 * (x[n] + x[n - 1])) / (1.0 + a)
    return x[::10], f[::10] + rng.normal(0.0, noise, len(t[::10])), np.full(len(t[::10]), 1e-3)


def test_the_coverage_of_the_interval_is_about_95_percent():
    held = 0
    for seed in range(20):
        lag = measure_lag(*spring(6e-3, seed, noise=0.2)).lag
        held += lag.low <= 6e-3 <= lag.high
    assert 15 <= held <= 20


def test_a_recording_that_does_not_fit_a_lagging_spring_is_reported():
    x, f, dt = spring(6e-3)
    with pytest.raises(InputError, match="positive in compression"):
        measure_lag(x, -f, dt)
    with pytest.raises(InputError, match="the estimated lag is 0.00 ms"):
        measure_lag(x, 8000.0 * x + 100.0 * np.gradient(x, 1e-3), dt)
    with pytest.raises(InputError, match="zero throughout"):
        measure_lag(x, 0.0 * f, dt)


def test_the_command_measures_a_recording(tmp_path, capsys):
    x, f, dt = spring(6e-3)
    path = tmp_path / "spring.csv"
    with new_file(path) as file:
        write_table(
            file,
            {"Time": np.cumsum(dt), "Displacement": x, "Force": f},
            {"Time": "s", "Displacement": "m", "Force": "N"},
        )
    assert main(["lag", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["lag_s"] == pytest.approx(6e-3, rel=0.02)
    assert main(["lag", "--cube", "hard"]) == 0
    assert "true lag (simulated)" in capsys.readouterr().out
