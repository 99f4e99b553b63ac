"""Measurement of the simulated force channel's lag on a simulated reference spring."""

from __future__ import annotations

from sim_backend import Cube, Setup, paper_setup
from teleop.control.excitation_signals import Chirp
from teleop.rig.force_lag import ForceLag, measure_lag
from teleop.trial.run import run_trial
from teleop.trial.settings import TrialSettings

SPRING = 5000.0
"""Stiffness of the spring [N/m]."""


def measure_simulated_lag(cube: str, seed: int = 0) -> tuple[ForceLag, float]:
    """Return the measured lag of the simulated force channel, and its true lag [s].

    Parameters
    ----------
    cube
        Cube whose force channel is measured.
    seed
        Seed of the sensor noise.
    """
    setup = paper_setup("autonomous", cube)
    spring = Setup(Cube(SPRING, 0.0, 1e-9), setup.force_lag, depth=5e-3)
    columns = run_trial(
        TrialSettings(
            condition="autonomous",
            cube=cube,
            clock="virtual",
            seed=seed,
            signal=Chirp(1.0, 8.0),
            custom_setup=spring,
        )
    ).columns
    measured = measure_lag(columns["slave_position"], columns["contact_force"], columns["dt"])
    return measured, setup.force_lag
