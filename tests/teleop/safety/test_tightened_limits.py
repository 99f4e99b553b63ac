"""Limits of a trial are never looser than those of its rig."""

from __future__ import annotations

from dataclasses import fields

from hypothesis import assume, given
from hypothesis import strategies as st

from teleop.errors import InputError
from teleop.safety import Limits
from teleop.safety.tightened_limits import TightenedLimits
from teleop.trial.settings import TrialSettings

RIG = Limits()


def some(name):
    """No value, or one about that of the rig."""
    value = getattr(RIG, name)
    if name.endswith("_position"):
        return st.none() | st.tuples(st.floats(-0.03, 0.0), st.floats(1e-6, 0.03))
    return st.none() | st.floats(0.1 * value, 1.2 * value)


STATED = st.builds(TightenedLimits, **{f.name: some(f.name) for f in fields(TightenedLimits)})


@given(STATED)
def test_the_limits_of_a_trial_are_the_stated_ones_or_those_of_the_rig_and_never_looser(stated):
    try:
        limits = TrialSettings(custom_limits=RIG, tightened_limits=stated).raw_limits
    except InputError:
        assume(False)
    for field in fields(TightenedLimits):
        given_value, found = getattr(stated, field.name), getattr(limits, field.name)
        present = getattr(RIG, field.name)
        assert found == (present if given_value is None else given_value)
        if field.name.endswith("_position"):
            assert present[0] <= found[0] < found[1] <= present[1]
        else:
            assert found <= present
