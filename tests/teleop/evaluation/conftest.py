"""Settings of trials with force feedback."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim_backend import OperatorModel, Transmission
from teleop.control.feedback.settings import FeedbackSettings
from teleop.safety.tightened_limits import TightenedLimits
from teleop.settings.trial_settings import TrialSettings


@pytest.fixture(scope="session")
def feedback_settings():
    """Return a function: settings of a trial without lost motion that reverses at 10 N."""

    def make(law, cube, arm=400.0, seed=0, channel=None, glued=True, duration=10.0):
        settings = TrialSettings(
            cube=cube,
            clock="virtual",
            duration=duration,
            seed=seed,
            estimators=("rls",),
            feedback=FeedbackSettings(law),
            channel=channel,
            operator_model=OperatorModel(arm, 10.0, 0.5 if glued else -0.2),
            tightened_limits=TightenedLimits(soft_force=20.0, hard_force=40.0),
        )
        setup = settings.setup
        body = replace(setup.cube, glued=glued)
        return replace(
            settings, custom_setup=replace(setup, cube=body, transmission=Transmission())
        )

    return make
