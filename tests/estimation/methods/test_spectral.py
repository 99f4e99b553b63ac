from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.methods.spectral import SpectralRatio, sine_determinant

T = 1e-3 * np.arange(10_000)


def sine(hz, depth=5e-3, amplitude=3e-3):
    w = 2.0 * math.pi * hz
    x = depth + amplitude * np.sin(w * T)
    v = amplitude * w * np.cos(w * T)
    return x, v, -(w**2) * (x - depth)


@pytest.mark.parametrize("frequency", [2.0, None])
def test_equals_the_ratio_of_fourier_transforms_at_the_motions_frequency(frequency):
    x, v, a = sine(2.0)
    x10, v10, a10 = sine(10.0, 0.0, 1e-4)
    x, v = x + x10, v + v10
    f = 0.8 * (a + a10) + 20.0 * v + 2100.0 * x + 7.0  # a mass, so that F / X varies with w
    line = round(2.0 * T[-1] + 2e-3)
    ratio = np.fft.rfft(f)[line] / np.fft.rfft(x)[line]
    estimate = SpectralRatio(periods=2.0, frequency=frequency).run(x, v, f, 1e-3)
    assert estimate.k[-1] == pytest.approx(ratio.real, rel=2e-3)
    assert estimate.b[-1] == pytest.approx(ratio.imag / (4.0 * math.pi), rel=5e-2)


def test_equals_the_windowed_sums_of_its_definition(palpation):
    s = palpation(seconds=0.5, noise=0.05)
    hz, periods = 1.3, 0.2
    estimates = SpectralRatio(periods, hz).run(*s)
    angle = 2.0 * math.pi * hz * 1e-3
    ages = np.arange(len(s.x))[::-1]
    weight = np.exp(-ages * angle / (2.0 * math.pi * periods))
    weight /= weight.sum()
    e = np.exp(1j * ages * 2.0 * math.atan(0.5 * angle))
    big = {
        name: weight @ (e * values) - (weight @ e) * (weight @ values)
        for name, values in {"x": s.x, "v": s.v, "f": s.f}.items()
    }
    equations = np.array([[big["v"].real, big["x"].real], [big["v"].imag, big["x"].imag]])
    b, k = np.linalg.solve(equations, [big["f"].real, big["f"].imag])
    assert estimates.b[-1] == pytest.approx(b, rel=1e-7)
    assert estimates.k[-1] == pytest.approx(k, rel=1e-7)


@given(periods=st.floats(0.05, 0.5), phase=st.floats(0.0, 6.3))
def test_the_determinant_of_a_sine_is_the_same_at_every_phase(periods, phase):
    angle = 2.0 * math.pi * periods
    ages = 1e-2 * np.arange(5_000)  # [rad]
    weight = np.exp(-ages / angle)
    weight /= weight.sum()
    x = math.sqrt(2.0) * np.sin(phase - ages)
    v = math.sqrt(2.0) * np.cos(phase - ages)
    e = np.exp(1j * ages)
    big_x = weight @ (e * x) - (weight @ e) * (weight @ x)
    big_v = weight @ (e * v) - (weight @ e) * (weight @ v)
    got = big_v.real * big_x.imag - big_v.imag * big_x.real
    assert abs(got) == pytest.approx(sine_determinant(angle), rel=0.1)


@pytest.mark.parametrize("k", [2000.0, 5000.0, 30000.0])
@pytest.mark.parametrize("hz", [0.3, 1.0, 3.0])
def test_one_setting_is_suitable_for_all_cubes_and_frequencies(k, hz):
    x, v, _ = sine(hz)
    noise = np.random.default_rng(0).normal(0.0, 0.02, len(x))
    estimates = SpectralRatio().run(x, v, 20.0 * v + k * x + noise, 1e-3)
    assert np.abs(estimates.k[5000:] / k - 1.0).max() < 0.02
    assert not estimates.held[5000:].any()
    assert np.isnan(estimates.k_std).all()


def test_a_jump_of_stiffness_is_followed_within_300_ms_at_3_hz():
    x, v, _ = sine(3.0)
    k = np.where((T >= 3.0) & (T < 6.0), 20000.0, 2000.0)
    estimates = SpectralRatio().run(x, v, 20.0 * v + k * x, 1e-3)
    off = np.abs(estimates.k / k - 1.0)
    assert off[3300:6000].max() < 0.05
    assert off[6300:].max() < 0.05


def test_a_constant_force_does_not_matter(palpation):
    s = palpation()
    plain = SpectralRatio().run(*s)
    offset = SpectralRatio().run(s.x, s.v, s.f + 50.0, s.dt)
    np.testing.assert_allclose(offset.k[1000:], plain.k[1000:], rtol=1e-6)


def test_at_rest_the_estimate_is_held(palpation):
    estimator = SpectralRatio()
    estimator.run(*palpation())
    rng = np.random.default_rng(0)
    n = 15_000
    x = 5e-3 + rng.normal(0.0, 1e-6, n)
    rest = estimator.run(x, np.gradient(x, 1e-3), 2100.0 * x + rng.normal(0.0, 0.02, n), 1e-3)
    assert rest.held[500:].all()
    assert rest.k[-1] == pytest.approx(2100.0, rel=0.02)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((0.0,), "window"),
        ((math.nan,), "window"),
        ((0.1, 1e3), "frequency"),
        ((0.1, 0.0), "frequency"),
        ((0.1, 1.0, 0.0), "motion"),
        ((0.1, 1.0, 1e-4, -1.0), "memory"),
    ],
)
def test_a_parameter_out_of_range_is_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        SpectralRatio(*arguments)
