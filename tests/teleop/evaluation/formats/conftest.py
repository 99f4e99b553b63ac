from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from teleop.evaluation.formats.reader_process import Request, result_of


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


@pytest.fixture(autouse=True)
def in_this_process(request, monkeypatch):
    """Read files without another process, to save time; `test_reader_process.py` tests it."""
    apart = request.module.__name__.endswith("test_reader_process")
    if apart or "library" in request.fixturenames:
        return

    def read(*arguments):
        result = result_of(Request(*arguments, memory=0, seconds=0.0))
        if isinstance(result, Exception):
            raise result
        return result

    monkeypatch.setattr("teleop.evaluation.formats.reader_process.read_apart", read)


@pytest.fixture
def library(monkeypatch, tmp_path):
    """Returns a function that replaces a library by some code in the process that reads files."""

    def replace(name, code):
        folder = tmp_path / "libraries"
        folder.mkdir(exist_ok=True)
        (folder / f"{name}.py").write_text(code)
        monkeypatch.setenv("PYTHONPATH", str(folder))

    return replace


@pytest.fixture
def without(library):
    """Returns a function that removes a library, as where the extra is not installed."""
    return lambda name: library(name, "raise ImportError")
