"""What two stations must agree on before a session: shared settings, and the longest round trip."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from teleop.errors import InputError
from teleop.settings.feedback_checks import check_feedback
from teleop.settings.trial_settings import TrialSettings

STEPS = 12
"""Number of bisections with which the longest round trip is found."""
LONGEST = 4.0
"""Longest round trip that is searched for [s]."""


def shared_settings(settings: TrialSettings) -> dict[str, Any]:
    """Return the settings that must be equal at both stations, by name."""
    feedback, admittance = settings.feedback, settings.admittance
    return {
        "feedback.law": feedback.law,
        "feedback.gain": feedback.gain,
        "feedback.stiffness": feedback.stiffness,
        "feedback.glued": settings.is_glued,
        "coupling.scale": settings.coupling.scale,
        "admittance.mass": admittance.mass,
        "admittance.damping": admittance.damping,
        "admittance.stiffness": admittance.stiffness,
    }


def longest_round_trip(settings: TrialSettings) -> float:
    """Return the longest round trip for which the force feedback is stable [s].

    It is infinite if the stability does not depend on the round trip, or is not known.
    """
    if not settings.feedback.law_type.displays_measured_force:
        return math.inf
    check_feedback(settings, 0.0)
    if is_stable(settings, LONGEST):
        return math.inf
    low, high = 0.0, LONGEST
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        if is_stable(settings, middle):
            low = middle
        else:
            high = middle
    return low


def is_stable(settings: TrialSettings, trip: float) -> bool:
    """Return whether the force feedback is stable with a round trip [s]."""
    try:
        check_feedback(settings, trip)
    except InputError:
        return False
    return True


def document_of(settings: TrialSettings) -> dict[str, Any]:
    """Return what a station sends to the other one before a session."""
    longest = longest_round_trip(settings)
    return {
        "settings": shared_settings(settings),
        "longest_round_trip": longest if longest < math.inf else None,
        "rig": settings.rig_name,
        "duration": settings.duration,
    }


def common_round_trip(own: Mapping[str, Any], others: Mapping[str, Any]) -> float:
    """Return the longest round trip that both stations permit [s]."""
    limits = (document["longest_round_trip"] for document in (own, others))
    return min((limit for limit in limits if limit is not None), default=math.inf)
