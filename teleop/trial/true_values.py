"""Compute the true stiffness, damping, lag and lost motion of a simulated rig."""

from __future__ import annotations

from typing import Any

import numpy as np

from sim_backend import Law, Setup
from teleop.errors import InputError
from teleop.recording.recording import Recording
from teleop.trial.settings import TrialSettings
from teleop.trial.settings_json import from_document


def truth(settings: TrialSettings, depth: float) -> dict[str, Any]:
    """Return the true damping, stiffness, lag and lost motion of the simulated rig.

    The stiffness is that of the cube in series with the transmission, because the encoder measures
    the position before the transmission. Damping and stiffness are the values for slow motion. If
    the properties of the body change with time, they are the values before this change. A body can
    have further force laws, for example for fast motion or after the change. `further_laws` then
    contains the values of these laws by name.

    Parameters
    ----------
    settings
        Settings of the trial.
    depth
        Greatest displacement in the trial [m], at which the stiffness `k_deepest` is computed.
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
    """Return damping and stiffness of body and transmission, for one force law of the body.

    Parameters
    ----------
    setup
        Body and transmission.
    law
        Law from which the force of the body is computed.
    depth
        Greatest displacement [m].
    """
    return {
        "b": law.b,
        "k_surface": law.k1 / (1.0 + setup.transmission.compliance * law.k1),
        "k_deepest": setup.static_force(law, depth) / depth if depth else law.k1,
    }


def recorded_truth(recording: Recording) -> dict[str, Any] | None:
    """Return the true values for a recorded trial on the simulated rig; None for a hardware rig."""
    if not recording.settings or recording.session.get("rig") != "simulated":
        return None
    try:
        settings = from_document(recording.settings)
    except InputError:
        return None
    return truth(settings, float(np.max(np.abs(recording["slave_position"]), initial=0.0)))
