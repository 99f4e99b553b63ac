from __future__ import annotations

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from sim_backend import (
    CUBES,
    Arm,
    FreePalpation,
    Intention,
    MimickedSine,
    Plant,
    PlantParameters,
)
from sim_backend.operators import REACTION

times = np.arange(0.0, 20.0, 1e-3)


@pytest.fixture(params=[FreePalpation, MimickedSine])
def make(request):
    return request.param


def positions(operator):
    return np.array([operator.intention(t) for t in times])


@cache
def motion(make, seed=3):
    """Return the intended position and velocity at all times, from the start."""
    return positions(make(9e-3, seed))


def test_velocity_is_the_derivative_of_position(make):
    intended = motion(make)
    slope = np.gradient(intended[:, 0], times)
    after = (times > REACTION + 0.01) & (np.abs(times - REACTION - 1.0) > 2e-3)  # end of ramps
    np.testing.assert_allclose(intended[after, 1][:-1], slope[after][:-1], atol=2e-4)
    assert np.abs(np.diff(intended[:, 0])).max() < 0.2e-3


def test_reaches_about_the_depth_and_never_leaves_contact(make):
    position = motion(make)[:, 0]
    assert 7e-3 < position.max() < 12e-3
    assert position.min() > -0.3e-3


def test_starts_from_rest_after_the_reaction_time(make):
    intended = motion(make)
    assert (intended[times < REACTION] == 0.0).all()


def test_palpates_again_from_the_start_when_the_drives_are_enabled_again(make):
    operator = make(9e-3, 3)
    for t in times[:7000]:
        operator.intention(t)
    position = positions(operator)[:, 0]
    assert position.min() > -0.3e-3
    assert 7e-3 < position.max() < 12e-3
    assert np.abs(np.diff(position)).max() < 0.2e-3


def test_the_motion_depends_only_on_the_seed(make):
    assert np.array_equal(positions(make(9e-3, 3)), motion(make, 3))
    assert not np.array_equal(motion(make, 3), motion(make, 2))


def test_free_palpation_pokes_about_once_a_second():
    position = motion(FreePalpation)[:, 0]
    pokes = np.count_nonzero((position[:-1] < 6.5e-3) & (position[1:] >= 6.5e-3))
    assert 12 <= pokes <= 22


def test_mimicking_errs_in_amplitude_and_in_phase():
    position = motion(MimickedSine)[:, 0]
    up = times[1:][(position[:-1] < 4.5e-3) & (position[1:] >= 4.5e-3)]
    periods = np.diff(up)
    assert periods.mean() == pytest.approx(1.0, abs=0.05)
    assert 0.005 < periods.std() < 0.2
    peaks = [position[(times >= a) & (times < b)].max() for a, b in pairwise(up)]
    assert 0.01 < np.std(peaks) / np.mean(peaks) < 0.3


def test_the_tremor_has_8_to_12_hz_and_about_0_1_mm(make):
    moved, still = make(9e-3, 3), make(9e-3, 3)
    late = times[times > REACTION + 1.0]
    tremor = np.array([moved.intention(t)[0] for t in late])
    tremor -= [still.movement(t - REACTION)[0] for t in late]
    assert 0.02e-3 < tremor.std() < 0.2e-3
    spectrum = np.abs(np.fft.rfft(tremor))
    frequencies = np.fft.rfftfreq(len(tremor), 1e-3)
    band = (frequencies > 7.5) & (frequencies < 12.5)
    assert (spectrum[band] ** 2).sum() > 0.95 * (spectrum[1:] ** 2).sum()


def test_the_arm_pulls_by_stiffness_and_damps_by_the_difference_of_velocities():
    plant = Plant(CUBES["soft"], PlantParameters())
    plant.handle.x, plant.handle.v = 1e-3, 0.02
    pull = Arm(stiffness=400.0, damping=12.0).force(Intention(3e-3, 0.05), plant.handle)
    assert pull == pytest.approx(400.0 * 2e-3 + 12.0 * 0.03)


@pytest.mark.parametrize("depth", [0.0, -1e-3, math.nan, math.inf])
def test_a_depth_that_is_not_positive_is_refused(make, depth):
    with pytest.raises(ValueError, match="depth must be positive"):
        make(depth, 0)


@pytest.mark.parametrize("frequency", [0.5, 1.0, 2.0])
def test_the_tracking_operator_waits_for_the_count_in_and_then_moves_as_without_one(frequency):
    waiting = MimickedSine(8e-3, seed=3, frequency=frequency, count_in=3.0)
    at_once = MimickedSine(8e-3, seed=3, frequency=frequency)
    assert [waiting.movement(t).position for t in (1.0, 2.0, 3.0)] == pytest.approx([0.8e-3] * 3)
    for t in (1.0, 1.3, 2.9, 5.0):
        assert waiting.movement(3.0 + t) == pytest.approx(at_once.movement(t))
