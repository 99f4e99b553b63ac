"""Limits reject invalid values with a message that names the limit."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError, fields, replace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers import CHANNELS
from teleop.safety import ChannelLimits, Limits
from teleop.safety.limits import default_channel_limits

MAY_BE_ZERO = ("drive_compliance", "drive_lag")
NUMBERS = [
    field.name
    for field in fields(Limits)
    if isinstance(field.default, float) and field.name not in MAY_BE_ZERO
]
BOUNDS = ["max_rate", "max_age", "frozen_time", "frozen_travel"]


def test_every_number_is_among_the_cases():
    assert len(NUMBERS) == len(fields(Limits)) - 5
    assert {"max_velocity", "hard_force", "preflight", "max_gap", "max_skipped_fraction"} <= set(
        NUMBERS
    )


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("value", [0.0, -0.0, -1.0, math.nan, math.inf, -math.inf])
def test_a_limit_that_is_not_positive_and_finite_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        Limits(**{name: value})


@pytest.mark.parametrize("value", [0, -1])
def test_limits_that_are_bad_integers_are_refused_by_name(value):
    for name in NUMBERS:
        with pytest.raises(ValueError, match=name):
            Limits(**{name: value})


@pytest.mark.parametrize("value", [-1e-6, math.nan, math.inf])
@pytest.mark.parametrize("name", MAY_BE_ZERO)
def test_a_property_of_a_drive_that_is_negative_or_not_finite_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        Limits(**{name: value})
    assert getattr(Limits(**{name: 0.0}), name) == 0.0


@pytest.mark.parametrize("name", NUMBERS)
def test_a_small_positive_limit_is_accepted(name):
    soft = {"soft_force": 1e-7} if name == "hard_force" else {}
    assert getattr(Limits(**soft | {name: 1e-6}), name) == 1e-6


@pytest.mark.parametrize(
    "soft",
    [
        (-26e-3, 20e-3),
        (-20e-3, 26e-3),
        (20e-3, -20e-3),
        (1e-3, 1e-3),
        (math.nan, 20e-3),
        (-20e-3, math.nan),
        (-math.inf, math.inf),
    ],
)
def test_soft_positions_outside_of_the_hard_ones_are_refused(soft):
    with pytest.raises(ValueError, match="soft position"):
        Limits(soft_position=soft)


@pytest.mark.parametrize(
    "hard",
    [
        (-19e-3, 25e-3),
        (-25e-3, 19e-3),
        (25e-3, -25e-3),
        (-math.inf, 25e-3),
        (-25e-3, math.inf),
        (math.nan, 25e-3),
    ],
)
def test_hard_positions_inside_of_the_soft_ones_or_open_are_refused(hard):
    with pytest.raises(ValueError, match="soft position"):
        Limits(hard_position=hard)


def test_soft_limits_may_equal_the_hard_ones():
    Limits(soft_position=(-25e-3, 25e-3), soft_force=80.0)


def test_a_soft_force_above_the_hard_one_is_refused():
    with pytest.raises(ValueError, match="soft force limit 81 N.*80 N"):
        Limits(soft_force=81.0)


def test_limits_of_every_channel_are_needed():
    for name in CHANNELS:
        channels = default_channel_limits()
        del channels[name]
        with pytest.raises(ValueError, match=name):
            Limits(channels=channels)


def test_limits_of_an_unknown_channel_are_refused():
    channels = default_channel_limits() | {"contact_temperature": ChannelLimits(0.0, 1.0)}
    with pytest.raises(ValueError, match="channels"):
        Limits(channels=channels)


def test_limits_do_not_share_their_channels():
    first, second = Limits(), Limits()
    first.channels["contact_force"] = ChannelLimits(-1.0, 1.0)
    assert second.channels == default_channel_limits()


def test_limits_cannot_be_changed():
    with pytest.raises(FrozenInstanceError):
        Limits().max_velocity = 1.0
    with pytest.raises(FrozenInstanceError):
        ChannelLimits(-1.0, 1.0).high = 2.0


@pytest.mark.parametrize("name", BOUNDS)
@pytest.mark.parametrize("value", [0.0, 0, -1.0, -1, math.nan, -math.inf])
def test_a_bound_of_a_channel_that_is_not_positive_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        ChannelLimits(-1.0, 1.0, **{name: value})


@pytest.mark.parametrize("name", BOUNDS)
def test_a_bound_of_a_channel_may_be_infinite(name):
    assert getattr(ChannelLimits(-1.0, 1.0, **{name: math.inf}), name) == math.inf


@pytest.mark.parametrize(
    ("low", "high"), [(1.0, 1.0), (1.0, -1.0), (math.nan, 1.0), (-1.0, math.nan)]
)
def test_an_empty_range_is_refused(low, high):
    with pytest.raises(ValueError, match="range"):
        ChannelLimits(low, high)


def test_the_default_limits_are_consistent():
    limits = Limits()
    for name, channel in limits.channels.items():
        assert channel.max_age < limits.max_gap, name
    force, position = limits.channels["contact_force"], limits.channels["slave_position"]
    speed, handle = limits.channels["slave_velocity"], limits.channels["master_force"]
    assert force.low < -limits.hard_force < limits.hard_force < force.high
    assert position.low < limits.hard_position[0] < limits.hard_position[1] < position.high
    assert speed.low < -2.0 * limits.max_velocity < 2.0 * limits.max_velocity < speed.high
    assert limits.rest_master_force < handle.high
    assert [name for name in CHANNELS if not limits.channels[name].required] == [
        "master_position",
        "slave_velocity",
    ]
    assert replace(limits) == limits


@given(zero=st.floats(-500.0, 500.0), value=st.floats(-2000.0, 2000.0))
def test_shifted_limits_compare_a_tared_value_with_the_range_of_the_sensor(zero, value):
    raw = ChannelLimits(-1000.0, 500.0)
    assume(min(abs(value - raw.low), abs(value - raw.high)) > 1e-9)
    shifted = raw.shifted(zero)
    assert (shifted.low <= value - zero <= shifted.high) == (raw.low <= value <= raw.high)


@pytest.mark.parametrize("zero", [1001.0, -1001.0, math.nan, math.inf])
def test_a_zero_that_the_sensor_cannot_read_is_refused_by_its_channel(zero):
    with pytest.raises(ValueError, match=r"contact_force .*expected a value in the range"):
        Limits().shifted({"contact_force": zero})
