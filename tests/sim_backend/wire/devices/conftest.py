"""Mount of an emulated sensor, with loads that a test sets."""

from __future__ import annotations

import pytest

from sim_backend.wire.emulated_device import Mount


class Loaded(Mount):
    """A mount with a constant load per signal, and without drives."""

    def __init__(self, loads: dict[str, float]) -> None:
        self.loads = dict(loads)

    def sense(self, signal: str) -> float:
        return self.loads[signal]

    def drive(self, name: str, velocity: float) -> None:
        raise AssertionError

    brake = drive  # type: ignore[assignment]


@pytest.fixture
def bench(request) -> Loaded:
    """A mount with the `LOADS` of the test's module."""
    return Loaded(request.module.LOADS)
