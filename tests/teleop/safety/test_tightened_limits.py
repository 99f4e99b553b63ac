"""Limits of a trial are never looser than those of its rig."""

from __future__ import annotations

from dataclasses import fields, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.errors import InputError
from teleop.safety import Limits
from teleop.safety.tightened_limits import TightenedLimits
from teleop.settings.trial_settings import TrialSettings

RIG = Limits()
NAMES = [field.name for field in fields(TightenedLimits)]


def is_pair(name):
    return name.endswith("_position")


def some(name):
    """Return the name with a value about that of the rig."""
    value = getattr(RIG, name)
    if is_pair(name):
        pair = st.tuples(st.floats(-0.03, -1e-6), st.floats(1e-6, 0.03))
        return st.tuples(st.just(name), pair)
    return st.tuples(st.just(name), st.floats(0.1 * value, 1.5 * value))


@given(st.sampled_from(NAMES).flatmap(some))
def test_a_limit_is_accepted_only_if_it_is_at_least_as_tight(stated):
    name, value = stated
    present = getattr(RIG, name)
    tight = (
        (present[0] <= value[0] and value[1] <= present[1]) if is_pair(name) else value <= present
    )
    if name == "hard_force":
        tight = tight and value >= RIG.soft_force
    if name == "hard_position":
        low, high = RIG.soft_position
        tight = tight and value[0] <= low and high <= value[1]

    def made():
        return TrialSettings(custom_limits=RIG, tightened_limits=TightenedLimits(**{name: value}))

    if tight:
        assert made().raw_limits == replace(RIG, **{name: value})
    else:
        with pytest.raises(InputError, match="tightened_limits"):
            made()
