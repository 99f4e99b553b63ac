"""The contact point of bodies of several laws, with white and slow noise of the force."""

import numpy as np
import pytest
from scipy.signal import lfilter

from teleop.evaluation.batch.contact_phases import find_phases
from teleop.evaluation.batch.contact_point import contact_point, noise_filter
from teleop.evaluation.batch.smoothed_record import smoothed_signals
from teleop.evaluation.reading.signals import Signals, periods

RATE, SECONDS = 500.0, 24.0
LAWS = {
    "linear": (lambda d: 600.0 * d, lambda d: 4.0 + 0.0 * d),
    "sphere": (lambda d: 1900.0 * 10.0 * d**1.5, lambda d: 2.0 + 0.0 * d),
    "hunt-crossley": (lambda d: 2e4 * d**1.35, lambda d: 1.6e5 * d**1.35),
    "long toe": (lambda d: 0.05 * np.expm1(600.0 * d), lambda d: 2.0 + 0.0 * d),
}


def slow_noise(rng: np.random.Generator, count: int, time_constant: float) -> np.ndarray:
    pole = np.exp(-1.0 / (RATE * time_constant))
    values = lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], rng.normal(size=count + 3000))
    return np.asarray(values)[3000:]


def presses(law: str, surface: float, noise: str, seed: int, lowest: float = -3e-3) -> Signals:
    """Eight presses of 6 s from `lowest` to 5 mm; the noise is 0.5 % of the force or slow."""
    rng = np.random.default_rng([seed, 1311])
    t = np.arange(round(RATE * SECONDS)) / RATE
    phase = (t % 3.0) / 3.0
    x = np.interp(
        phase, [0.0, 0.1, 0.45, 0.55, 0.9, 1.0], [lowest, lowest, 5e-3, 5e-3, lowest, lowest]
    )
    x = np.convolve(np.pad(x, 50, mode="edge"), np.hanning(101) / 50.0, "valid")[: len(t)]
    d = np.maximum(x - surface, 0.0)
    elastic, damping = LAWS[law]
    f = np.where(d > 0.0, np.maximum(elastic(d) + damping(d) * np.gradient(x, 1 / RATE), 0.0), 0.0)
    size = np.ptp(f) * (0.005 if noise == "white" else 0.01)
    f = f + size * (rng.normal(size=len(t)) if noise == "white" else slow_noise(rng, len(t), 0.2))
    return Signals(t, x + 2e-6 * rng.normal(size=len(t)), f, periods(t), "position")


@pytest.mark.parametrize("noise", ["white", "slow"])
@pytest.mark.parametrize("law", LAWS)
def test_the_interval_of_the_contact_point_contains_the_surface(law: str, noise: str) -> None:
    surface = 0.4e-3
    point = find_phases(smoothed_signals(presses(law, surface, noise, 1))).contact_point
    if point is None:
        assert noise == "slow"  # the noise can hide a soft beginning
        return
    assert point.low <= surface <= point.high
    if noise == "white" or law == "linear":
        assert abs(point.value - surface) < 0.2e-3


def test_motion_inside_contact_has_no_contact_point() -> None:
    record = smoothed_signals(presses("sphere", -3e-3, "white", 2, lowest=1e-3))
    taken_for_contact = record.x > 1.05e-3
    free_force = float(np.median(record.f[~taken_for_contact]))
    assert contact_point(record, taken_for_contact, free_force, 5) is None


def test_the_filter_of_an_autoregressive_noise_makes_it_white() -> None:
    noise = 0.1 * slow_noise(np.random.default_rng(4), 20_000, 0.02)
    white = lfilter(noise_filter([noise[:10_000]], 1e-6), 1.0, noise)[100:]
    assert np.std(white) == pytest.approx(1.0, abs=0.03)
    assert abs(white[1:] @ white[:-1]) / (white @ white) < 0.03
