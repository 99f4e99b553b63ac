"""The motion that the slave receives over a channel with jitter and loss."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.control.channel import ChannelSettings, Direction
from teleop.control.feedback.law import MasterMotion
from teleop.control.playout import Playout

DT = 1e-3


def motion(t):
    return MasterMotion(
        5e-3 * math.sin(2.0 * math.pi * t), 5e-3 * 2 * math.pi * math.cos(6.2832 * t)
    )


@given(
    delay=st.floats(0.0, 0.2),
    jitter=st.floats(0.0, 0.05),
    loss=st.floats(0.0, 0.3),
    seed=st.integers(0, 1000),
)
def test_the_played_motion_is_that_of_the_master_at_the_stated_time(delay, jitter, loss, seed):
    direction = Direction(ChannelSettings(delay, jitter, loss), str(seed), motion(0.0))
    playout = Playout()
    playout.reset(0.0, motion(0.0))
    before = 0.0
    for n in range(800):
        now = n * DT
        newest = direction.exchange(now, motion(now))
        found = playout.update(now, direction.sent, newest)
        assert before - 1e-12 <= playout.time <= now
        if playout.time > 0.05:
            assert found.position == pytest.approx(motion(playout.time).position, abs=2e-6)
        before = playout.time


def test_without_jitter_and_loss_the_motion_is_that_of_the_newest_packet():
    direction = Direction(ChannelSettings(0.05), "0", motion(0.0))
    playout = Playout()
    playout.reset(0.0, motion(0.0))
    for n in range(300):
        now = n * DT
        newest = direction.exchange(now, motion(now))
        found = playout.update(now, direction.sent, newest)
        if n > 60:
            assert found == pytest.approx(newest)
            assert playout.time == pytest.approx(now - 0.05)


def test_after_an_outage_the_delay_is_again_that_of_the_channel():
    """Otherwise, the delay of one outage would remain for seconds in the loop of the feedback."""
    direction = Direction(ChannelSettings(0.008, 0.002), "3", motion(0.0))
    playout = Playout(0.010)
    playout.reset(0.0, motion(0.0))
    for n in range(800):
        now = n * DT
        direction.cut = 0.3 < now < 0.39
        newest = direction.exchange(now, motion(now))
        found = playout.update(now, direction.sent, newest)
        if 0.37 < now < 0.39:
            assert found.velocity == 0.0
        if now > 0.42:
            assert now - playout.time < 0.0125


def test_while_no_packet_arrives_the_motion_stops():
    playout = Playout()
    playout.reset(0.0, MasterMotion(0.0))
    playout.update(DT, DT, MasterMotion(1e-3, 0.1))
    for n in range(2, 20):
        found = playout.update(n * DT, DT, MasterMotion(1e-3, 0.1))
        assert found.position == pytest.approx(1e-3)
        assert found.velocity == 0.0
