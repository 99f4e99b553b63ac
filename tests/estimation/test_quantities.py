"""One table states the unit and the decimals with which results are shown."""

from __future__ import annotations

from dataclasses import replace

import pytest

from estimation.quantities import STIFFNESS, quantity

IN_N_PER_MM = replace(STIFFNESS, unit="N/mm", factor=1e-3, decimals=3, large=())


def test_a_person_sees_the_shown_unit_and_a_file_contains_the_si_unit():
    assert IN_N_PER_MM.heading == "k [N/mm]"
    assert IN_N_PER_MM.column == "k [N/m]"
    assert IN_N_PER_MM.text(2100.0) == "2.100 N/mm"
    assert IN_N_PER_MM.text(2100.0, ".2g") == "2.1 N/mm"


@pytest.mark.parametrize(("value", "text"), [(-0.2, "0"), (float("nan"), "-"), (2100.4, "2100")])
def test_a_number_has_the_decimals_of_its_quantity(value, text):
    assert STIFFNESS.number(value) == text


@pytest.mark.parametrize(
    ("largest", "expected"), [(999.0, (1.0, "N/m")), (1e3, (1e-3, "kN/m")), (2e6, (1e-6, "MN/m"))]
)
def test_an_axis_with_large_values_has_a_larger_unit(largest, expected):
    assert STIFFNESS.axis(largest) == expected
    assert IN_N_PER_MM.axis(largest) == (1e-3, "N/mm")


def test_a_parameter_that_is_not_in_the_table_is_shown_in_its_si_unit():
    assert quantity("k3", "N/m^3").text(2.0, "g") == "2 N/m^3"
    assert quantity("k", "N/m") is STIFFNESS
