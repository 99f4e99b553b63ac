from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimation import MODELS, Regression, paper_preset
from teleop.evaluation.online.model_comparison import compare
from teleop.settings.trial_settings import TrialSettings
from teleop.studies.paper.methods import FurtherMethods, averages, compare_methods
from teleop.trial.run import run_trial


def palpation(seconds=6.0, k=2100.0, seed=0):
    """Two sines on a linear plant with b = 20 N s/m."""
    t = np.arange(0.0, seconds, 1e-3)
    x = 5e-3 + 3e-3 * np.sin(8.0 * t) + 0.5e-3 * np.sin(31.0 * t)
    v = 24e-3 * np.cos(8.0 * t) + 15.5e-3 * np.cos(31.0 * t)
    f = 20.0 * v + k * x + np.random.default_rng(seed).normal(0.0, 0.02, t.size)
    return Regression(x, v, f, np.full(t.size, 1e-3), np.empty((t.size, 0)))


def compared(names, regression, b=20.0, k=2100.0):
    bank = replace(paper_preset(), estimators=names).bank()
    return compare(regression, bank, bank.run(*regression), b, k)


@pytest.mark.usefixtures("interpreted")
def test_an_honest_interval_covers_the_truth_19_times_out_of_20():
    rows = compared(("rls", "rls_conditional", "kalman", "window"), palpation())
    for name, row in rows.items():
        assert row.k_coverage == pytest.approx(0.95, abs=0.06), name
        assert row.b_coverage == pytest.approx(0.95, abs=0.06), name
        assert row.k_error < 1e-3


def test_a_reference_that_is_not_the_truth_is_not_covered_and_its_error_is_reported():
    row = compared(("rls",), palpation(), b=30.0, k=2000.0)["rls"]
    assert row.k_coverage == row.b_coverage == 0.0
    assert row.k_error == pytest.approx(0.05, rel=0.02)
    assert row.b_error == pytest.approx(10.0, rel=0.05)


@pytest.mark.usefixtures("interpreted")
def test_the_yardstick_beside_itself_is_one():
    bank = replace(paper_preset(), forgetting=np.exp(-1e-3 / 0.5), estimators=("window",)).bank()
    regression = palpation()
    row = compare(regression, bank, bank.run(*regression), 20.0, 2100.0)["window"]
    assert row.one_step_ratio == pytest.approx(1.0, rel=1e-6)


@pytest.fixture(scope="module")
def trial():
    return run_trial(TrialSettings(condition="autonomous", duration=2.5, clock="virtual"))


def test_methods_are_held_against_the_cube_that_was_palpated(trial):
    results = compare_methods(trial, FurtherMethods(("rls", "me", "reference")))
    assert results["rls"].k_error < 0.15  # the cube stiffens
    assert results["rls"].b_error < 30.0
    assert np.isnan(results["reference"].k_coverage)
    mean = averages([results, results])
    assert mean["rls"] == pytest.approx(results["rls"])
    assert mean["me"].k_error == pytest.approx(results["me"].k_error)


def test_a_model_that_is_true_of_the_cube_errs_less(trial):
    plain = compare_methods(trial, FurtherMethods(("rls",)))["rls"]
    stiffening = compare_methods(trial, FurtherMethods(("rls",), MODELS["stiffening"]))["rls"]
    assert stiffening.k_error < 0.5 * plain.k_error
    assert stiffening.e_f < 0.5 * plain.e_f
