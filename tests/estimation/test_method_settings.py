"""Settings of single estimators."""

from __future__ import annotations

from dataclasses import fields, replace

import pytest

from estimation import paper_preset
from estimation.method_settings import OwnSettings
from estimation.methods.grid import Axis, Grid
from estimation.methods.recursive_least_squares import RecursiveLeastSquares
from estimation.registry import BUILT_IN

OTHERS = {
    "forgetting": 0.9,
    "initial_covariance": (2.0, 3.0),
    "adaptation_gain": (4.0, 5.0),
    "ai_method": "exact",
    "grid": Grid(Axis(0.0, 10.0, 3), Axis(0.0, 3000.0, 5)),
    "forgetting_rate": 3.0,
    "x_size": 1e-2,
    "v_size": 0.1,
    "f_size": 3.0,
    "segment": 1.5,
}


def state(estimator):
    """Return what distinguishes two estimators of the same class."""
    return repr(estimator.parameters), repr(estimator.state)


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_setting_acts_as_if_it_were_shared_or_is_refused(name):
    preset = replace(paper_preset(), estimators=(name,))
    assert OTHERS.keys() == {field.name for field in fields(OwnSettings)}
    for setting, value in OTHERS.items():
        own = replace(preset, own={name: OwnSettings(**{setting: value})})
        shared = replace(preset, **{setting: value}).bank()[name]
        problem = ""
        try:
            found = own.bank()[name]
        except ValueError as error:
            problem, found = str(error), preset.bank()[name]
        assert problem == "" or f"{name}: {setting}: not a setting of this estimator" in problem
        assert state(found) == state(shared)


def test_other_estimators_keep_the_shared_settings():
    preset = replace(paper_preset(), estimators=("rls", "rls_sift"))
    own = replace(preset, own={"rls": OwnSettings(forgetting=0.9)})
    assert state(own.bank()["rls_sift"]) == state(preset.bank()["rls_sift"])
    assert state(own.bank()["rls"]) != state(preset.bank()["rls"])


def test_an_estimator_that_is_not_known_is_refused():
    with pytest.raises(ValueError, match="estimator 'odd': expected"):
        replace(paper_preset(), own={"odd": OwnSettings()}).bank()


@pytest.mark.parametrize("name", ["x_size", "v_size", "f_size"])
@pytest.mark.parametrize("size", [1e300, 1e-300, -1e300, 0.0, float("nan")])
def test_a_size_whose_square_overflows_is_refused(name, size):
    with pytest.raises(ValueError, match=name):
        OwnSettings(**{name: size})
    with pytest.raises(ValueError, match=name):
        replace(paper_preset("soft"), **{name: size}).bank()


def test_candidates_whose_squares_overflow_are_refused():
    for first, last in ((-1e308, 0.0), (0.0, 1e300)):
        with pytest.raises(ValueError, match="candidates must be below"):
            Axis(first, last, 5)


def test_an_estimator_that_does_not_declare_its_settings_refuses_none(monkeypatch):
    class Undeclared(RecursiveLeastSquares):
        used_settings = None

    monkeypatch.setitem(BUILT_IN, "rls", Undeclared.from_settings)
    preset = replace(paper_preset(), estimators=("rls",), own={"rls": OwnSettings(segment=1.0)})
    assert isinstance(preset.bank()["rls"], Undeclared)
    monkeypatch.undo()
    with pytest.raises(ValueError, match="segment: not a setting of this estimator"):
        preset.bank()
