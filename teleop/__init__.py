"""Control a 1-DOF telemanipulator, and estimate stiffness and damping of the touched specimen.

The names that most users need can be imported from here. They are loaded when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from telepalpation import check_packages

if TYPE_CHECKING:
    from teleop.control.conditions import Condition as Condition
    from teleop.errors import InputError as InputError
    from teleop.recording.recording import load as load
    from teleop.rig_session import Rig as Rig
    from teleop.rig_session import ask as ask
    from teleop.settings.trial_settings import TrialSettings as TrialSettings
    from teleop.trial.run import run_trial as run_trial

NAMES = {
    "Condition": "teleop.control.conditions",
    "InputError": "teleop.errors",
    "Rig": "teleop.rig_session",
    "TrialSettings": "teleop.settings.trial_settings",
    "ask": "teleop.rig_session",
    "load": "teleop.recording.recording",
    "run_trial": "teleop.trial.run",
}
"""Module of each name."""

check_packages()


def __getattr__(name: str) -> Any:
    """Import a name of `NAMES`."""
    if name not in NAMES:
        raise AttributeError(f"module 'teleop' has no attribute {name!r}")
    return getattr(import_module(NAMES[name]), name)


def __dir__() -> list[str]:
    """Return the names that can be imported from here."""
    return sorted({*globals(), *NAMES})
