"""The progress line: no contact, estimates that do not fit, and outputs other than terminals."""

from __future__ import annotations

import math
import os
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.live.progress import Progress, Status


@pytest.fixture
def drawn(monkeypatch):
    """Return a function that draws estimates and returns the text of the line."""
    progress = Progress(True, 10.0, "", "", largest_misfit=0.05)
    lines: list[str] = []
    monkeypatch.setattr(progress, "_terminal", SimpleNamespace(draw=lines.append))

    def draw(estimates, columns=200):
        size = SimpleNamespace(columns=columns)
        monkeypatch.setattr(os, "get_terminal_size", lambda end: size)
        progress.show(1.0, lambda: Status("active", math.nan, 0.0, estimates))
        return lines[-1]

    return draw


def test_without_contact_no_number_is_shown(drawn):
    line = drawn(None)
    assert "no contact" in line
    assert "k [N/m]" not in line


def test_an_estimate_that_does_not_fit_is_marked(drawn):
    line = drawn([("rls", 5.0, 2000.0, 0.01), ("me", 5.0, 1000.0, 0.2)])
    assert "[N s/m], * misfit:  rls  2000    +5   me  1000    +5*" in line


def test_a_misfit_that_is_not_known_yet_is_not_marked(drawn):
    assert "+5*" not in drawn([("rls", 5.0, 2000.0, float("nan"))])


def test_on_a_narrow_terminal_whole_estimates_are_shown(drawn):
    estimates = [("rls", 5.0, 2000.0, 0.01), ("me", 5.0, 1000.0, 0.2)]
    assert drawn(estimates, 50).endswith("  k, b:  rls  2000    +5 \x1b[K")


@given(
    st.integers(40, 200),
    st.lists(st.floats(-9999, 9999), min_size=3, max_size=3),
    st.sampled_from(["active", "stopping"]),
    st.floats(0.0, 0.2),
)
def test_the_estimators_that_are_shown_depend_neither_on_the_values_nor_on_the_mode(
    columns, values, mode, misfit
):
    def names(values, mode, misfit):
        lines: list[str] = []
        progress = Progress(True, 10.0, "Enter stops", "", largest_misfit=0.05)
        progress._terminal = SimpleNamespace(draw=lines.append)
        estimates = [
            (name, 0.1 * value, value, misfit)
            for name, value in zip(("rls", "ai", "me"), values, strict=True)
        ]
        with pytest.MonkeyPatch.context() as patch:
            size = SimpleNamespace(columns=columns)
            patch.setattr(os, "get_terminal_size", lambda end: size)
            progress.show(1.0, lambda: Status(mode, math.nan, 0.0, estimates))
        assert len(lines[0]) - len("\r\x1b[K") < columns
        return [name for name in ("rls", "ai", "me") if f" {name} " in lines[0]]

    assert names(values, mode, misfit) == names([1.0, 1.0, 1.0], "active", 0.0)


def test_if_no_estimate_fits_there_is_no_heading(drawn):
    estimates = [("rls_conditional", 5.0, 2000.0, 0.01), ("me", 5.0, 1000.0, 0.2)]
    assert drawn(estimates, 40).endswith("1.0 of 10 s\x1b[K")


def test_without_a_terminal_spaces_replace_the_previous_line_and_nothing_is_an_escape(
    monkeypatch,
):
    def no_terminal(end):
        raise OSError

    def draw(progress, text):
        monkeypatch.setattr(os, "get_terminal_size", no_terminal)
        progress._draw(text)

    lines: list[str] = []
    progress = Progress(True, 10.0, "", "", largest_misfit=0.05)
    terminal = SimpleNamespace(draw=lines.append, write=lines.append, close=lambda: None)
    monkeypatch.setattr(progress, "_terminal", terminal)
    draw(progress, "a long line")
    draw(progress, "short")
    progress.report("stopped")
    draw(progress, "more")
    progress.close()
    assert lines == ["\ra long line", "\rshort      ", "\r     \rstopped\n", "\rmore", "\r    \r"]
