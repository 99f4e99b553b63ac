"""What the hand felt in a trial, compared with the same motion of the slave."""

from __future__ import annotations

import math

import numpy as np

from sim_backend import Sensors
from teleop.control.channel import ChannelSettings
from teleop.evaluation.teleoperation.rendering import hand
from teleop.safety.events import ACTIVE
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial


def test_stiffness_at_hand_and_slave_is_that_of_the_same_motion(feedback_settings):
    """A window of the same time has the deep first poke in the motion of the slave only."""
    channel = ChannelSettings(0.25, 0.02, 0.05)
    result = run_trial(feedback_settings("model-mediated", "hard", 150.0, channel=channel))
    assert abs(result.feedback()["rendered_k_error"]) < 0.02


def test_the_position_of_the_hand_does_not_drift_where_a_limit_reduced_the_velocity(
    feedback_settings,
):
    result = run_trial(feedback_settings("model-mediated", "hard", glued=False))
    active = result.recording.where(result.recording["mode"] == ACTIVE)
    moved = active["commanded_master_velocity"] != active["desired_master_velocity"]
    assert np.count_nonzero(moved) > 100
    felt = hand(active, 0.5, 15.0, 0.0)
    k, k3 = active["model_stiffness"], active["model_stiffening"]
    deep = ~moved & (felt.position > 1e-4)
    force = (k * felt.position + k3 * felt.position**3)[deep]
    assert np.max(np.abs(force - active["displayed_force"][deep])) < 0.5
    assert abs(result.feedback()["rendered_k_error"]) < 0.01


def test_a_hand_that_did_not_move_has_no_felt_stiffness():
    """No packet of a channel arrives, while the force sensor has an offset of 1 N."""
    result = run_trial(
        TrialSettings(
            clock="virtual",
            duration=1.0,
            rate=4000.0,
            channel=ChannelSettings(loss=0.999),
            sensors=Sensors(contact_zero=1.0),
        )
    )
    feedback = result.feedback()
    assert math.isnan(feedback["rendered_k"])
    assert math.isnan(feedback["rendered_k_error"])
    assert not feedback["stable"]
