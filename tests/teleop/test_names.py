"""The names of options are those of the parts that they choose."""

from __future__ import annotations

from typing import get_args

from estimation.conditioning import CONDITIONERS
from estimation.model import MODELS
from sim_backend import CUBES
from teleop.commands.trial_options import make_coupling, make_signal
from teleop.control.conditions import CONDITIONS
from teleop.names import (
    ConditioningName,
    ConditionName,
    CouplingName,
    CubeName,
    ModelName,
    SignalName,
)


def test_each_name_of_an_option_chooses_a_part_and_each_part_has_a_name():
    assert get_args(ConditionName) == tuple(CONDITIONS)
    assert get_args(CubeName) == tuple(CUBES)
    assert get_args(ConditioningName) == CONDITIONERS
    assert get_args(ModelName) == tuple(MODELS)
    assert [make_signal(name, 1.0).kind for name in get_args(SignalName)] == [*get_args(SignalName)]
    assert len({make_coupling(name) for name in get_args(CouplingName)}) == 2
