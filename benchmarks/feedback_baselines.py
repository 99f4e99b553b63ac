"""Published laws of bilateral teleoperation beside those of the package, on the same rig.

    python benchmarks/feedback_baselines.py --seeds 5 --first-seed 860001

- position-force, as in the package, with a virtual damping of 50 N s/m;
- time-domain passivity: position-force with observer and controller at both ports (J.-H. Ryu, J.
  Artigas, C. Preusche, Mechatronics 20(7), 2010), without and with drift compensation (V. Chawda,
  M. K. O'Malley, IEEE/ASME Trans. Mechatronics 20(5), 2015);
- wave variables with a filter of the returned wave (G. Niemeyer, J.-J. E. Slotine, IEEE J. Oceanic
  Engineering 16(1), 1991);
- model-mediated, as in the package.

X. Xu, Q. Liu, E. Steinbach (arXiv 1705.05613, 2017) compare time-domain passivity and
model-mediated teleoperation by delay on a one-dimensional spring-damper: there, the displayed
stiffness of the first falls with the delay, and that of the second does not. The rig, the operator
and the bodies here are those of `feedback_case.py`, so that the figures are not those of the paper.
"""

from __future__ import annotations

import argparse
import itertools
import math
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
from feedback_case import run_one

from drivers import Measurement
from teleop.control.feedback import settings as feedback_settings
from teleop.control.feedback.energy_tank import TANK_MAX
from teleop.control.feedback.law import (
    LawInputs,
    MasterHalf,
    MasterMotion,
    Report,
    SlaveHalf,
)

ROUND_TRIPS = (0.0, 0.02, 0.05, 0.1, 0.2)
WAVE_IMPEDANCE = 30.0
"""Impedance of the wave variables [N s/m]."""
WAVE_FILTER = 10.0
"""Corner frequency of the filter of the returned wave, which damps its reflections [Hz]."""
DRIFT = 2.0
"""Rate at which the drift of the slave is compensated, as far as its energy permits [1/s]."""


class PassiveMaster(MasterHalf):
    """Master half of time-domain passivity: impedance-type passivity controller."""

    allowance = TANK_MAX
    compensates_drift = False

    @classmethod
    def halves(cls, given: LawInputs) -> tuple[MasterHalf, SlaveHalf]:
        master = cls(given.admittance, given.coupling.scale, given.gain)
        slave = PassiveSlave(given.coupling, given.stiffness, given.transmission)
        slave.compensates_drift = cls.compensates_drift
        return master, slave

    def align(self) -> None:
        super().align()
        self._in = self._out = 0.0

    def step(self, force: float, report: Report, dt: float) -> MasterMotion:
        v = self.admittance.velocity
        shown = self.gain * report.force
        out = -shown * v * dt  # energy that leaves the channel at the master
        excess = self._out + max(out, 0.0) - report.energy
        if excess > 0.0 and v * v * dt > 1e-12:
            shown += min(excess / (v * v * dt), self.admittance.parameters.mass / dt) * v
            out = -shown * v * dt
        self._out += max(out, 0.0)
        self._in += max(-out, 0.0)
        self.started = shown
        self.admittance.step(force - shown, dt)
        self.state = self.state._replace(displayed=shown)
        return MasterMotion(self.admittance.position, self.admittance.velocity, self._in)


class DriftlessMaster(PassiveMaster):
    """Time-domain passivity with drift compensation."""

    compensates_drift = True


class PassiveSlave(SlaveHalf):
    """Slave half of time-domain passivity: admittance-type passivity controller."""

    compensates_drift = False

    def align(self) -> None:
        super().align()
        self._in = self._out = 0.0
        self._before = math.nan

    def report(self, measurement: Measurement, dt: float) -> Report:
        return Report(measurement.contact_force, energy=self._in)

    def velocity(self, motion: MasterMotion, measurement: Measurement, dt: float) -> float:
        f, v = measurement.contact_force, self._scale * motion.velocity
        gap = motion.energy - self._out  # energy that may leave the channel at the slave
        if self.compensates_drift:
            v += DRIFT * (self._scale * motion.position - measurement.slave_position)
        out = f * v * dt
        if out > gap and abs(f) > 0.05:
            v -= (out - max(gap, 0.0)) / (f * dt)
            out = f * v * dt
        self._out += max(out, 0.0)
        self._in += max(-out, 0.0)
        return v


