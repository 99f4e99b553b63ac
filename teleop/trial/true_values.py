"""Compute the true values of a trial on the simulated rig, such as stiffness and damping.

The estimates are compared with these values.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sim_backend import Law, Setup
from teleop.errors import InputError
from teleop.recording.recording import Recording
from teleop.settings.documents import from_document
from teleop.settings.trial_settings import TrialSettings


def truth(settings: TrialSettings, depth: float) -> dict[str, Any]:
    """Return the true values of a trial on the simulated rig, such as damping and stiffness.

    The stiffness is that of the palpated body in series with the transmission, because the encoder
    measures the position of the motor, before the transmission.
    """
    setup = settings.setup
    further = {name: known(setup, law, depth) for name, law in setup.cube.further_laws.items()}
    return {
        **known(setup, setup.cube.slow, depth),
        "force_lag_s": setup.force_lag,
        "lost_motion_m": setup.transmission.lost_motion,
        **({"further_laws": further} if further else {}),
    }


def known(setup: Setup, law: Law, depth: float) -> dict[str, float]:
    """Return the true damping and stiffness of a simulated body in series with the transmission."""
    return {
        "b": law.b,
        "k_surface": law.k1 / (1.0 + setup.transmission.compliance * law.k1),
        "k_deepest": setup.static_force(law, depth) / depth if depth else law.k1,
    }


def recorded_truth(recording: Recording) -> dict[str, Any] | None:
    """Return the true damping and stiffness in a recorded trial on the simulated rig, see `truth`.

    The result is None for a hardware rig, or if the settings in the recording are not valid.
    """
    if not recording.settings:
        return None
    try:
        settings = from_document(recording.settings)
    except InputError:
        return None
    if not settings.is_simulated:
        return None
    return truth(settings, float(np.max(np.abs(recording["slave_position"]), initial=0.0)))
