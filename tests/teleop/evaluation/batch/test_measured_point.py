"""A stated stiffness agrees with the cycles of the record, at a point that was measured."""

from __future__ import annotations

import numpy as np
import pytest

from estimation.testing_records import COVERAGE_KINDS
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.reading.signals import Signals, periods


def analysis(t, x, f):
    f = f + np.random.default_rng(0).normal(0.0, 5e-3, len(t))
    return analyse(Signals(t, x, f, periods(t), "position"))


def moving_surface(travel, stiffening=100.0e6):
    t = np.arange(0.0, 20.0, 5e-3)
    surface = np.interp(t, [0, 3, 6, 9, 12, 15, 20], [0, 0.3, 0.2, 0.5, 0.9, 0.8, 1.0])
    depth = 2e-3 + 1e-3 * np.sin(2.0 * np.pi * t)
    return analysis(t, depth + travel * surface, 300.0 * depth + stiffening * depth**3)


def test_no_stiffness_if_the_surface_moves_much_farther_than_the_tip():
    found = moving_surface(3e-2).result
    assert found.k is None
    assert "the surface moves or the tip slides" in found.reasons[0].lower()


@pytest.mark.parametrize("travel", [2e-3, 1.2e-2])
def test_a_stiffness_on_a_moving_surface_is_that_of_the_cycles_at_its_force(travel):
    found = moving_surface(travel).result
    depth = np.linspace(1e-3, 3e-3, 1001)
    if found.k is not None:
        at = np.interp(found.force, 300.0 * depth + 100.0e6 * depth**3, depth)
        tangent = 300.0 + 300.0e6 * at**2
        assert 0.95 * found.k_low < tangent < 1.05 * found.k_high


def test_a_surface_at_rest_has_the_tangent_of_its_cycles():
    found = moving_surface(0.0).result
    forces = 300.0 * np.array([1e-3, 3e-3]) + 100.0e6 * np.array([1e-3, 3e-3]) ** 3
    grid = np.linspace(1e-3, 3e-3, 1001)
    middle = np.interp(forces.mean(), 300.0 * grid + 100.0e6 * grid**3, grid)
    assert found.k == pytest.approx(300.0 + 300.0e6 * middle**2, rel=0.02)
    assert found.force == pytest.approx(forces.mean(), rel=0.02)


def test_force_and_depth_are_a_point_of_a_record_whose_position_drifts():
    for seed in range(2):
        record = COVERAGE_KINDS["sinusoid with drift"](np.random.default_rng(seed))
        one = analyse(Signals(record.t, record.x, record.f, periods(record.t), "position"))
        found = one.result
        assert found.k_low <= record.k <= found.k_high
        x, f = record.x - record.x.min(), record.f
        near = np.hypot((x - found.depth) / np.ptp(x), (f - found.force) / np.ptp(f))
        assert near.min() < 0.1


def bonded(gap, stiffening=0.0, every=1, b=8.0):
    """A bonded specimen behind a gap, which its damping crosses slowly."""
    t = np.arange(0.0, 10.0, 2e-3)
    x = 2e-3 * np.sin(2.0 * np.pi * 0.7 * t)
    k, dt = 1500.0, 2e-3
    y, tips = 0.0, []
    for position in x:
        y = min(max(y * b / (b + k * dt), position - gap), position + gap)
        tips.append(y)
    tip = np.array(tips)
    force = k * tip + b * np.gradient(tip, dt) + stiffening * tip**3
    return analysis(t[::every], x[::every] + 7e-3, force[::every]).result


@pytest.mark.parametrize("every", [1, 16])
def test_no_stiffness_is_stated_in_a_gap_of_a_bonded_specimen(every):
    """With every 16th sample, a loading has 22 samples."""
    found = bonded(0.3e-3, every=every)
    assert found.k is None
    assert "a gap (lost motion) between position sensor and specimen" in found.reasons[0]


@pytest.mark.parametrize(("gap", "b"), [(0.1e-3, 20.0), (0.3e-3, 80.0)])
def test_a_gap_is_found_if_it_is_small_or_the_damping_large(gap, b):
    found = bonded(gap, b=b)
    assert found.k is None
    assert "a gap (lost motion) between position sensor and specimen" in found.reasons[0]


@pytest.mark.parametrize("stiffening", [0.0, 5e8])
def test_a_specimen_without_a_gap_has_a_stiffness_at_zero_force(stiffening):
    found = bonded(0.0, stiffening)
    assert found.k == pytest.approx(1500.0, rel=0.03)
    assert not any("gap" in reason for reason in found.reasons)


def test_the_slopes_of_cycles_of_different_frequencies_do_not_contain_a_mass():
    t = np.arange(0.0, 20.0, 2e-3)
    tones = [(2.0 * np.pi * f, p) for f, p in ((0.5, 0.0), (1.3, 1.3), (3.1, 2.9), (6.1, 4.0))]
    x = 5e-3 + sum(6e-4 * np.sin(w * t + p) for w, p in tones)
    v = sum(6e-4 * w * np.cos(w * t + p) for w, p in tones)
    a = -sum(6e-4 * w**2 * np.sin(w * t + p) for w, p in tones)
    found = analysis(t, x, 600.0 * x + 3.0 * v + 0.25 * a).result
    assert found.k == pytest.approx(600.0, rel=0.01)
    assert found.b == pytest.approx(3.0, rel=0.02)
    assert found.parts["mass_kg"]["value"] == pytest.approx(0.25, rel=0.02)


@pytest.mark.parametrize("centre", [2.5e-3, 2.53e-3, 2.56e-3])
def test_the_stiffness_is_the_tangent_at_the_stated_position(centre):
    """The position is not rounded to the places at which the force of a cycle is computed."""
    t = np.arange(0.0, 20.0, 5e-3)
    x = centre + 2e-3 * np.sin(1.4 * np.pi * t)
    v = 2.8e-3 * np.pi * np.cos(1.4 * np.pi * t)
    found = analysis(t, x, 300.0 * x + 80e3 * x**2 + 5.0 * v).result
    assert found.k == pytest.approx(300.0 + 160e3 * found.position, rel=2e-3)
