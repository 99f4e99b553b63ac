"""Quick replacements for functions of numpy give the same numbers."""

from __future__ import annotations

import numpy as np
import pytest

from estimation.batch_models.relaxation import relaxing_part
from estimation.smoothing import extended, smooth, smoothing_kernel

RNG = np.random.default_rng(1)


@pytest.mark.parametrize("count", [1, 6, 7, 30])
@pytest.mark.parametrize("shape", [(7,), (3, 7)])
def test_a_signal_is_extended_by_point_reflection_as_numpy_does(shape, count):
    values = RNG.normal(size=shape)
    widths = [(0, 0)] * (len(shape) - 1) + [(count, count)]
    expected = np.pad(values, widths, mode="reflect", reflect_type="odd")
    np.testing.assert_array_equal(extended(values, count), expected)


@pytest.mark.parametrize("width", [0.05, 0.8, 3.0])
def test_smoothing_is_the_convolution_of_the_extended_signal(width):
    values, kernel = RNG.normal(size=50), smoothing_kernel(width)
    half = len(kernel) // 2
    padded = np.pad(values, half, mode="reflect", reflect_type="odd")
    expected = [kernel[::-1] @ padded[i : i + len(kernel)] for i in range(50)]
    np.testing.assert_allclose(smooth(values, width), expected, atol=1e-13)


def test_a_kernel_that_all_callers_share_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        smoothing_kernel(3.0)[0] = 1.0


def test_the_relaxing_parts_of_several_signals_are_those_of_each():
    signals = RNG.normal(size=(2, 3, 200))
    found = relaxing_part([signals], 1e-3, 0.05)
    for i in np.ndindex(2, 3):
        np.testing.assert_array_equal(found[i], relaxing_part([signals[i]], 1e-3, 0.05))
