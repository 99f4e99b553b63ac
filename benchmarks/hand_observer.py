"""Error of the observer of the hand's force on the simulated force-commanded master.

    python benchmarks/hand_observer.py

An error is the rms of the difference from the true force of the simulated hand on the handle,
relative to the rms of this force. `coupling` is the force of the virtual coupling, which the
controller uses as the force of the hand. Contact is a contact force above 2 N.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import date

import numpy as np

from drivers import Measurement
from estimation.arrays import Floats
from sim_backend import ARM, ForceMaster, SimulatedRig
from teleop.control.feedback.settings import FeedbackSettings
from teleop.settings import trial_settings
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.columns import OBSERVED
from teleop.trial import assembly
from teleop.trial.run import run_trial

SOFT_HAND = ForceMaster(800.0, max_force=70.0)
RUBS = ForceMaster(800.0, friction=8.0)
MEDIATED = FeedbackSettings("model-mediated")
CASES: dict[str, tuple[TrialSettings, ForceMaster | None]] = {
    "soft cube": (TrialSettings(force_master=ForceMaster()), None),
    "soft cube, model-mediated": (TrialSettings(force_master=SOFT_HAND, feedback=MEDIATED), None),
    "hard cube": (TrialSettings(force_master=ForceMaster(), cube="hard"), None),
    "mass 20 % too large": (TrialSettings(force_master=ForceMaster()), ForceMaster(mass=0.24)),
    "friction 50 % too small": (
        TrialSettings(force_master=ForceMaster()),
        ForceMaster(friction=1.0),
    ),
    "friction of 8 N s/m": (TrialSettings(force_master=RUBS), None),
    "friction of 8, stated as 2": (TrialSettings(force_master=RUBS), ForceMaster(friction=2.0)),
}
"""Trials, and the master whose mass and friction the observer assumes; None for the true one."""


class WatchedRig(SimulatedRig):
    """A simulated rig that stores the true force of the hand on the handle."""

    forces: list[float]

    def read(self) -> Measurement:
        measurement = super().read()
        handle, operator, force = self.plant.handle, self._operator, 0.0
        if self._enabled and operator and self._time >= self._start:
            hand = operator.intention(self._time - self._start)
            if hand:
                force = ARM.stiffness * (hand.position - handle.x)
                force += ARM.damping * (hand.velocity - handle.v)
        self.forces.append(force)
        return measurement


@contextmanager
def watched(assumed: ForceMaster | None) -> Iterator[list[float]]:
    """Make trials with a watched rig and an observer for the assumed master; yield the forces."""
    rig, observer = assembly.SimulatedRig, trial_settings.HandObserver
    WatchedRig.forces = []
    assembly.SimulatedRig = WatchedRig  # type: ignore[misc]
    if assumed:
        trial_settings.HandObserver = lambda m, b, n: observer(  # type: ignore[assignment,misc]
            assumed.mass, assumed.friction, n
        )
    try:
        yield WatchedRig.forces
    finally:
        assembly.SimulatedRig, trial_settings.HandObserver = rig, observer  # type: ignore[misc]


def errors(settings: TrialSettings, assumed: ForceMaster | None) -> list[float]:
    """Return the relative errors of observer and coupling in contact, and of the observer."""
    with watched(assumed) as forces:
        trial = run_trial(settings)
    assert trial.fault is None, trial.fault
    recording = trial.recording
    true = np.array(forces[-len(recording["time"]) :])
    active = np.isfinite(recording["x"])
    contact = active & (recording["contact_force"] > 2.0)
    observed, coupled = recording[OBSERVED], recording["master_force"]
    return [
        relative(observed, true, contact),
        relative(coupled, true, contact),
        relative(observed, true, active & ~contact),
    ]


def relative(found: Floats, true: Floats, part: Floats) -> float:
    """Return the rms of the error relative to the rms of the true force."""
    return float(np.sqrt(np.mean((found[part] - true[part]) ** 2) / np.mean(true[part] ** 2)))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=10)
    given = parser.parse_args()
    print(f"# python {' '.join(sys.argv)}, {date.today()}")
    print(f"{'mean and standard deviation':30}{'observer':>16}{'coupling':>16}{'observer,':>16}")
    print(f"{f'of {given.seeds} trials of 6 s [%]':30}{'in contact':>16}{'in contact':>16}"
          f"{'no contact':>16}")  # fmt: skip
    for name, (settings, assumed) in CASES.items():
        rows = []
        for seed in range(given.seeds):
            changed = replace(
                settings, clock="virtual", duration=6.0, seed=seed, estimators=("rls",)
            )
            rows.append(errors(changed, assumed))
        cells = zip(np.mean(rows, 0) * 100.0, np.std(rows, 0) * 100.0, strict=True)
        print(f"{name:30}" + "".join(f"{m:9.1f} ± {s:4.1f}" for m, s in cells), flush=True)


if __name__ == "__main__":
    main()
