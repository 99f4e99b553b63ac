from __future__ import annotations

import pytest

from teleop.control.wanted_precision import WantedPrecision, parse_wanted


def test_a_text_states_percentages_or_fractions_of_k_and_b():
    assert parse_wanted("k=2%,b=10%") == WantedPrecision(0.02, 0.1)
    assert parse_wanted(" b = 0.1 ") == WantedPrecision(b=0.1)
    assert parse_wanted(WantedPrecision(0.005, 0.125).text) == WantedPrecision(0.005, 0.125)


@pytest.mark.parametrize(
    "text", ["", "k", "k=", "x=2%", "k=2%,k=3%", "k=0%", "k=-1%", "b=100%", "k=nan%", "k=2 N/m"]
)
def test_a_wrong_text_is_refused_with_an_example(text):
    with pytest.raises(ValueError, match=r"until .*expected"):
        parse_wanted(text)
