"""The interval of the clock offset, with arbitrary delays and drifting clocks."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from teleop.station.clock_offset import DRIFT, OffsetBound, offset_interval

DELAYS = st.lists(st.floats(0.0, 0.5), min_size=1, max_size=30)


@given(DELAYS, DELAYS, st.floats(-1e6, 1e6), st.floats(-DRIFT, DRIFT), st.floats(1e-3, 60.0))
def test_the_interval_contains_the_offset_whatever_the_delays_are(forth, back, start, rate, gap):
    """The offset is that of this clock, which has the rate error `rate`, from an exact one."""
    own, others = OffsetBound(), OffsetBound()

    def here(true):
        return true * (1.0 + rate) + start

    true = 0.0
    for n in range(max(len(forth), len(back))):
        true += gap
        if n < len(back):  # from the other station, which sent it at the exact time `true`
            arrived = here(true + back[n])
            own.add(arrived, arrived - true)
        if n < len(forth):
            arrived = true + forth[n]
            others.add(arrived, arrived - here(true))
    later = true + 10.0
    interval = offset_interval(own.at(here(later)), others.at(later), 0.0)
    rounding = 1e-9 * abs(start) + 1e-9
    assert interval.low - rounding <= here(later) - later <= interval.high + rounding
    drifted = 3.0 * DRIFT * (later + 1.0)
    assert interval.width <= min(forth) + min(back) + 2.0 * drifted + rounding


def test_the_interval_is_as_wide_as_the_shortest_round_trip():
    own, others = OffsetBound(), OffsetBound()
    for delay in (0.03, 0.010, 0.02):
        own.add(0.0, delay + 5.0)
        others.add(0.0, 0.001 + delay - 5.0)
    interval = offset_interval(own.at(0.0), others.at(0.0), 0.0)
    assert math.isclose(interval.low, 5.0 - 0.011)
    assert math.isclose(interval.high, 5.010)
