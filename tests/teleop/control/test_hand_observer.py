"""The observer of the hand's force against the true force of a simulated hand."""

from __future__ import annotations

import importlib.util
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers import CHANNELS, Ages, Measurement
from drivers.rig_file import parse_rig_file
from sim_backend import ForceMaster
from teleop.cli import main
from teleop.control.hand_observer import BANDWIDTH, HandObserver
from teleop.recording.recording import load
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.columns import OBSERVED
from teleop.trial.run import run_trial

ROOT = Path(__file__).parents[3]
TRIAL = TrialSettings(
    clock="virtual", duration=2.0, estimators=("rls",), force_master=ForceMaster()
)
RIG = (ROOT / "rigs" / "odrive-torque.toml").read_text()


@pytest.fixture(scope="module")
def benchmark():
    path = ROOT / "benchmarks" / "hand_observer.py"
    spec = importlib.util.spec_from_file_location("hand_observer_benchmark", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def measurement(time, position, force):
    ages = Ages(*(0.0 for _ in CHANNELS))
    return Measurement(time, force, position, 0.0, 0.0, 0.0, ages, "", False)


@pytest.mark.parametrize("latency", [0, 2])
def test_a_sine_of_the_hand_is_found_after_the_lag_of_the_filter(latency):
    """The motion is exact; the coupling has a force of its own, which acts late."""
    mass, friction, period, rate = 0.3, 1.5, 1e-3, 2.0 * math.pi * 2.0
    observer = HandObserver(mass, friction, latency)
    times = np.arange(0.0, 3.0, period)
    x = 5e-3 * np.sin(rate * times)
    v, a = 5e-3 * rate * np.cos(rate * times), -(rate**2) * x
    coupled = 2.0 * np.sin(1.7 * rate * times)
    late = np.concatenate((np.zeros(latency), coupled[: times.size - latency]))
    true = mass * a + friction * v + late
    found = np.array(
        [observer.update(measurement(t, p, f)) for t, p, f in zip(times, x, coupled, strict=True)]
    )
    lag = 1.0 / (2.0 * math.pi * BANDWIDTH) + period
    np.testing.assert_allclose(found[1000:], np.interp(times - lag, times, true)[1000:], atol=0.04)


def test_without_a_new_sample_the_estimate_is_held():
    observer = HandObserver(0.2, 1.0, 1)
    for k in range(20):
        observer.update(measurement(k * 1e-3, 1e-6 * k * k, 1.0))
    held = observer.force
    assert observer.update(measurement(19e-3, 5e-3, 3.0)) == held


def test_the_observer_is_nearer_to_the_hand_than_the_coupling(benchmark):
    observed, coupled, _ = benchmark.errors(TRIAL, None)
    assert observed < 0.09
    assert coupled > 2.0 * observed
    wrong, _, _ = benchmark.errors(TRIAL, ForceMaster(friction=0.1))
    assert wrong > 1.5 * observed


def test_the_observer_changes_nothing_but_its_column(monkeypatch):
    observed = run_trial(TRIAL).recording
    monkeypatch.setattr(TrialSettings, "hand_observer", None)
    plain = run_trial(TRIAL).recording
    assert set(observed.columns) - set(plain.columns) == {OBSERVED}
    for name, column in plain.columns.items():
        if not name.endswith(("_time", "lateness")):
            np.testing.assert_array_equal(column, observed[name], err_msg=name)


def test_a_master_with_a_force_sensor_has_no_observer():
    assert replace(TRIAL, force_master=None).hand_observer is None


def test_on_a_rig_the_observer_needs_the_mass_of_the_handle(tmp_path):
    def observer(text):
        rig = parse_rig_file(tmp_path / "rig.toml", text)
        return TrialSettings(rig=rig, depth=5e-3, specimen="gel").hand_observer

    assert observer(RIG) is None
    stated = RIG.replace(
        "stiffness_n_per_m = 700\n", "stiffness_n_per_m = 700\nhandle_mass_kg = 0.4\n"
    )
    assert observer(stated).text.startswith("mass 0.4 kg, friction 2 N s/m")


def test_the_observer_is_named_in_output_recording_and_report(tmp_path, capsys):
    path, page = tmp_path / "trial.mcap", tmp_path / "report.html"
    options = ("--clock=virtual", "--duration=2", "--estimators=rls", "--force-master=default")
    assert main(["run", *options, f"--record={path}"]) == 0
    assert "observer of the hand: differs by" in capsys.readouterr().out
    recording = load(path)
    assert recording.session["hand_observer"].startswith("mass 0.2 kg")
    assert np.isfinite(recording[OBSERVED][100:]).all()
    assert main(["report", str(path), f"--out={page}"]) == 0
    assert "observer of the hand" in page.read_text()
