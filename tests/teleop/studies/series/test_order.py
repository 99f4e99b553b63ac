"""Orders of trials."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.studies.series.order import ordered


@given(
    st.integers(1, 30),
    st.sampled_from(["listed", "random", "latin-square"]),
    st.integers(),
    st.integers(0, 100),
)
def test_each_order_has_each_cell_once_and_depends_on_the_seed_alone(count, order, seed, block):
    found = ordered(count, order, seed, block)
    assert sorted(found) == list(range(count))
    assert found == ordered(count, order, seed, block)


@pytest.mark.parametrize("count", [2, 4, 6, 10])
def test_in_a_latin_square_of_even_size_each_cell_follows_each_other_once(count):
    rows = [ordered(count, "latin-square", 3, block) for block in range(count)]
    followers = Counter(pair for row in rows for pair in pairwise(row))
    assert set(followers.values()) == {1}
    assert len(followers) == count * (count - 1)
    for place in range(count):
        assert len({row[place] for row in rows}) == count


@pytest.mark.parametrize("count", [3, 5, 9])
def test_in_a_latin_square_of_odd_size_each_cell_follows_each_other_twice(count):
    rows = [ordered(count, "latin-square", 3, block) for block in range(2 * count)]
    followers = Counter(pair for row in rows for pair in pairwise(row))
    assert set(followers.values()) == {2}


def test_random_orders_of_two_blocks_differ():
    assert ordered(20, "random", 0, 0) != ordered(20, "random", 0, 1)
