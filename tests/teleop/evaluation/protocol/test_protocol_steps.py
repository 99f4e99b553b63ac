"""Relaxation, creep and complex stiffness of simulated bodies, against independent solutions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from estimation.filters import Play
from estimation.transmission import RIGID, TransmissionCalibration
from teleop.evaluation.protocol.dynamic import dynamic_stiffness
from teleop.evaluation.protocol.exponentials import fit_decay

SPRING, BRANCHES = 2000.0, ((800.0, 0.6), (500.0, 6.0))
T = np.arange(-0.3, 20.0, 2e-3)


def position(t):
    """A ramp of 0.2 s to 1 mm, and a hold that drifts by 1 %."""
    return 1e-3 * np.clip((t + 0.2) / 0.2, 0.0, 1.0) + 1e-5 * np.clip(t / 20.0, 0.0, 1.0)


def relaxing(t, x_of):
    """Contact force of a generalised Maxwell body, by an integrator of scipy."""

    def rates(now, dashpots):
        x = float(x_of(now))
        return [(x - z) / tau for z, (_, tau) in zip(dashpots, BRANCHES, strict=True)]

    solution = solve_ivp(rates, (t[0], t[-1]), [0.0, 0.0], t_eval=t, max_step=0.02, rtol=1e-8)
    x = x_of(t)
    parts = [k * (x - z) for z, (k, _) in zip(solution.y, BRANCHES, strict=True)]
    return SPRING * x + sum(parts)


def test_the_times_of_a_relaxation_are_those_of_the_body():
    noise = np.random.default_rng(90417)
    f = relaxing(T, position)
    inside = 0
    for _ in range(10):
        measured = f + noise.normal(0.0, 0.02, len(T))
        decay = fit_decay(T, position(T), measured, 0.25)
        assert decay.reason == ""
        assert len(decay.parts) == 2
        for part, (k, tau) in zip(decay.parts, BRANCHES, strict=True):
            inside += part.low <= tau <= part.high
            assert part.tau == pytest.approx(tau, rel=0.06)
            assert 0.8e-3 * k < part.amplitude < 1e-3 * k
    assert inside >= 17


def test_without_relaxation_no_time_is_stated():
    noise = np.random.default_rng(90418)
    for _ in range(10):
        f = SPRING * position(T) + noise.normal(0.0, 0.02, len(T))
        decay = fit_decay(T, position(T), f, 0.25)
        assert decay.parts == ()
        assert "no relaxation" in decay.reason


def test_a_time_that_is_longer_than_the_hold_is_not_determined():
    short = T[T < 3.0]
    f = relaxing(short, position) + np.random.default_rng(90419).normal(0.0, 0.005, len(short))
    assert "expected a longer hold" in fit_decay(short, position(short), f, 0.25).reason


KNOWN = TransmissionCalibration(force_lag=3e-3, compliance=1e-5, force_lag_error=1e-5)


@pytest.mark.parametrize("frequency", [0.5, 3.0, 9.0])
def test_the_complex_stiffness_is_that_of_a_spring_and_a_damper(frequency):
    omega, b = 2.0 * math.pi * frequency, 4.0
    t = np.arange(0.0, 8.0 / frequency, 5e-4)
    tip = 2e-3 + 3e-4 * np.sin(omega * t)
    f = SPRING * tip + b * 3e-4 * omega * np.cos(omega * t)
    x = tip + KNOWN.compliance * f
    lagged = (SPRING + 1j * omega * b) * 3e-4 * np.exp(1j * omega * t) * KNOWN.response(omega)
    measured = SPRING * 2e-3 + lagged.imag
    measured += np.random.default_rng(90420).normal(0.0, 0.01, len(t))
    found = dynamic_stiffness(t, x, measured, frequency, KNOWN)
    assert found.storage_tip == pytest.approx(SPRING, rel=0.01)
    assert found.loss_tip == pytest.approx(omega * b, abs=max(0.1 * omega * b, 10.0))
    series = (SPRING + 1j * omega * b) / (1.0 + KNOWN.compliance * (SPRING + 1j * omega * b))
    assert abs(found.storage - series.real) < 2.0 * found.storage_half
    assert abs(found.loss - series.imag) < 2.0 * found.loss_half


def test_the_loss_is_withheld_if_the_lag_is_not_known():
    t = np.arange(0.0, 8.0, 1e-3)
    x = 1e-3 * np.sin(2.0 * math.pi * t)
    found = dynamic_stiffness(t, x, 2000.0 * x, 1.0, RIGID)
    assert found.loss is None
    assert "each millisecond makes it smaller by 12.6 N/m" in found.reason


@pytest.mark.parametrize(("share", "stated"), [(0.0, True), (0.03, True), (0.4, False)])
def test_a_sine_behind_lost_motion_that_is_not_known_gives_no_narrow_stiffness(share, stated):
    t = np.arange(0.0, 8.0, 1e-3)
    x = 1e-3 * np.sin(2.0 * math.pi * t)
    f = SPRING * Play(share * 1e-3).run(x) + np.random.default_rng(90421).normal(0.0, 0.01, len(t))
    found = dynamic_stiffness(t, x, f, 1.0, RIGID)
    if not stated:
        assert found.storage is None
        assert "as with lost motion" in found.reason
    else:
        assert abs(found.storage - SPRING) < found.storage_half
