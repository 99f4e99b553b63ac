"""The number to publish, on records of known truth; coverage is in benchmarks/corpus.py."""

from __future__ import annotations

import json

import numpy as np
import pytest

from estimation.coherent_band import coherent_band
from estimation.testing_records import COVERAGE_KINDS, WITHOUT_STIFFNESS, intermittent_contact
from estimation.transmission import TransmissionCalibration
from teleop.cli import main
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.material import hayes_factor
from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.reading.signals import Signals, periods
from teleop.evaluation.settings import EstimateSettings

RATE = 200.0


def signals_of(t, x, f):
    return Signals(t, x, f, periods(t), "position")


def sine(seconds=10.0, k=2000.0, b=20.0, drift=0.0, noise=5e-3, seed=0):
    t = np.arange(round(RATE * seconds)) / RATE
    w = 4.0 * np.pi
    x = 1e-3 * np.sin(w * t)
    f = 5.0 + k * x + b * 1e-3 * w * np.cos(w * t)
    f += np.random.default_rng(seed).normal(0.0, noise, len(t))
    return signals_of(t, x + drift * np.sin(0.22 * t), f)


@pytest.mark.parametrize("kind", COVERAGE_KINDS)
def test_the_interval_of_k_contains_the_truth(kind):
    record = COVERAGE_KINDS[kind](np.random.default_rng(3))
    result = analyse(signals_of(record.t, record.x, record.f)).result
    assert result.k_low <= record.k <= result.k_high
    assert result.k == pytest.approx(record.k, rel=0.1)


@pytest.mark.parametrize("kind", WITHOUT_STIFFNESS)
def test_a_record_that_supports_no_stiffness_gives_a_reason(kind):
    record = WITHOUT_STIFFNESS[kind](np.random.default_rng(1))
    result = analyse(signals_of(record.t, record.x, record.f)).result
    assert not result.identifiable
    assert result.k is None
    assert result.b is None
    assert result.reasons


@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("lag", [2e-3, 15.9e-3])
@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_a_compensated_force_lag_does_not_change_stiffness_and_damping(rate, lag, share):
    w, t = 2.0 * np.pi, np.arange(round(10.0 * rate)) / rate
    # of the force channel
    response = np.exp(-1j * w * lag * share) / (1.0 + 1j * w * lag * (1.0 - share))
    motion = 1e-3 * np.exp(1j * w * t)
    f = np.imag((2000.0 + 20j * w) * response * motion)
    f += np.random.default_rng(0).normal(0.0, 1e-3, len(t))
    result = analyse(
        signals_of(t, np.imag(motion), f), TransmissionCalibration(lag, delay_share=share)
    ).result
    assert result.k == pytest.approx(2000.0, rel=1e-3)
    assert result.b == pytest.approx(20.0, abs=0.2)


def test_a_drift_of_the_position_is_not_taken_for_the_motion():
    evaluation = evaluate(sine(drift=8e-3), EstimateSettings())
    assert 0.9 < evaluation.kept_force_variance <= 1.0


def test_a_slow_drift_of_the_position_costs_no_accuracy():
    # Without noise the cosines of the baseline alone leave an error of 1 to 10 N/m.
    for length in (7.9, 8.0, 20.3):
        result = analyse(sine(length, drift=8e-3, noise=0.0)).result
        assert result.k == pytest.approx(2000.0, rel=2e-5)


@pytest.fixture(scope="module")
def sines_with_drift():
    return [analyse(sine(drift=8e-3, seed=seed)) for seed in range(20)]


def test_intervals_of_the_models_of_a_sine_with_drift_contain_the_truth(sines_with_drift):
    fits = [fit for one in sines_with_drift for fit in one.models(0.0, 5.0)]
    fits = [fit.parameters for fit in fits if fit.name == "kelvin-voigt with datum"]
    for name, true in (("k", 2000.0), ("b", 20.0)):
        inside = [fit[name].low <= true <= fit[name].high for fit in fits]
        assert sum(inside) >= 17
    # Least squares with independent noise of 5 mN has a standard deviation of 0.16 N/m.
    assert np.median([fit["k"].high - fit["k"].low for fit in fits]) < 2.0 * 2.0 * 1.96 * 0.16


def test_intervals_of_a_sine_with_drift_contain_the_truth_and_are_not_too_wide(sines_with_drift):
    results = [one.result for one in sines_with_drift]
    scores = [1.96 * (r.k - 2000.0) / (r.k_high - r.k) for r in results]
    # The standard deviation of 20 standard normal values is within 0.6 to 1.4 in 99 % of cases.
    assert 0.6 < np.std(scores) < 1.4
    assert sum(abs(score) < 1.96 for score in scores) >= 17
    # Least squares with independent noise of 5 mN has a standard deviation of 0.16 N/m.
    assert np.median([r.k_high - r.k for r in results]) < 2.0 * 1.96 * 0.16


