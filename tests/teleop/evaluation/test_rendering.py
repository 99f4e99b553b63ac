"""What the hand felt in a trial, compared with the same motion of the slave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sim_backend import CUBES, OperatorModel, Setup
from sim_backend.channel import ChannelSettings
from teleop.control.admittance import AdmittanceParameters
from teleop.control.feedback.settings import FeedbackSettings
from teleop.evaluation.rendering import hand
from teleop.safety.events import ACTIVE
from teleop.safety.tightened_limits import TightenedLimits
from teleop.trial.run import run_trial
from teleop.trial.settings import TrialSettings


def trial(law, cube, arm=400.0, seed=0, channel=None, glued=True, damping=15.0):
    settings = TrialSettings(
        cube=cube,
        clock="virtual",
        duration=10.0,
        seed=seed,
        estimators=("rls",),
        feedback=FeedbackSettings(law),
        channel=channel,
        admittance=AdmittanceParameters(damping=damping),
        operator_model=OperatorModel(arm, 10.0, 0.5 if glued else -0.2),
        tightened_limits=TightenedLimits(soft_force=20.0, hard_force=40.0),
    )
    setup = settings.setup
    body = replace(CUBES[cube], glued=glued)
    return run_trial(replace(settings, custom_setup=Setup(body, setup.force_lag, setup.depth)))


def test_stiffness_at_hand_and_slave_is_that_of_the_same_motion():
    """A window of the same time has the deep first poke in the motion of the slave only."""
    result = trial("model-mediated", "hard", arm=150.0, channel=ChannelSettings(0.25, 0.02, 0.05))
    assert abs(result.feedback()["rendered_k_error"]) < 0.02


def test_the_position_of_the_hand_does_not_drift_where_a_limit_reduced_the_velocity():
    result = trial("model-mediated", "hard", glued=False)
    active = result.recording.where(result.recording["mode"] == ACTIVE)
    moved = active["commanded_master_velocity"] != active["desired_master_velocity"]
    assert np.count_nonzero(moved) > 100
    felt = hand(active, 0.5, 15.0, 0.0)
    k, k3 = active["model_stiffness"], active["model_stiffening"]
    deep = ~moved & (felt.position > 1e-4)
    force = (k * felt.position + k3 * felt.position**3)[deep]
    assert np.max(np.abs(force - active["displayed_force"][deep])) < 0.5
    assert abs(result.feedback()["rendered_k_error"]) < 0.01
