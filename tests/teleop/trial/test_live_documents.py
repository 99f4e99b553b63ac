"""What the live page tells a person about a trial before it begins."""

from __future__ import annotations

import pytest

from estimation.registry import BUILT_IN
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.live_documents import trial_document


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        (
            {"operator": "pointer"},
            "you press the tool on the simulated soft cube, while rls, ai and me estimate its "
            "stiffness k and damping b",
        ),
        (
            {"operator": "pointer", "condition": "mimic", "estimators": ("rls",)},
            "you follow a moving target with the tool on the simulated soft cube, while rls "
            "estimates its stiffness k and damping b",
        ),
        (
            {"cube": "hard", "estimators": tuple(BUILT_IN)},
            "a simulated operator presses the tool on the simulated hard cube, while 21 methods "
            "estimate its stiffness k and damping b",
        ),
        (
            {"condition": "autonomous", "estimators": ("rls", "me")},
            "the controller moves the tool on the simulated soft cube, while rls and me estimate "
            "its stiffness k and damping b",
        ),
    ],
)
def test_a_sentence_states_what_happens_in_the_trial(settings, text):
    assert trial_document(TrialSettings(**settings))["introduction"] == text


def test_each_estimator_of_the_package_is_explained_in_a_sentence():
    texts = trial_document(TrialSettings(estimators=tuple(BUILT_IN)))["explanations"]
    assert [*texts] == [*BUILT_IN]
    for name, text in texts.items():
        assert text.endswith("."), name
        assert 20 < len(text) <= 100, name
