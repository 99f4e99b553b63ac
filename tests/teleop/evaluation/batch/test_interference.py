"""Interference in the force is named, and gives no stiffness at a harmonic of the motion."""

from __future__ import annotations

import numpy as np
import pytest

from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.reading.signals import Signals, periods


def result(hum, amplitude=0.4, rate=100.0, cubic=0.0, friction=0.0):
    rng = np.random.default_rng(2)
    t = np.arange(0.0, 20.0, 1.0 / rate)
    x = 2e-3 + 1e-3 * np.sin(2.0 * np.pi * t)
    v = 2.0 * np.pi * 1e-3 * np.cos(2.0 * np.pi * t)
    f = 800.0 * x + 4.0 * v + cubic * x**3 + friction * np.tanh(v / 5e-4)
    f += amplitude * np.sin(2.0 * np.pi * hum * t + 1.0) + rng.normal(0.0, 0.01, len(t))
    return analyse(Signals(t, x + rng.normal(0.0, 3e-7, len(t)), f, periods(t), "position")).result


@pytest.mark.parametrize(("hum", "order"), [(97.0, 3), (96.0, 4), (95.0, 5)])
def test_hum_aliased_onto_a_harmonic_gives_no_stiffness(hum, order):
    found = result(hum)
    assert found.k is None
    assert f"{order} times the frequency of the motion" in found.reasons[0]


@pytest.mark.parametrize(("hum", "seen"), [(98.77, 1.23), (87.3, 12.7), (92.55, 7.45)])
def test_hum_between_the_harmonics_is_a_remark(hum, seen):
    found = result(hum)
    assert found.k_low <= 800.0 <= found.k_high
    (reason,) = [reason for reason in found.reasons if "interference" in reason]
    frequency = float(reason.split(" N at ")[1].split(" Hz")[0])
    assert frequency == pytest.approx(seen, abs=0.05)


@pytest.mark.parametrize(("cubic", "friction"), [(0.0, 0.0), (1e8, 0.0), (0.0, 0.2)])
def test_a_body_that_stiffens_or_has_friction_has_no_interference(cubic, friction):
    reasons = result(97.0, 0.0, cubic=cubic, friction=friction).reasons
    assert not any("interference" in reason for reason in reasons)