class WaveMaster(MasterHalf):
    """Master half of wave variables: sends u, receives w, and displays f = b v + sqrt(2 b) w."""

    allowance = TANK_MAX

    @classmethod
    def halves(cls, given: LawInputs) -> tuple[MasterHalf, SlaveHalf]:
        master = cls(given.admittance, given.coupling.scale, given.gain)
        return master, WaveSlave(given.coupling, given.stiffness, given.transmission)

    def align(self) -> None:
        super().align()
        self._sum = self._wave = 0.0

    def step(self, force: float, report: Report, dt: float) -> MasterMotion:
        b, root = WAVE_IMPEDANCE, math.sqrt(2.0 * WAVE_IMPEDANCE)
        v = self.admittance.velocity
        self._wave += (report.force - self._wave) * min(2.0 * math.pi * WAVE_FILTER * dt, 1.0)
        shown = self.started = b * v + root * self._wave
        self.admittance.step(force - shown, dt)
        self.state = self.state._replace(displayed=shown)
        u = root * v + self._wave
        self._sum += u * dt
        return MasterMotion(self._sum, u)


class WaveSlave(SlaveHalf):
    """Slave half of wave variables: v = (sqrt(2 b) u - f) / b, returns w = sqrt(2/b) f - u."""

    _u = 0.0

    def report(self, measurement: Measurement, dt: float) -> Report:
        returned = math.sqrt(2.0 / WAVE_IMPEDANCE) * measurement.contact_force - self._u
        return Report(returned)

    def velocity(self, motion: MasterMotion, measurement: Measurement, dt: float) -> float:
        b = WAVE_IMPEDANCE
        self._u = motion.velocity
        return (math.sqrt(2.0 * b) * self._u - measurement.contact_force) / b


LAWS: dict[str, tuple[type[MasterHalf] | None, str, float]] = {
    "position-force": (None, "position-force", 50.0),
    "time-domain passivity": (PassiveMaster, "position-force", 15.0),
    "with drift compensation": (DriftlessMaster, "position-force", 15.0),
    "wave variables": (WaveMaster, "position-force", 15.0),
    "model-mediated": (None, "model-mediated", 15.0),
}
"""Master half, law in the settings that it replaces, and virtual damping [N s/m]."""


def run(case: tuple[str, str, float, float, int]) -> dict[str, Any]:
    """Run one trial with a law, on a cube, with a round trip, an arm and a seed."""
    name, cube, trip, arm, seed = case
    law, settings_name, damping = LAWS[name]
    known = feedback_settings.LAWS[settings_name]
    if law:
        feedback_settings.LAWS[settings_name] = law
    try:
        return run_one(
            {
                "law": settings_name,
                "cube": cube,
                "round_trip": trip,
                "arm": arm,
                "seed": seed,
                "damping": damping,
            }
        )
    finally:
        feedback_settings.LAWS[settings_name] = known


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=1)
    options = parser.parse_args()
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    cases = [*itertools.product(LAWS, ("soft", "medium"), ROUND_TRIPS, (250.0, 1500.0), seeds)]
    with ProcessPoolExecutor(options.processes) as pool:
        rows = dict(zip(cases, pool.map(run, cases), strict=True))
    print(
        f"{len(rows)} trials on the default rig, seeds {seeds[0]} to {seeds[-1]}, arms of 250 and "
        "1500 N/m: stable trials, median error of the felt stiffness"
    )
    print(f"{'law':<25}{'cube':<8}" + "".join(f"{trip * 1e3:>11g} ms" for trip in ROUND_TRIPS))
    for name, cube in itertools.product(LAWS, ("soft", "medium")):
        cells = []
        for trip in ROUND_TRIPS:
            found = [row for case, row in rows.items() if case[:3] == (name, cube, trip)]
            stable = [row for row in found if row["stable"]]
            errors = [row["true_k_error"] for row in stable]
            error = f"{np.nanmedian(errors):+.0%}" if errors else "-"
            cells.append(f"{len(stable):>3}/{len(found):<3}{error:>7}")
        print(f"{name:<25}{cube:<8}" + " ".join(cells))


if __name__ == "__main__":
    main()
