"""The progress line: no contact, estimates that do not fit, and outputs other than terminals."""

from __future__ import annotations

import math
import os
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.live.progress import Progress, Shown, Status


@pytest.fixture
def drawn(monkeypatch):
    """Return a function that draws estimates and returns the text of the line."""
    progress = Progress(True, 10.0, "", "")
    lines: list[str] = []
    monkeypatch.setattr(progress, "_terminal", SimpleNamespace(draw=lines.append))

    def draw(estimates, columns=200, t=1.0):
        size = SimpleNamespace(columns=columns)
        monkeypatch.setattr(os, "get_terminal_size", lambda end: size)
        progress._due = 0.0
        progress.show(t, lambda: Status("active", math.nan, 0.0, estimates))
        return lines[-1]

    draw.progress = progress
    return draw


def test_without_contact_no_number_is_shown(drawn):
    line = drawn(None)
    assert "no contact" in line
    assert "k [N/m]" not in line


RLS = Shown("rls", 2000.0, 17.0, 5.0, 3.0, 0.01)
ME = Shown("me", 1000.0, 20.0, -5.0, 30.0, 0.2)
TEXTS = {
    "rls": "  rls k   2000±17 N/m b      +5±3 N s/m",
    "me": "  me k   1000±20 N/m b     -5±30 N s/m  misfit  20%",
}


def test_a_wide_terminal_shows_all_estimators_with_units_intervals_and_large_misfits(drawn):
    line = drawn([RLS, ME])
    assert line.rstrip("\x1b[K") == f"\ractive   1.0 of 10 s{TEXTS['rls']}{'':13}{TEXTS['me']}"


def test_a_terminal_of_80_columns_shows_the_best_estimator_with_units_and_interval(drawn):
    line = drawn([ME, RLS], 80)
    assert line.removesuffix("\x1b[K").rstrip() == "\ractive   1.0 of 10 s" + TEXTS["rls"]
    assert len(line) - len("\r\x1b[K") < 80


def test_the_best_estimator_has_a_small_misfit_then_a_narrow_interval(drawn):
    wide, unknown = RLS._replace(k_half=99.0), ME._replace(k_half=math.nan, misfit=0.0)
    first, second = drawn([wide, ME._replace(misfit=0.01)], 80), drawn([wide, ME], 80, t=3.0)
    assert " me " in first
    assert " rls " in second
    assert first.index(" k ") == second.index(" k ")
    assert " rls " in drawn([unknown, RLS], 80, t=5.0)


def test_the_same_estimator_is_shown_for_a_second(drawn):
    good, bad = ME._replace(misfit=0.01, k_half=1.0), ME._replace(k_half=900.0)
    assert " me " in drawn([RLS, good], 80, t=1.0)
    assert " me " in drawn([RLS, bad], 80, t=1.9)
    assert " rls" in drawn([RLS, bad], 80, t=2.1)


def test_on_a_narrow_terminal_only_the_stiffness_is_shown_and_then_nothing(drawn):
    assert drawn([RLS, ME], 50).endswith("  rls k   2000±17 N/m\x1b[K")
    assert drawn([RLS, ME], 40).endswith("1.0 of 10 s\x1b[K")


def test_a_misfit_that_is_not_known_yet_is_not_shown(drawn):
    assert "misfit" not in drawn([RLS._replace(misfit=math.nan)])


def test_a_value_or_interval_that_is_unknown_is_a_dash_or_left_out(drawn):
    unknown = RLS._replace(k_half=math.nan, b=math.nan, b_half=math.nan)
    assert "k      2000 N/m b         - N s/m" in drawn([unknown])
    assert "±>999 N/m" in drawn([RLS._replace(k_half=math.inf)])


def test_no_number_or_unit_is_cut_at_any_width(drawn):
    every = [RLS, ME._replace(name="rls_conditional"), ME]
    for columns in range(24, 250):
        line = drawn(every, columns).removesuffix("\x1b[K").rstrip()
        assert line.endswith(("of 10 s", " N/m", " N s/m", "misfit  20%")), columns


@given(
    st.integers(40, 200),
    st.lists(st.floats(-9999, 9999), min_size=3, max_size=3),
    st.sampled_from(["active", "stopping"]),
    st.floats(0.0, 0.2),
)
def test_the_line_is_never_cut_and_its_form_depends_neither_on_the_values_nor_on_the_mode(
    columns, values, mode, misfit
):
    def form(values, mode, misfit):
        lines: list[str] = []
        progress = Progress(True, 10.0, "Enter stops", "")
        progress._terminal = SimpleNamespace(draw=lines.append)
        estimates = [
            Shown(name, value, 0.01 * abs(value), 0.1 * value, 10.0, misfit)
            for name, value in zip(("rls", "ai", "me"), values, strict=True)
        ]
        with pytest.MonkeyPatch.context() as patch:
            size = SimpleNamespace(columns=columns)
            patch.setattr(os, "get_terminal_size", lambda end: size)
            progress.show(1.0, lambda: Status(mode, math.nan, 0.0, estimates))
        assert len(lines[0]) - len("\r\x1b[K") < columns
        return lines[0].count("N/m"), lines[0].count("N s/m")

    assert form(values, mode, misfit) == form([1.0, 1.0, 1.0], "active", 0.0)


def test_a_message_is_broken_at_spaces(monkeypatch):
    lines: list[str] = []
    progress = Progress(False, 10.0, "", "")
    monkeypatch.setattr(progress, "_terminal", SimpleNamespace(write=lines.append))
    monkeypatch.setattr(os, "get_terminal_size", lambda end: SimpleNamespace(columns=40))
    progress.report("teleop: a/path/that/is/longer/than/the/terminal/is/wide.mcap: removed: on")
    assert lines == [
        "teleop:\na/path/that/is/longer/than/the/terminal/is/wide.mcap:\nremoved: on\n"
    ]


def test_without_a_terminal_spaces_replace_the_previous_line_and_nothing_is_an_escape(
    monkeypatch,
):
    def no_terminal(end):
        raise OSError

    def draw(progress, text):
        monkeypatch.setattr(os, "get_terminal_size", no_terminal)
        progress._draw(text)

    lines: list[str] = []
    progress = Progress(True, 10.0, "", "")
    terminal = SimpleNamespace(draw=lines.append, write=lines.append, close=lambda: None)
    monkeypatch.setattr(progress, "_terminal", terminal)
    draw(progress, "a long line")
    draw(progress, "short")
    progress.report("stopped")
    draw(progress, "more")
    progress.close()
    assert lines == ["\ra long line", "\rshort      ", "\r     \rstopped\n", "\rmore", "\r    \r"]


def test_a_note_takes_the_place_of_estimates_that_do_not_fit(drawn):
    drawn.progress.note = "k ± 2 %: about 3 s more"
    assert drawn([RLS], 60).startswith("\ractive   1.0 of 10 s  k ± 2 %: about 3 s more")
