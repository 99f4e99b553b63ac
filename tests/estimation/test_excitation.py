from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from estimation import Excitation

OMEGA = 2.0 * math.pi


def last(x, v, dt=1e-3, **parameters):
    measure = Excitation(**parameters)
    return [measure.update(xn, vn, dt) for xn, vn in zip(x, v, strict=True)][-1]


t = np.arange(3000) * 1e-3


def test_a_sine_about_zero_at_one_hertz_has_excitation_1():
    x, v = 3e-3 * np.sin(OMEGA * t), 3e-3 * OMEGA * np.cos(OMEGA * t)
    assert last(x, v) == pytest.approx(1.0, abs=0.01)


def test_is_the_ratio_of_the_gram_matrix_eigenvalues():
    rng = np.random.default_rng(0)
    x, v = 5e-3 + 1e-3 * rng.normal(size=3000), 0.02 * rng.normal(size=3000)
    regressors = np.column_stack((v / OMEGA, x))[-500:]
    low, high = np.linalg.eigvalsh(regressors.T @ regressors / 500)
    assert last(x, v, window=0.5) == pytest.approx(low / (high + 1e-10), rel=0.01)


@pytest.mark.parametrize(
    ("x", "v"),
    [
        (5e-3 + 0 * t, 0 * t),
        (0 * t, 0 * t),
        (5e-3 * np.exp(-2 * t), -10e-3 * np.exp(-2 * t)),
    ],
    ids=["hold", "nothing", "exponential of Lemma 1"],
)
def test_motion_that_does_not_separate_damping_and_stiffness_has_no_excitation(x, v):
    assert last(x, v) == pytest.approx(0.0, abs=1e-6)


def test_a_sine_of_any_frequency_has_excitation_1_at_that_frequency():
    slow = np.arange(30_000) * 1e-3
    x = 3e-3 * np.sin(0.2 * OMEGA * slow)
    v = 3e-3 * 0.2 * OMEGA * np.cos(0.2 * OMEGA * slow)
    assert last(x, v, frequency=0.2) == pytest.approx(1.0, abs=0.01)


def test_encoder_noise_alone_is_no_excitation():
    noise = 1e-6 * np.random.default_rng(0).normal(size=3000)
    assert last(noise, OMEGA * noise[::-1]) < 0.02


def test_samples_outside_of_the_window_have_no_effect_even_after_a_large_motion():
    x = np.concatenate((0.1 * np.sin(OMEGA * t), 0 * t))
    v = np.concatenate((0.1 * OMEGA * np.cos(OMEGA * t), 0 * t))
    assert last(x, v) < 0.05
    assert math.isfinite(last(x, v))


@pytest.mark.parametrize("parameters", [{"window": 0.0}, {"resolution": -1.0}, {"frequency": 0.0}])
def test_a_parameter_that_is_not_positive_is_refused(parameters):
    with pytest.raises(ValueError, match="positive"):
        Excitation(**parameters)


@pytest.mark.parametrize("window", [0.05, 0.3, 100.0])
@pytest.mark.parametrize("bounds", [[0, 3000], [0, 0, 1, 40, 1500, 3000]])
def test_an_array_of_samples_gives_the_same_bits_as_single_samples(window, bounds):
    rng = np.random.default_rng(2)
    dt = rng.uniform(0.5e-3, 2e-3, 3000)
    dt[700] = 5.0
    x, v = 1e-3 * rng.normal(size=3000).cumsum(), 0.02 * rng.normal(size=3000)
    one, many = Excitation(window=window), Excitation(window=window)
    single = [one.update(*sample) for sample in zip(x, v, dt, strict=True)]
    parts = [many.run(x[a:b], v[a:b], dt[a:b]) for a, b in pairwise(bounds)]
    assert np.array_equal(np.concatenate(parts), single)
    assert many.update(1e-3, 0.0, 1e-3) == one.update(1e-3, 0.0, 1e-3)
