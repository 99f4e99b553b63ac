"""Measure lag and lost motion of the simulated rig with a simulated reference spring.

The lag is the time constant of the contact force channel. Lost motion is the distance by which the
tip of the slave is behind its encoder position in each direction of motion.
"""

from __future__ import annotations

from dataclasses import replace

from sim_backend import Cube, Setup, paper_setup
from teleop.control.excitation_signals import Chirp
from teleop.rig.force_lag import ForceLag, measure_lag
from teleop.trial.run import run_trial
from teleop.trial.settings import TrialSettings

SPRING = 5000.0
"""Stiffness of the reference spring [N/m]."""
SPRING_DEPTH = 5e-3
"""Largest compression of the reference spring [m]."""


def measure_simulated_lag(seed: int = 0) -> tuple[ForceLag, Setup]:
    """Measure lag and lost motion of the simulated rig with a simulated reference spring."""
    spring = Cube(SPRING, 0.0, 1e-9)
    setup = replace(paper_setup("injector", "soft"), cube=spring, depth=SPRING_DEPTH)
    columns = run_trial(
        TrialSettings(
            condition="autonomous",
            clock="virtual",
            seed=seed,
            signal=Chirp(1.0, 8.0),
            custom_setup=setup,
        )
    ).columns
    measured = measure_lag(columns["slave_position"], columns["contact_force"], columns["dt"])
    return measured, setup
