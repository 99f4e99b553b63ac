"""The predicted stability of position-force feedback, against simulations of the delayed loop."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from teleop.control.feedback.stability import (
    DelayedLoop,
    response_of_compensated_play,
    response_of_play,
)

LOOPS = st.builds(
    DelayedLoop,
    mass=st.floats(0.2, 2.0),
    damping=st.floats(5.0, 200.0),
    arm_stiffness=st.floats(0.0, 1500.0),
    arm_damping=st.floats(0.0, 50.0),
    k=st.floats(1600.0, 30_000.0),
    b=st.floats(0.0, 10.0),
    gain=st.floats(0.2, 2.0),
    arm_lag=st.floats(0.0, 0.01),
    spring=st.floats(0.0, 500.0),
)


def amplitudes(loop, delay, periods=30):
    """Return the largest position in the second and in the last third of a simulation.

    The linear delayed equation is integrated by small semi-implicit steps from a pushed start.
    """
    step = min(2e-5, delay / 200.0)
    back = max(round(delay / step), 1)
    rate = math.sqrt((loop.gain * loop.k + loop.arm_stiffness + loop.spring) / loop.mass)
    steps = round(max(periods / rate * 6.0, 20.0 * delay) / step)
    steps = min(steps, 400_000)
    x, v = 1.0, 0.0
    past = [0.0] * back
    largest = [0.0, 0.0, 0.0]
    resistance, stiffness = loop.resistance, loop.arm_stiffness + loop.spring
    for n in range(steps):
        delayed, past[n % back] = past[n % back], loop.gain * (loop.k * x + loop.b * v)
        v += step / loop.mass * (-resistance * v - stiffness * x - delayed)
        x += step * v
        third = 3 * n // steps
        largest[third] = max(largest[third], abs(x))
    return largest[1], largest[2]


@pytest.mark.parametrize(
    "loop",
    [
        DelayedLoop(0.5, 15.0, 400.0, 12.0, 2063.0),
        DelayedLoop(0.5, 200.0, 400.0, 12.0, 4519.0, 6.0),
        DelayedLoop(0.5, 50.0, 1500.0, 23.0, 7461.0, 11.0, gain=0.5),
        DelayedLoop(1.0, 100.0, 0.0, 0.0, 20_000.0),
        DelayedLoop(0.5, 30.0, 1500.0, 23.0, 2063.0, arm_lag=6.5e-3, spring=300.0),
    ],
)
def test_the_loop_is_stable_below_the_largest_delay_and_unstable_above(loop):
    middle, last = amplitudes(loop, 0.8 * loop.largest_delay)
    assert last < middle
    middle, last = amplitudes(loop, 1.25 * loop.largest_delay)
    assert last > middle


@given(LOOPS)
def test_the_largest_delay_is_a_crossing_of_the_imaginary_axis(loop):
    delay = loop.largest_delay
    assume(0.0 < delay < math.inf)
    resistance, k, b = loop.resistance, loop.gain * loop.k, loop.gain * loop.b
    stiffness = loop.arm_stiffness + loop.spring
    squares = np.roots(
        [
            loop.mass**2,
            resistance**2 - 2.0 * loop.mass * stiffness - b * b,
            stiffness**2 - k * k,
        ]
    )

    def characteristic(w):
        s = 1j * w
        free = loop.mass * s * s + resistance * s + stiffness
        return abs(free + (k + b * s) * cmath.exp(-s * delay)) / k

    crossings = [math.sqrt(z.real) for z in squares if abs(z.imag) < 1e-6 * abs(z) and z.real > 0.0]
    assert min(map(characteristic, crossings)) < 1e-6


@given(LOOPS, st.floats(1e-3, 0.1))
def test_a_small_delay_is_the_negative_damping_of_the_approximation(loop, share):
    assume(loop.arm_stiffness == 0.0 or loop.arm_stiffness < 0.1 * loop.gain * loop.k)
    heavy = DelayedLoop(
        loop.mass, share * 20.0, 0.0, 0.0, loop.k, 0.0, loop.gain
    )  # little damping: crossing at sqrt(k / m)
    rate = math.sqrt(heavy.gain * heavy.k / heavy.mass)
    assume(heavy.safe_delay * rate < 0.2)
    assert heavy.largest_delay == pytest.approx(heavy.safe_delay, rel=0.05)


@given(LOOPS)
def test_the_safe_delay_is_sufficient_for_stability(loop):
    without_damping = replace(loop, b=0.0)
    assert without_damping.safe_delay <= without_damping.largest_delay * (1.0 + 1e-9)


def test_an_arm_stiffer_than_the_environment_is_stable_with_any_delay():
    assert DelayedLoop(0.5, 100.0, 3000.0, 12.0, 2000.0).largest_delay == math.inf


@given(LOOPS)
def test_with_the_safe_delay_and_no_arm_the_delayed_environment_is_passive(loop):
    no_arm = replace(loop, arm_stiffness=0.0, arm_damping=0.0, b=0.0)
    delay, k = no_arm.safe_delay, no_arm.gain * no_arm.k
    w = np.geomspace(1e-2, 1e5, 200)
    assert np.all(no_arm.damping + (k * np.exp(-1j * w * delay) / (1j * w)).real > -1e-6)
    longer = (no_arm.damping + (k * np.exp(-1j * 1e-2 * 1.1 * delay) / 1e-2j)).real
    assert longer < 0.0


@given(LOOPS, st.floats(1.01, 10.0))
def test_a_loop_without_damping_is_unstable_with_any_delay(loop, factor):
    none = loop.damping + loop.arm_damping + loop.gain * loop.b
    stiff = replace(loop, arm_stiffness=factor * none / 5e-3, arm_lag=5e-3)
    assert stiff.safe_delay == 0.0
    assert stiff.largest_delay == 0.0


def test_the_spring_does_not_reduce_the_safe_delay():
    loop = DelayedLoop(0.5, 15.0, 400.0, 12.0, 2063.0, arm_lag=6.5e-3)
    assert replace(loop, spring=500.0).safe_delay == loop.safe_delay


@pytest.mark.parametrize(
    ("k", "damping", "arm_stiffness", "arm_damping", "full"),
    [
        (2174.6, 15.0, 1500.0, 23.2, 10.4e-3),
        (5074.5, 15.0, 400.0, 12.0, 0.7e-3),
        (5074.5, 30.0, 1500.0, 23.2, 4.5e-3),
    ],
)
def test_the_safe_delay_is_below_that_of_the_full_model_of_the_simulated_rig(
    k, damping, arm_stiffness, arm_damping, full
):
    """`full` is the largest stable round trip of a model with servo, force channels and loop."""
    loop = DelayedLoop(0.5, damping, arm_stiffness, arm_damping, k, arm_lag=6.48e-3)
    assert loop.safe_delay - 4.16e-3 <= full + 0.1e-3


def play_loop_amplitude(loop, delay, half_width, start):
    """Return the amplitude after 12 s of a simulation of the delayed loop with a play [m]."""
    step = 1e-4
    back = max(round(delay / step), 1)
    x, v, played = start, 0.0, 0.0
    past = [0.0] * back
    largest = 0.0
    for n in range(120_000):
        if abs(x - played) > half_width:
            played = x - math.copysign(half_width, x - played)
        past.append(loop.gain * loop.k * played)
        force = past.pop(0)
        v += step / loop.mass * (-loop.resistance * v - loop.arm_stiffness * x - force)
        x += v * step
        if n > 100_000:
            largest = max(largest, abs(x))
    return largest


@pytest.mark.parametrize(
    ("damping", "arm", "delay"),
    [(10.0, 250.0, 6.8e-3), (15.0, 250.0, 9e-3), (30.0, 400.0, 8e-3), (15.0, 0.0, 1e-3)],
)
def test_the_limit_cycle_of_lost_motion_is_that_of_a_simulation(damping, arm, delay):
    """The describing function neglects harmonics, so that its amplitude is approximate."""
    loop = DelayedLoop(0.5, damping, arm, 5.0 if arm else 0.0, 2100.0)
    half_width = 120e-6
    assert delay < loop.safe_delay
    found = loop.limit_cycle(delay, response_of_play(half_width))
    simulated = play_loop_amplitude(loop, delay, half_width, 3e-3)
    if found is None:
        assert simulated < 1.5 * half_width
    else:
        assert simulated == pytest.approx(found.amplitude, rel=0.35)


@given(LOOPS, st.floats(1e-6, 1e-3), st.floats(1.5, 10.0))
def test_the_limit_cycle_is_proportional_to_the_lost_motion(loop, half_width, factor):
    delay = 0.5 * loop.safe_delay
    one, other = (
        loop.limit_cycle(delay, response_of_play(width))
        for width in (half_width, factor * half_width)
    )
    assert (one is None) == (other is None)
    if one and other:
        assert other.amplitude == pytest.approx(factor * one.amplitude)
        assert other.frequency == one.frequency
    assert loop.limit_cycle(delay, response_of_play(0.0)) is None


def test_the_compensation_makes_the_limit_cycle_at_least_ten_times_smaller():
    loop = DelayedLoop(0.5, 15.0, 250.0, 5.0, 2100.0)
    with_play = loop.limit_cycle(9e-3, response_of_play(120e-6))
    compensated = loop.limit_cycle(9e-3, response_of_compensated_play(120e-6))
    assert with_play.amplitude > 400e-6
    assert compensated is None or compensated.amplitude < 0.1 * with_play.amplitude
    wrong = loop.limit_cycle(9e-3, response_of_compensated_play(120e-6, 30e-6))
    assert wrong.amplitude > 60e-6


def test_the_numerical_describing_function_of_a_play_is_the_analytical_one():
    exact = dict(response_of_play(50e-6))
    inverse = {a: n for a, n in response_of_compensated_play(1e-12, 50e-6 - 1e-12) if a > 60e-6}
    for amplitude, response in inverse.items():
        nearest = min(exact, key=lambda a: abs(a - amplitude))
        assert abs(response - exact[nearest]) < 0.05
