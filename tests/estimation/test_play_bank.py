"""The bank of plays: it finds lost motion, and no smooth hysteresis of a body."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.signal import lfilter

from estimation.play_bank import HALF_WIDTHS, WINDOW, indicated_play

FINE, RATE = 5000.0, 250.0
"""Rate of the simulation and rate of the rows [Hz]."""
T = np.arange(0.0, WINDOW, 1.0 / FINE)
MOTIONS = {
    "sine": np.sin(2.0 * np.pi * 1.3 * T),
    "chirp": np.sin(2.0 * np.pi * (0.5 * T + 0.25 * T**2)),
    "random": sum(np.sin(2.0 * np.pi * f * T + 7.0 * f) / 3.0 for f in (0.6, 1.1, 1.9, 2.7)),
}


def first_order(tau, u):
    decay = math.exp(-1.0 / (FINE * tau))
    return lfilter([1.0 - decay], [1.0, -decay], u, zi=[decay * u[0]])[0]


BODIES = {
    "linear": lambda x, v: 1000.0 * x + 8.0 * v,
    "viscous": lambda x, v: 1000.0 * x + 80.0 * v,
    "stiffening": lambda x, v: 1000.0 * x + 1.5e7 * x**3 + 8.0 * v,
    "relaxing": lambda x, v: 600.0 * x + 400.0 * (x - first_order(0.1, x)),
    "slowly relaxing": lambda x, v: 600.0 * x + 500.0 * (x - first_order(1.0, x)),
    "Hunt-Crossley": lambda x, v: 1.3e4 * np.maximum(x, 0.0) ** 1.5 * (1.0 + 1.5 * v),
}


def moved(x, half_width):
    """The play of the textbook, sample by sample."""
    y = [x[0]]
    for u in x.tolist()[1:]:
        y.append(max(u - half_width, min(u + half_width, y[-1])))
    return np.array(y)


def rows(body, motion, half_width, noise=0.01, lag=1.5e-3, seed=0):
    """Time, position, force and contact of 5 s; the force has a lag and noise."""
    x = 4.5e-3 + 3e-3 * MOTIONS[motion]
    tip = moved(x, half_width)
    force = first_order(lag, BODIES[body](tip, np.gradient(tip, 1.0 / FINE)))
    every = slice(None, None, int(FINE / RATE))
    force = force[every] + np.random.default_rng(seed).normal(0.0, noise, T[every].size)
    return T[every], x[every], force, np.full(force.size, True)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("body", BODIES)
def test_a_play_of_a_tenth_of_a_millimetre_is_found_behind_any_body(body, motion):
    found = indicated_play(*rows(body, motion, 100e-6))
    assert found is not None
    assert abs(found.half_width - 100e-6) <= 50e-6
    assert found.b_change > 0.0  # play looks like negative damping


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("body", BODIES)
def test_no_body_without_play_is_called_a_play(body, motion):
    for seed in range(3):
        assert indicated_play(*rows(body, motion, 0.0, seed=seed)) is None


@pytest.mark.parametrize("motion", ["chirp", "random"])
def test_the_play_that_is_removed_is_not_indicated_and_a_wrong_one_is(motion):
    record = rows("linear", motion, 120e-6)
    assert indicated_play(*record, removed=120e-6) is None
    too_large = indicated_play(*rows("linear", motion, 0.0), removed=120e-6)
    assert too_large is not None
    assert too_large.half_width == 0.0
    assert too_large.b_change < 0.0


def test_the_changes_of_k_and_b_are_those_of_fits_with_and_without_the_play():
    found = indicated_play(*rows("linear", "sine", 100e-6, noise=1e-4, lag=1e-6))
    speed = 2.0 * math.pi * 1.3 * 3e-3
    # the damping of play in a sine, to the first order in d / A
    assert found.b_change == pytest.approx(1000.0 * 100e-6 * 4.0 / (math.pi * speed), rel=0.1)
    assert 0.0 < found.k_change < 50.0


@settings(max_examples=20, deadline=None)
@given(
    scale=st.floats(1e-2, 1e2),
    start=st.floats(-1e3, 1e3),
    datum=st.floats(-1e-2, 1e-2),
    sign=st.sampled_from((-1.0, 1.0)),
)
def test_the_unit_of_the_force_and_the_datums_do_not_matter(scale, start, datum, sign):
    t, x, f, contact = rows("stiffening", "random", 100e-6)
    reference = indicated_play(t, x, f, contact)
    found = indicated_play(t + start, sign * x + datum, sign * scale * (f - 2.0), contact)
    assert found is not None
    assert found.half_width == reference.half_width
    assert found.b_change == pytest.approx(scale * reference.b_change, rel=1e-3)
    assert found.k_change == pytest.approx(scale * reference.k_change, rel=1e-3)


SIZES = st.shared(st.integers(0, 1300), key="size")
ANY = SIZES.flatmap(lambda n: arrays(np.float64, n, elements=st.floats(), fill=st.floats()))


@settings(max_examples=20, deadline=None)
@given(t=ANY, x=ANY, f=ANY, data=st.data())
def test_no_samples_raise_an_error(t, x, f, data):
    contact = data.draw(arrays(np.bool_, len(t)))
    found = indicated_play(t, x, f, contact)
    assert found is None or found.half_width in HALF_WIDTHS


def test_overflowing_values_are_no_evidence():
    t, x, f, contact = rows("linear", "sine", 100e-6)
    assert indicated_play(t, 1e300 * x, f, contact) is None
    assert indicated_play(t, x, 1e300 * f, contact) is None


def test_nothing_is_indicated_from_too_little_motion_in_contact():
    t, x, f, contact = rows("linear", "sine", 100e-6)
    assert indicated_play(t, x, f, np.full(t.size, False)) is None
    assert indicated_play(t[:300], x[:300], f[:300], contact[:300]) is None
    assert indicated_play(t, 4e-3 + 0.05 * (x - 4e-3), f, contact) is None
    assert indicated_play(t, x, np.full(t.size, np.nan), contact) is None