def test_trials_of_different_length_give_the_same_stiffness():
    lengths = (2.0, 3.0, 5.0, 8.0, 12.0)
    results = [analyse(sine(length, seed=seed)).result for length in lengths for seed in range(5)]
    # 20 or more of 25 intervals of 95 % contain the truth with a probability of 99.9 %.
    assert sum(r.k_low <= 2000.0 <= r.k_high for r in results) >= 20
    assert sum(r.b_low <= 20.0 <= r.b_high for r in results) >= 20
    lows, highs = [r.k_low for r in results], [r.k_high for r in results]
    assert max(highs) - min(lows) < 10.0


def test_the_band_is_where_force_follows_the_displacement():
    signals = sine(seconds=20.0, drift=8e-3)
    band = coherent_band(signals.x, signals.f, 1.0 / RATE)
    assert band.low > 1.5
    assert band.centre == pytest.approx(2.0, abs=0.2)


def test_the_contact_point_is_found_and_estimators_hold_out_of_contact():
    record = intermittent_contact(np.random.default_rng(3))
    evaluation = evaluate(signals_of(record.t, record.x, record.f), EstimateSettings())
    point = evaluation.analysis.phases.contact_point
    assert point.low <= record.contact <= point.high
    assert evaluation.datum.source.startswith("the contact point")
    assert evaluation.estimates["rls"].held.mean() > 0.2


def test_parameters_at_the_edge_of_plausibility_are_not_identifiable():
    evaluation = evaluate(sine(), EstimateSettings())
    fits = {fit.name: fit for fit in evaluation.models}
    assert not fits["stiffening"].parameters["k3"].identifiable
    assert fits["kelvin-voigt with datum"].identifiable


def models_of_a_poke(seed):
    """Return the models of a stiffening body under a sine that begins at the surface.

    The force drifts.
    """
    t = np.arange(0.0, 10.0, 5e-3)
    x = 4e-3 * (1.0 - np.exp(-t / 0.3)) + 2e-3 * np.sin(2.0 * np.pi * t)
    f = 2000.0 * x + 3e7 * x**3 + 5.0 * np.gradient(x, t) + np.sin(0.3 * t)
    f += np.random.default_rng(seed).normal(0.0, 0.01, len(t))
    return {fit.name: fit for fit in analyse(signals_of(t, x, f)).models(0.0, 0.0)}


def test_the_models_of_a_motion_with_a_transient_are_those_of_the_body():
    found = [models_of_a_poke(seed)["stiffening"] for seed in range(12)]
    assert found[0].parameters["k"].value == pytest.approx(2000.0, rel=0.01)
    assert found[0].parameters["k3"].value == pytest.approx(3e7, rel=0.01)
    assert found[0].rms < 0.02
    for name, true in (("k", 2000.0), ("k3", 3e7)):
        inside = [fit.parameters[name].low <= true <= fit.parameters[name].high for fit in found]
        assert sum(inside) >= 10


@pytest.mark.parametrize(
    ("aspect", "poisson", "factor"), [(0.2, 0.3, 1.207), (0.2, 0.5, 1.281), (0.4, 0.3, 1.472)]
)
def test_hayes_factor_is_that_of_his_table(aspect, poisson, factor):
    assert hayes_factor(aspect, poisson) == pytest.approx(factor, abs=2e-3)


def test_the_command_prints_the_result_first_in_80_columns(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    path = tmp_path / "sine.csv"
    signals = sine()
    rows = zip(signals.t, signals.x * 1e3, signals.f, strict=True)
    path.write_text(
        "Time [s],Position [mm],Force [N]\n"
        + "".join(f"{t:.6f},{x:.7f},{f:.6f}\n" for t, x, f in rows)
    )
    command = ["estimate", str(path), "--indenter", "flat", "--radius", "5mm"]
    assert main(command) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "sine.csv: k and b can be used"
    assert lines[1].startswith("  stiffness k = 200")
    assert all(len(line.rstrip()) <= 80 for line in lines)
    picture = tmp_path / "fit.png"
    assert main([*command, "--plot-fit", str(picture), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    result = document["result"]
    assert result["k_low"] <= 2000.0 <= result["k_high"]
    assert document["conditioning"] == "matched"
    assert document["force_lag_s"] == 0.0
    assert document["software"].startswith("teleop ")
    assert document["best_model"].startswith("kelvin-voigt")
    assert document["material"]["modulus_pa"] == pytest.approx(0.75 * result["k"] / 0.01)
    assert picture.stat().st_size > 10_000
