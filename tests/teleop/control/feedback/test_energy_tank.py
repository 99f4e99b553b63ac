"""The energy tank pays only with energy that it has."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.control.feedback.energy_tank import EnergyTank

STEPS = st.lists(st.tuples(st.floats(0.0, 0.02), st.floats(-0.02, 0.02)), max_size=60)


@given(STEPS)
def test_the_tank_pays_at_most_its_start_and_what_filled_it(steps):
    tank = EnergyTank(5e-3, 50e-3)
    filled = paid = 0.0
    for energy, cost in steps:
        tank.fill(energy)
        filled += energy
        share = tank.affordable(cost)
        assert 0.0 <= share <= 1.0
        tank.pay(share * cost)
        paid += max(share * cost, 0.0)
        assert 0.0 <= tank.energy <= 50e-3
        assert paid <= (5e-3 + filled) * (1.0 + 1e-9)


def test_what_exceeds_the_tank_cannot_be_paid():
    with pytest.raises(ValueError, match="cannot pay"):
        EnergyTank(5e-3).pay(6e-3)


def test_a_negative_cost_does_not_fill_the_tank():
    tank = EnergyTank(5e-3)
    tank.pay(-1.0)
    assert tank.energy == 5e-3


@pytest.mark.parametrize("start", [-1e-3, 60e-3])
def test_a_start_outside_of_the_capacity_is_refused(start):
    with pytest.raises(ValueError, match="start of the tank"):
        EnergyTank(start)
