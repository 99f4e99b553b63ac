"""The choice between interpreted and compiled steps."""

from __future__ import annotations

import sys

import pytest

from estimation.compiled import (
    WORTH_LOADING_NUMBA,
    WORTH_LOADING_STEP,
    CompilationChoice,
)


@pytest.fixture
def without_numba_loaded(monkeypatch):
    pytest.importorskip("numba", reason="needs the `fast` extra")
    monkeypatch.delitem(sys.modules, "numba", raising=False)


def test_numba_is_loaded_once_interpretation_has_taken_as_long_as_its_loading(
    without_numba_loaded,
):
    choice, size = CompilationChoice(), WORTH_LOADING_NUMBA // 10
    assert [choice.is_compiled(size) for _ in range(11)] == [False] * 9 + [True] * 2


def test_a_long_record_is_compiled_at_once(without_numba_loaded):
    assert CompilationChoice().is_compiled(WORTH_LOADING_NUMBA)


def test_a_short_record_is_interpreted_although_numba_is_loaded():
    pytest.importorskip("numba", reason="needs the `fast` extra")
    assert not CompilationChoice().is_compiled(WORTH_LOADING_STEP - 1)
    assert CompilationChoice().is_compiled(WORTH_LOADING_STEP)


def test_without_numba_everything_is_interpreted(monkeypatch):
    monkeypatch.setattr("estimation.compiled.find_spec", lambda name: None)
    assert not CompilationChoice().is_compiled(10 * WORTH_LOADING_NUMBA)
