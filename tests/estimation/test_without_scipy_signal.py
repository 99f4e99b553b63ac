"""Functions that replace those of `scipy.signal`, which takes long to import."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.signal.windows import dpss

from estimation.batch_models.relaxation import relaxing_part
from estimation.coherent_band import BANDWIDTH, TAPERS, slepian_tapers


@pytest.mark.parametrize("n", [16, 1001, 4096])
def test_the_tapers_are_those_of_scipy_except_for_their_signs(n):
    expected = dpss(n, BANDWIDTH, TAPERS)
    found = slepian_tapers(n)
    signs = np.sign(np.sum(found * expected, axis=1, keepdims=True))
    np.testing.assert_array_equal(signs * found, expected)


@pytest.mark.parametrize("tau", [1e-3, 0.1, 20.0])
def test_the_relaxing_part_is_that_of_a_digital_filter(tau):
    y = np.cumsum(np.random.default_rng(0).normal(size=1000))
    pieces, period = np.split(y, (300, 301)), 2e-3
    decay = math.exp(-period / tau)
    gain = tau / period * (1.0 - decay)
    expected = [lfilter([gain, -gain], [1.0, -decay], piece) for piece in pieces]
    found = relaxing_part(pieces, period, tau)
    np.testing.assert_allclose(found, np.concatenate(expected), rtol=1e-11, atol=1e-11)


def test_an_evaluation_does_not_import_scipy_signal():
    code = (
        "import sys, numpy as np\n"
        "from teleop.evaluation.evaluate import evaluate\n"
        "from teleop.evaluation.settings import EstimateSettings\n"
        "from teleop.evaluation.reading.signals import Signals, periods\n"
        "t = np.arange(0.0, 6.0, 2e-3)\n"
        "x = 3e-3 - 2e-3 * np.cos(6.0 * t)\n"
        "v = 12e-3 * np.sin(6.0 * t)\n"
        "f = 2e3 * x + 10.0 * v + np.random.default_rng(0).normal(0.0, 0.02, len(t))\n"
        "evaluate(Signals(t, x, f, periods(t), 'x'), EstimateSettings()).summary()\n"
        "print('scipy.signal' in sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
