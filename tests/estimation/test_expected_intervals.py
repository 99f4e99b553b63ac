from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from estimation import ExpectedIntervals, MatchedFilter

K, B, NOISE, RATE = 2100.0, 15.0, 0.02, 1000.0


def sine(amplitude, frequency, mean, seconds=4.0):
    t = np.arange(round(seconds * RATE)) / RATE
    omega = 2.0 * math.pi * frequency
    x = mean + amplitude * np.sin(omega * t)
    return x, amplitude * omega * np.cos(omega * t)


def force(x, v, seed, k3=0.0):
    noise = np.random.default_rng(seed).normal(0.0, NOISE, len(x))
    return K * x + B * v + k3 * x**3 + noise


def expected(x, v, f):
    """Return the relative half widths of k and b after the last sample."""
    k, b = ExpectedIntervals(40.0).run(x, v, f, 1.0 / RATE)
    return k[-1], b[-1]


@pytest.mark.parametrize("mean", [0.0, 12e-3])
@pytest.mark.parametrize(("amplitude", "frequency"), [(1e-3, 1.0), (20e-6, 1.0), (3e-3, 4.0)])
def test_is_the_covariance_of_least_squares_for_white_noise(amplitude, frequency, mean):
    x, v = sine(amplitude, frequency, mean)
    z = (x - mean) / amplitude
    phi = np.column_stack((v, z * amplitude, np.ones(len(z)), z**2, z**3, z**4))
    half = 1.96 * NOISE * np.sqrt(np.diag(np.linalg.inv(phi.T @ phi)))
    found = np.median([expected(x, v, force(x, v, seed)) for seed in range(8)], axis=0)
    # the residual decides the variance and its correlation, each to about 5 %
    np.testing.assert_allclose(found, (half[1] / K, half[0] / B), rtol=0.15)


@pytest.mark.parametrize("k3", [0.0, 4e6])
def test_is_the_scatter_of_the_damping_behind_the_filters_also_if_the_body_stiffens(k3):
    x, v = np.add(sine(1.5e-3, 2.0, 4e-3, 3.0), sine(1.5e-3, 3.0, 0.0, 3.0))
    found, halves = [], []
    for seed in range(60):
        r = MatchedFilter(20.0).run(x, force(x, v, seed, k3), 1.0 / RATE)
        kept = slice(300, None)
        _, b = ExpectedIntervals().run(*(channel[kept] for channel in r[:4]))
        phi = np.column_stack((r.v, *((1e3 * r.x - 4.0) ** n for n in range(5))))[kept]
        found.append(np.linalg.lstsq(phi, r.f[kept])[0][0])
        halves.append(B * b[-1])
    # the scatter of 60 estimates has an error of 9 %
    assert np.median(halves) == pytest.approx(1.96 * np.std(found), rel=0.25)


@pytest.mark.parametrize(
    ("x", "v"),
    [
        (np.full(3000, 5e-3), np.zeros(3000)),
        (5e-3 * np.exp(-2e-3 * np.arange(3000)), -10e-3 * np.exp(-2e-3 * np.arange(3000))),
    ],
    ids=["hold", "exponential of Lemma 1"],
)
def test_a_motion_that_does_not_separate_damping_and_stiffness_has_no_interval_of_b(x, v):
    _, b = expected(x, v, force(x, v, 0))
    assert not b <= 1.0


@pytest.mark.parametrize("bounds", [[0, 3000], [0, 0, 1, 40, 1500, 3000]])
def test_an_array_of_samples_gives_the_same_bits_as_single_samples(bounds):
    rng = np.random.default_rng(2)
    dt = rng.uniform(0.5e-3, 2e-3, 3000)
    dt[700] = 5.0
    x, v = 1e-3 * rng.normal(size=3000).cumsum(), 0.02 * rng.normal(size=3000)
    f, is_open = force(x, v, 3), rng.random(3000) < 0.9
    one, many = ExpectedIntervals(), ExpectedIntervals()
    single = [
        one.update(*sample) for sample in zip(x, v, f, dt.tolist(), is_open.tolist(), strict=True)
    ]
    parts = [many.run(x[a:b], v[a:b], f[a:b], dt[a:b], is_open[a:b]) for a, b in pairwise(bounds)]
    np.testing.assert_array_equal(np.concatenate(parts, axis=1).T, single)
    assert many.update(1e-3, 0.0, 1.0, 1e-3) == one.update(1e-3, 0.0, 1.0, 1e-3)


def test_without_contact_the_intervals_do_not_change():
    x, v = sine(1e-3, 1.0, 5e-3)
    found = ExpectedIntervals()
    k, b = found.run(x, v, force(x, v, 0), 1.0 / RATE)
    assert found.update(0.0, 0.0, 0.0, 1e-3, is_open=False) == (k[-1], b[-1])


def test_a_bandwidth_that_is_not_positive_is_refused():
    with pytest.raises(ValueError, match="bandwidth must be positive"):
        ExpectedIntervals(bandwidth=0.0)
