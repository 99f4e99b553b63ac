"""The predicted stability of position-force feedback, against simulations of the delayed loop."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from teleop.control.feedback.stability import DelayedLoop

LOOPS = st.builds(
    DelayedLoop,
    mass=st.floats(0.2, 2.0),
    damping=st.floats(5.0, 200.0),
    arm_stiffness=st.floats(0.0, 1500.0),
    arm_damping=st.floats(0.0, 50.0),
    k=st.floats(1600.0, 30_000.0),
    b=st.floats(0.0, 10.0),
    gain=st.floats(0.2, 2.0),
)


def amplitudes(loop, delay, periods=30):
    """Return the largest position in the second and in the last third of a simulation.

    The linear delayed equation is integrated by small semi-implicit steps from a pushed start.
    """
    step = min(2e-5, delay / 200.0)
    back = max(round(delay / step), 1)
    rate = math.sqrt((loop.gain * loop.k + loop.arm_stiffness) / loop.mass)
    steps = round(max(periods / rate * 6.0, 20.0 * delay) / step)
    steps = min(steps, 400_000)
    x, v = 1.0, 0.0
    past = [0.0] * back
    largest = [0.0, 0.0, 0.0]
    resistance = loop.damping + loop.arm_damping
    for n in range(steps):
        delayed, past[n % back] = past[n % back], loop.gain * (loop.k * x + loop.b * v)
        v += step / loop.mass * (-resistance * v - loop.arm_stiffness * x - delayed)
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
    assume(delay < math.inf)
    resistance, k, b = loop.damping + loop.arm_damping, loop.gain * loop.k, loop.gain * loop.b
    squares = np.roots(
        [
            loop.mass**2,
            resistance**2 - 2.0 * loop.mass * loop.arm_stiffness - b * b,
            loop.arm_stiffness**2 - k * k,
        ]
    )

    def characteristic(w):
        s = 1j * w
        free = loop.mass * s * s + resistance * s + loop.arm_stiffness
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
