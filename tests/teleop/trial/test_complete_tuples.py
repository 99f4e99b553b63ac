"""Tuples that are made without a check of their length have all of their fields."""

from __future__ import annotations

import sys

import pytest

from drivers import new_tuple
from teleop.control.feedback.settings import FeedbackSettings
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial


@pytest.fixture
def made(monkeypatch):
    """Return the classes of the tuples that are made, each with a check of its length."""
    classes = set()

    def complete_tuple(kind, values):
        classes.add(kind.__name__)
        return kind._make(values)

    for name, module in list(sys.modules.items()):
        in_tick = name.startswith(("teleop.", "sim_backend."))
        if in_tick and getattr(module, "new_tuple", None) is new_tuple:
            monkeypatch.setattr(module, "new_tuple", complete_tuple)
    return classes


@pytest.mark.parametrize(
    ("condition", "law"), [("free", "none"), ("mimic", "model-mediated"), ("autonomous", "none")]
)
def test_every_tuple_of_a_tick_has_all_of_its_fields(made, condition, law):
    trial = run_trial(
        TrialSettings(
            condition=condition,
            duration=0.3,
            clock="virtual",
            feedback=FeedbackSettings(law=law),
        )
    )
    assert trial.summary()["ticks"] > 250
    assert made >= {
        "Ages", "ChannelState", "Command", "Measurement", "Pair", "Record", "Request",
        "Supervision", "Timing", "Verdict",
    }  # fmt: skip
    assert ("Intention" in made) == (condition != "autonomous")
