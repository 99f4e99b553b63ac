"""Numbers of datagrams: compared with a set that remembers all of them."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from teleop.station.sequence_window import LENGTH, NEWEST, OVERTAKEN, REPEATED, SequenceWindow

NUMBERS = st.lists(
    st.integers(0, 40) | st.integers(LENGTH - 2, LENGTH + 2) | st.integers(0, 5000), max_size=60
)


@given(NUMBERS)
def test_each_number_is_accepted_once_and_never_again(numbers):
    window, seen = SequenceWindow(), []
    for number in numbers:
        arrival = window.add(number)
        newest = max(seen, default=-1)
        if number > newest:
            assert arrival is NEWEST
        elif number in seen or number <= newest - LENGTH or number < seen[0]:
            assert arrival is REPEATED
            continue
        else:
            assert arrival is OVERTAKEN
        seen.append(number)
        assert window.newest == max(seen)
        assert window.lost == max(seen) - seen[0] + 1 - len(seen)


@given(st.permutations(range(200)), st.integers(0, 199))
def test_all_that_are_only_overtaken_count_as_received(order, lost):
    window = SequenceWindow()
    window.add(0)
    for number in order:
        if number not in (0, lost):
            window.add(number)
    assert window.lost == (0 if lost in (0, 199) else 1)
