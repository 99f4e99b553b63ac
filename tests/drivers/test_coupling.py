"""The virtual coupling against the theory of sampled springs, and an integrated moving part."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from drivers.coupling import (
    CouplingParameters,
    VirtualCoupling,
    is_stable,
    stable_bandwidth,
    velocity_loop,
)

PERIOD = 1e-3


@pytest.mark.parametrize(("latency", "limit"), [(0, 1000.0), (1, 1000.0 / 3.0), (2, 200.0)])
def test_the_limit_of_a_spring_is_that_of_colgate_and_schenkel(latency, limit):
    coupling = CouplingParameters(1.0, latency=latency, friction=0.5)
    assert coupling.largest_stiffness(PERIOD) == pytest.approx(limit, rel=1e-5)
    spring = CouplingParameters(limit, latency=latency)
    assert spring.needed_friction(PERIOD) == pytest.approx(0.5, rel=1e-5)


def test_a_damper_without_latency_needs_as_much_friction_as_it_has():
    # Colgate and Schenkel (1997): b > K T / 2 + |B|, with an unfiltered velocity.
    coupling = CouplingParameters(400.0, 3.0, bandwidth=1e6)
    assert coupling.needed_friction(PERIOD) == pytest.approx(0.2 + 3.0, rel=1e-3)


def free_motion(coupling, mass, speed, seconds=0.6, hand=(0.0, 0.0), resolution=1e-7):
    """Positions of a moving part that starts with a speed, and the first error of the coupling.

    Between two samples, scipy integrates the motion; the motor acts after the latency.
    """
    virtual = VirtualCoupling(coupling)
    virtual.measure(0.0, -PERIOD)
    virtual.hold()
    forces = [0.0] * (coupling.latency + 1)
    state, found, failed = [0.0, speed], [], math.nan
    stiffness, damping = hand
    for k in range(int(seconds / PERIOD)):
        force = virtual.measure(round(state[0] / resolution) * resolution, k * PERIOD)
        forces = [*forces[1:], -force]
        if virtual.error and math.isnan(failed):
            failed = k * PERIOD

        def motion(_, y, push=forces[0]):
            x, v = y
            rate = push - (coupling.friction + damping) * v - stiffness * x
            return [v, rate / mass]

        state = solve_ivp(motion, (0.0, PERIOD), state, rtol=1e-9, atol=1e-12).y[:, -1]
        found.append(state[0])
    return found, failed, virtual


@pytest.mark.parametrize("latency", [0, 1, 2])
def test_a_released_handle_is_stable_below_the_limit_and_unstable_above(latency):
    limit = CouplingParameters(1.0, latency=latency, friction=0.5).largest_stiffness(PERIOD)
    for factor, stable in ((0.9, True), (1.15, False)):
        coupling = CouplingParameters(factor * limit, latency=latency, friction=0.5)
        assert is_stable(coupling, PERIOD, mass=0.05) is stable
        found, failed, _ = free_motion(coupling, 0.05, 0.02)
        early, late = max(map(abs, found[:200])), max(map(abs, found[-200:]))
        assert bool(late < early) is stable
        assert math.isnan(failed) or not stable


@pytest.mark.parametrize("latency", [1, 2])
def test_a_released_handle_at_three_times_the_limit_is_reported_within_200_ms(latency):
    limit = CouplingParameters(1.0, latency=latency, friction=0.5).largest_stiffness(PERIOD)
    coupling = CouplingParameters(3.0 * limit, max_force=8.0, latency=latency, friction=0.5)
    _, failed, virtual = free_motion(coupling, 0.1, 0.1, 0.25)
    assert failed < 0.2
    assert "energy" in virtual.error or "stretched" in virtual.error


@settings(max_examples=25, deadline=None)
@given(
    st.floats(0.3, 1.0),
    st.integers(0, 3),
    st.floats(0.1, 3.0),
    st.floats(0.02, 1.0),
    st.tuples(st.floats(0.0, 2000.0), st.floats(0.0, 30.0)),
)
def test_no_hand_makes_a_passive_coupling_oscillate_or_report_energy(
    share, latency, friction, mass, hand
):
    limit = CouplingParameters(1.0, latency=latency, friction=friction).largest_stiffness(PERIOD)
    coupling = CouplingParameters(share * limit, latency=latency, friction=friction)
    found, failed, _ = free_motion(coupling, mass, 0.05, 0.15, hand)
    assert math.isnan(failed)
    assert max(map(abs, found)) < 0.05


def test_the_force_is_limited_and_a_stretch_beyond_it_is_reported():
    virtual = VirtualCoupling(CouplingParameters(100.0, max_force=2.0, friction=1.0))
    virtual.measure(0.0, 0.0)
    virtual.hold()
    # A hand moves the handle slowly, by 0.1 mm in each period.
    forces = [virtual.measure(0.1e-3 * k, k * PERIOD) for k in range(1, 401)]
    assert forces[99] == pytest.approx(1.0)
    assert forces[299] == 2.0
    assert not virtual.error
    virtual.measure(40.1e-3, 401 * PERIOD)
    assert "stretched by 40.1 mm, at most 40.0 mm" in virtual.error


def test_the_proxy_moves_with_the_command_and_not_after_an_interruption():
    virtual = VirtualCoupling(CouplingParameters(100.0), longest_step=0.02)
    virtual.measure(0.5, 0.0)
    virtual.hold()
    virtual.velocity = 0.1
    virtual.measure(0.5, 0.01)
    assert virtual.proxy == pytest.approx(0.501)
    virtual.measure(0.5, 1.01)
    assert virtual.proxy == pytest.approx(0.503)
    virtual.release()
    assert virtual.measure(0.7, 1.02) == 0.0
    assert virtual.proxy == 0.7


@pytest.mark.parametrize("latency", range(4))
def test_the_velocity_loop_has_half_of_the_stable_bandwidth(latency):
    loop = velocity_loop(3.0, 0.0, latency, PERIOD, 100.0)
    assert is_stable(loop, PERIOD, 3.0)
    rate = loop.damping / 3.0
    assert rate / (2 * math.pi) == pytest.approx(0.5 * stable_bandwidth(latency, PERIOD))
    found, _, _ = free_motion(loop, 3.0, 0.02, 0.4)
    assert max(map(abs, found[-50:])) < 1e-6


@pytest.mark.parametrize(
    ("name", "value"),
    [("stiffness", 0.0), ("damping", -1.0), ("max_force", 0.0), ("friction", math.nan)],
)
def test_values_out_of_range_are_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        CouplingParameters(**{"stiffness": 100.0} | {name: value})


@pytest.mark.parametrize("gap", [4e-3, 10e-3])
def test_an_interruption_of_the_loop_is_not_taken_for_generated_energy(gap):
    """The sample after the interruption is older than its time of arrival shows."""
    loop = replace(velocity_loop(3.0, 0.0, 2, PERIOD, 250.0), at_hand=True)  # the tighter check
    virtual = VirtualCoupling(loop, 0.02)
    stretch, speed = 30.0 / loop.stiffness, 0.05
    virtual.measure(0.0, 0.0)
    virtual.hold()
    virtual.velocity = speed
    time = true = 0.0
    for k in range(1, 300):
        late = gap if k % 60 == 0 else PERIOD
        true += late
        time = true - (0.45 * gap if k % 60 == 0 else 0.0)
        virtual.measure(speed * true - min(stretch, 0.02 * speed * true), time)
    assert virtual.error == ""
