from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from estimation.methods.hunt_crossley_logarithmic import UNKNOWN, Logarithmic

NAMES = ["K", "B", "n"]


def pressed(stiffness=2e4, n=1.5, most=0.3, noise=0.0, seconds=1.0, seed=0):
    """Return x, v, f of a Hunt-Crossley body with B v / K up to `most`, and its (K, B, n)."""
    t = np.arange(round(seconds * 1000)) * 1e-3
    x = 5e-3 + 3e-3 * np.sin(8.0 * t) + 0.5e-3 * np.sin(31.0 * t)
    v = 24e-3 * np.cos(8.0 * t) + 15.5e-3 * np.cos(31.0 * t)
    damping = stiffness * most / np.abs(v).max()
    f = (stiffness + damping * v) * x**n
    rng = np.random.default_rng(seed)
    return x, v, f + rng.normal(0.0, noise, len(t)), np.array([stiffness, damping, n])


@pytest.mark.parametrize("n", [1.0, 1.2, 1.5, 2.0])
@pytest.mark.parametrize("most", [0.0, 0.05, 0.3])
def test_finds_the_model_without_the_bias_of_the_paper_s_small_bv_over_k(n, most):
    x, v, f, truth = pressed(n=n, most=most)
    estimator = Logarithmic(memory=0.05)
    estimator.run(x, v, f, 1e-3)
    got = [estimator.values[name][0] for name in NAMES]
    assert (np.abs(got - truth) < 1e-3 * np.array([2e4, 2e4, 1.0])).all()


def test_agrees_with_scipy_s_nonlinear_least_squares_on_the_force():
    x, v, f, truth = pressed(noise=0.02, seconds=4.0)
    estimator = Logarithmic(memory=0.05)
    estimator.run(x, v, f, 1e-3)
    weight = np.exp(-np.arange(len(x))[::-1] * 1e-3 / 0.05)[-1500:]
    x, v, f = x[-1500:], v[-1500:], f[-1500:]

    def model(theta):
        stiffness, damping, n = theta * truth
        return (stiffness + damping * v) * x**n

    fit = least_squares(
        lambda theta: np.sqrt(weight) * (model(theta) - f), np.ones(3), "3-point", xtol=1e-12
    )
    jacobian = fit.jac / np.sqrt(weight)[:, None]
    inverse = np.linalg.inv(jacobian.T @ (weight[:, None] * jacobian))
    spread = inverse @ (jacobian.T @ (weight[:, None] ** 2 * jacobian)) @ inverse
    std = 0.02 * np.sqrt(np.diag(spread)) * truth
    got, got_std = np.array([estimator.values[name] for name in NAMES]).T
    assert (np.abs(got - fit.x * truth) < 0.2 * std).all()
    assert got_std == pytest.approx(std, rel=0.15)


def test_the_intervals_are_as_wide_as_the_errors():
    ratios = []
    for seed in range(40):
        x, v, f, truth = pressed(most=0.1, noise=0.02, seed=seed)
        estimator = Logarithmic(memory=0.05)
        estimator.run(x, v, f, 1e-3)
        got, std = np.array([estimator.values[name] for name in NAMES]).T
        ratios.append((got - truth) / std)
    assert np.std(ratios, axis=0) == pytest.approx(1.0, abs=0.3)
    assert np.abs(np.mean(ratios, axis=0)).max() < 0.4


def test_a_force_hardly_above_its_noise_does_not_pull_the_exponent():
    errors = []
    for seed in range(12):
        x, v, f, _ = pressed(n=2.0, most=0.05, noise=0.04, seed=seed)
        estimator = Logarithmic(memory=0.5, threshold=0.01)
        estimator.run(x, v, f, 1e-3)
        errors.append(estimator.values["n"][0] - 2.0)
    assert abs(np.mean(errors)) < np.std(errors)


def test_b_and_k_give_the_model_s_force_at_the_present_displacement():
    x, v, f, _ = pressed(n=1.4)
    estimates = Logarithmic(memory=0.05).run(x, v, f, 1e-3)
    np.testing.assert_allclose((estimates.b * v + estimates.k * x)[500:], f[500:], rtol=1e-3)


@pytest.mark.parametrize(("x", "f"), [(-1e-3, 5.0), (0.0, 5.0), (1e-3, 0.02), (1e-3, -1.0)])
def test_a_sample_without_contact_is_not_processed(x, f):
    estimator = Logarithmic(memory=0.05)
    estimator.run(*pressed()[:3], 1e-3)
    before = estimator.values
    assert estimator.update(x, 0.01, f, 1e-3).held
    assert estimator.values == before
    assert not estimator.update(1e-3, 0.01, 5.0, 1e-3).held


def test_before_contact_all_is_unknown_and_a_hold_does_not_determine_the_exponent():
    estimator = Logarithmic(memory=0.05)
    assert estimator.estimate.k_std == UNKNOWN
    estimator.run(np.full(300, 5e-3), np.zeros(300), np.full(300, 8.0), 1e-3)
    assert estimator.estimate.k == pytest.approx(1600.0)
    assert estimator.estimate.k_std < 1.0
    assert estimator.values["n"] == pytest.approx((1.5, 1.0))


@settings(max_examples=10, deadline=None)
@given(length=st.floats(0.01, 100.0), force=st.floats(0.01, 100.0), n=st.floats(1.0, 2.0))
def test_units_do_not_matter(length, force, n):
    x, v, f, _ = pressed(n=n, noise=0.01, seconds=0.2)
    plain = Logarithmic(memory=0.05)
    other = Logarithmic(0.05, 5e-3 * length, 25e-3 * length, 0.03 * force)
    plain.run(x, v, f, 1e-3)
    other.run(length * x, length * v, force * f, 1e-3)
    (stiffness, _), (exponent, deviation) = plain.values["K"], plain.values["n"]
    assert other.values["n"][0] == pytest.approx(exponent, rel=1e-3)
    assert other.values["n"][1] == pytest.approx(deviation, rel=0.05)
    assert other.values["K"][0] == pytest.approx(stiffness * force / length**exponent, rel=1e-2)


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"memory": 0.0}, "memory"),
        ({"memory": 0.1, "displacement": -1.0}, "displacement"),
        ({"memory": 0.1, "velocity": float("nan")}, "velocity"),
        ({"memory": 0.1, "threshold": 0.0}, "threshold"),
        ({"memory": 0.1, "correlation": 0.5}, "correlation"),
    ],
)
def test_a_parameter_out_of_range_is_refused(settings, word):
    with pytest.raises(ValueError, match=word):
        Logarithmic(**settings)
