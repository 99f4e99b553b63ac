from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from estimation import Axis, Grid, MultiEstimator, paper_preset
from estimation.redundancy import Candidate, ambiguity, redundancy

GRID = paper_preset().grid
B, K = GRID.b.values, GRID.k.values
t = np.linspace(0.0, 0.5, 101)

candidates = st.builds(
    lambda i, j: Candidate(float(B[i]), float(K[j])), st.integers(0, 40), st.integers(0, 192)
)
plants = st.builds(Candidate, st.floats(-450.0, 450.0), st.floats(1600.0, 39_000.0))


def exponential(rate):
    """Return x and v of x_0 exp(-rate t), scaled to the size of a palpation."""
    x = 5e-3 * np.exp(-rate * t + min(0.0, rate * t[-1]))
    return x, -rate * x


def sine(frequency):
    return 5e-3 * np.sin(2 * np.pi * frequency * t), 5e-3 * 2 * np.pi * frequency * np.cos(
        2 * np.pi * frequency * t
    )


def monitoring(candidate, plant, x, v, rate=10.0):
    """Return (11) of a candidate over time, computed from its force error."""
    e2 = ((candidate.b - plant.b) * v + (candidate.k - plant.k) * x) ** 2
    dt = t[1] - t[0]
    mu = np.zeros(len(t))
    for n in range(1, len(t)):
        mu[n] = np.exp(-2 * rate * dt) * mu[n - 1] + dt * e2[n]
    return mu


def same(gamma, epsilon, plant, x, v):
    """Return whether two candidates have the same monitoring signal at all times."""
    a, b = monitoring(gamma, plant, x, v), monitoring(epsilon, plant, x, v)
    size = (abs(gamma.b - plant.b) + abs(epsilon.b - plant.b)) ** 2 * v**2 + (
        abs(gamma.k - plant.k) + abs(epsilon.k - plant.k)
    ) ** 2 * x**2
    return bool(np.abs(a - b).max() <= 1e-9 * size.max() * (t[1] - t[0]))


def moved(candidate):
    """Return a candidate at a distance of one grid step."""
    return Candidate(candidate.b, candidate.k + 200.0)


@given(plant=candidates, other=candidates)
def test_lemma_1_an_estimator_beside_the_true_one_is_redundant_on_its_exponential_alone(
    plant, other
):
    assume(abs(plant.b - other.b) > 0 and abs(other.k - plant.k) / abs(other.b - plant.b) < 100.0)
    result = redundancy(other, plant, plant)
    assert not result.mirrored
    (rate,) = result.rates
    assert rate == pytest.approx((other.k - plant.k) / (other.b - plant.b))
    x, v = exponential(rate)
    assert same(other, plant, plant, x, v)
    assert not same(moved(other), plant, plant, x, v)
    assert not same(other, plant, plant, *exponential(rate + 1.0 + 0.1 * abs(rate)))
    assert not same(other, plant, plant, *sine(2.0))


@given(plant=candidates, other=candidates)
def test_lemma_1_equal_damping_is_never_redundant(plant, other):
    assume(other.k != plant.k)
    other = Candidate(plant.b, other.k)
    assert redundancy(other, plant, plant) == (False, ())
    for motion in (exponential(3.0), exponential(-3.0), sine(2.0)):
        assert not same(other, plant, plant, *motion)


@settings(max_examples=50)
@given(plant=plants, gamma=candidates, epsilon=candidates)
@example(Candidate(0.0, 1600.0), Candidate(-500.0, 1500.0), Candidate(500.0, 1500.0))
@example(Candidate(0.0, 2000.0), Candidate(50.0, 2400.0), Candidate(25.0, 3000.0))
def test_lemma_2_two_wrong_estimators_are_redundant_on_two_exponentials_alone(
    plant, gamma, epsilon
):
    assume(gamma != epsilon)
    result = redundancy(gamma, epsilon, plant)
    assume(not result.mirrored)
    for rate in result.rates:
        assume(abs(rate) < 100.0)
        x, v = exponential(rate)
        assert same(gamma, epsilon, plant, x, v)
        other = moved(gamma)
        assume(other != epsilon)
        apart = redundancy(other, epsilon, plant)
        assume(not apart.mirrored)
        assume(all(abs(rate - r) > 1e-3 * (1.0 + abs(rate)) for r in apart.rates))
        assert not same(other, epsilon, plant, x, v)
    assert not same(gamma, epsilon, plant, *sine(2.0))


@given(plant=candidates, i=st.integers(1, 10), j=st.integers(-10, 10))
def test_lemma_2_a_mirrored_pair_is_redundant_on_every_motion(plant, i, j):
    gamma = Candidate(plant.b + 25.0 * i, plant.k + 200.0 * j)
    epsilon = Candidate(plant.b - 25.0 * i, plant.k - 200.0 * j)
    assert redundancy(gamma, epsilon, plant).mirrored
    for motion in (exponential(7.0), sine(1.0), sine(9.0)):
        assert same(gamma, epsilon, plant, *motion)
    assert not same(moved(gamma), epsilon, plant, *sine(2.0))


def test_the_papers_further_condition_to_16_is_not_needed():
    plant, gamma, epsilon = Candidate(0.0, 2000.0), Candidate(50.0, 2400.0), Candidate(25.0, 3000.0)
    errors = ((50.0, 400.0), (25.0, 1000.0))
    assert errors[0][0] * errors[1][1] != errors[1][0] * errors[0][1]
    rate = (400.0 + 1000.0) / (50.0 + 25.0)
    assert rate in redundancy(gamma, epsilon, plant).rates
    assert same(gamma, epsilon, plant, *exponential(rate))


def test_the_same_candidate_twice_is_refused():
    with pytest.raises(ValueError, match="distinct"):
        redundancy(Candidate(0.0, 1.0), Candidate(0.0, 1.0), Candidate(0.0, 2.0))


def test_a_recordings_ambiguity_shrinks_with_excitation(palpation):
    grid = Grid(b=Axis(-100.0, 100.0, 41), k=Axis(1500.0, 3000.0, 61))
    hold = 4e-3 + 0 * t
    resting = ambiguity(
        MultiEstimator(grid, 10.0), hold, 0 * t, 2100.0 * hold + 0.1, 0 * t + 1e-3, 0.5, every=10
    )
    s = palpation(seconds=0.5, noise=0.05)
    moving = ambiguity(MultiEstimator(grid, 10.0), *s, 0.5, every=50)
    assert len(moving.candidates) == len(resting.candidates) == 10
    assert (resting.candidates >= 41).all()
    assert (resting.b_low == -100.0).all()
    assert (resting.b_high == 100.0).all()
    assert moving.candidates[-1] < 0.2 * resting.candidates[-1]
    assert moving.b_low[-1] <= 20.0 <= moving.b_high[-1] + 5.0
    assert moving.k_low[-1] <= 2100.0 <= moving.k_high[-1] + 25.0
