from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest


@pytest.fixture
def motion():
    """A motion [s, m, N] that a test writes, and the check that it was read back."""
    t = np.arange(200) * 0.01
    x = 1e-3 * (1.0 + 0.5 * np.sin(6.0 * t))
    f = 2000.0 * x + 0.3

    def same(signals):
        np.testing.assert_allclose(signals.t - signals.t[0], t, atol=1e-7)
        np.testing.assert_allclose(signals.x, x, rtol=1e-6)
        np.testing.assert_allclose(signals.f, f, rtol=1e-6)
        return signals

    return SimpleNamespace(t=t, x=x, f=f, same=same)


@pytest.fixture
def without(monkeypatch):
    """Takes libraries away, as where the extra is not installed."""

    def take(*names):
        for name in names:
            monkeypatch.setitem(__import__("sys").modules, name, None)

    return take
