"""Measure which fraction of the time the buses of a rig carry data."""

from __future__ import annotations

import math
from collections.abc import Mapping

from drivers.transports.bus import Bus

LARGEST = 0.8
"""Largest load of a bus without a remark. Above it, a frame often waits for others."""


class BusLoad:
    """The load of buses from the first to the last call of `update`, once a tick."""

    def __init__(self, buses: Mapping[str, Bus]) -> None:
        self._buses = buses
        self._first: dict[str, tuple[float, float]] = {}
        self._last: dict[str, tuple[float, float]] = {}

    def update(self) -> None:
        """Store the present time and how long each bus has carried data."""
        self._last = {name: (bus.now(), bus.occupied) for name, bus in self._buses.items()}
        if not self._first:
            self._first = self._last

    def loads(self) -> dict[str, float]:
        """Return the load of each bus as a fraction of the time.

        The load is NaN if the bit rate of the bus is not known, such as that of a network.
        """
        found = {}
        for name in self._buses:
            begun, before = self._first.get(name, (0.0, math.nan))
            now, after = self._last.get(name, (0.0, math.nan))
            found[name] = (after - before) / (now - begun) if now > begun else math.nan
        return found


def overloaded(loads: Mapping[str, float], rate: float) -> list[str]:
    """Return a line for each bus whose load is larger than `LARGEST`, with what to change."""
    return [
        f"bus {name} carries data for {load:.0%} of the time at {rate:g} Hz: expected at most "
        f"{LARGEST:.0%}: a higher bit rate, a lower rate of the loop, or fewer devices on the bus"
        for name, load in loads.items()
        if load > LARGEST
    ]
