from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.methods.hunt_crossley_double_stage import PRIOR, DoubleStage


def pressed(stiffness=2e4, n=1.5, most=0.3, noise=0.0, seconds=3.0, seed=0):
    """Return x, v, f of a Hunt-Crossley body with B v / K up to `most`, and its (K, B, n)."""
    t = np.arange(round(seconds * 1000)) * 1e-3
    x = 5e-3 + 3e-3 * np.sin(8.0 * t) + 0.5e-3 * np.sin(31.0 * t)
    v = 24e-3 * np.cos(8.0 * t) + 15.5e-3 * np.cos(31.0 * t)
    damping = stiffness * most / np.abs(v).max()
    f = (stiffness + damping * v) * x**n
    rng = np.random.default_rng(seed)
    return x, v, f + rng.normal(0.0, noise, len(t)), np.array([stiffness, damping, n])


@settings(max_examples=8, deadline=None)
@given(stiffness=st.floats(5e3, 1e5), n=st.floats(1.2, 2.0), most=st.floats(0.02, 0.3))
def test_finds_the_model_within_two_per_cent(stiffness, n, most):
    x, v, f, truth = pressed(stiffness, n, most)
    estimator = DoubleStage(memory=0.05, threshold=1e-6)
    estimator.run(x, v, f, 1e-3)
    got = [estimator.values[name][0] for name in ("K", "B", "n")]
    assert got == pytest.approx(truth, rel=0.02)


def test_is_within_two_per_cent_of_a_noisy_sphere():
    x, v, f, truth = pressed(noise=0.02, seconds=4.0)
    estimator = DoubleStage(memory=0.1)
    estimator.run(x, v, f, 1e-3)
    assert [estimator.values[name][0] for name in ("K", "B", "n")] == pytest.approx(truth, rel=0.02)


def test_each_stage_is_lstsq_with_the_other_s_latest_estimate():
    x, v, f, _ = pressed(noise=0.05, seconds=0.3)
    estimator = DoubleStage(memory=0.05)
    n = 1.5
    rows, depths, targets, weights = [], [], [], []
    for i, (xi, vi, fi) in enumerate(zip(x, v, f, strict=True)):
        estimator.update(xi, vi, fi, 1e-3)
        g = (xi / 5e-3) ** n
        rows.append([g, g * vi])
        root = np.exp(-np.arange(i + 1)[::-1] * 1e-3 / 0.1)
        prior = [0.0, 0.025 * math.sqrt(PRIOR) * np.linalg.norm(root * np.array(rows)[:, 0])]
        (stiffness, damping), *_ = np.linalg.lstsq(
            np.vstack((np.array(rows) * root[:, None], prior)), [*f[: i + 1] * root, 0.0]
        )
        depth, y = math.log(xi / 5e-3), math.log(fi / (stiffness + damping * vi))
        weights.append(fi * math.exp(-0.75 * np.clip(y - n * depth, -0.7, 0.7)))
        depths.append(depth)
        targets.append(y)
        weight = np.array(weights) * root
        prior = math.sqrt(PRIOR) * np.linalg.norm(weight)
        (n,), *_ = np.linalg.lstsq(
            np.append(weight * depths, prior)[:, None], [*weight * targets, 1.5 * prior]
        )
    got = [estimator.values[name][0] for name in ("K", "B", "n")]
    assert got == pytest.approx([stiffness / 5e-3**n, damping / 5e-3**n, n], rel=1e-6)


def test_b_and_k_give_the_model_s_force_at_the_present_displacement():
    x, v, f, _ = pressed(n=1.4)
    estimates = DoubleStage(memory=0.05).run(x, v, f, 1e-3)
    np.testing.assert_allclose((estimates.b * v + estimates.k * x)[2000:], f[2000:], rtol=0.01)


def test_there_is_no_interval():
    estimator = DoubleStage(memory=0.05)
    estimator.run(*pressed(seconds=0.1)[:3], 1e-3)
    assert all(math.isnan(std) for _, std in estimator.values.values())


@pytest.mark.parametrize(("x", "f"), [(-1e-3, 5.0), (0.0, 5.0), (1e-3, 0.02), (1e-3, -1.0)])
def test_a_sample_without_contact_is_not_processed(x, f):
    estimator = DoubleStage(memory=0.05)
    estimator.run(*pressed()[:3], 1e-3)
    before = [value for value, _ in estimator.values.values()]
    assert estimator.update(x, 0.01, f, 1e-3).held
    assert [value for value, _ in estimator.values.values()] == before
    assert not estimator.update(1e-3, 0.01, 5.0, 1e-3).held


def test_the_exponent_stays_where_k_and_b_make_no_pushing_force():
    estimator = DoubleStage(memory=0.05)
    estimator.run(*pressed()[:3], 1e-3)
    n = estimator.values["n"][0]
    estimate = estimator.update(2e-3, -0.5, 0.05, 1e-3)
    assert estimate.b * -0.5 + estimate.k * 2e-3 < 0.0
    assert estimator.values["n"][0] == n
    assert not estimate.held


@pytest.mark.parametrize("word", ["memory", "displacement", "velocity", "threshold"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_a_parameter_out_of_range_is_refused(word, value):
    with pytest.raises(ValueError, match=word):
        DoubleStage(**{"memory": 0.1, word: value})
