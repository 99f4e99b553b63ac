"""Define the rig of the search for violations of the safety rules."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from drivers import Command, Measurement, Rig, RigError
from sim_backend import CUBES, ForceMaster, SimulatedRig
from sim_backend.faults import FaultyRig
from sim_backend.operators import Hand
from sim_backend.slave_drives import ForceSlave, SlaveDriveName
from teleop.control.conditions import Condition
from teleop.safety import Limits
from teleop.settings.simulated_rig_limits import simulated_rig_limits

WATCHDOG = 0.05
"""Timeout of the simulated drives' watchdogs [s]."""
PERIOD = 1e-3
DEPTH = 10e-3
LIMITS: Limits = replace(
    simulated_rig_limits(CUBES["soft"], DEPTH, 1.0, 2.0, 1e-6),
    preflight=5e-3,
    start_ramp=2e-3,
    following_error=2e-3,
)
STANDING = -math.log1p(-LIMITS.max_gap)
"""Time after which a fault is reported if the time of the rig stands still [s]."""
RAMP = max(
    LIMITS.max_velocity / LIMITS.max_acceleration,
    LIMITS.max_master_velocity / LIMITS.max_master_acceleration,
)
BOUND = STANDING + RAMP + WATCHDOG + 3 * PERIOD
"""Longest time from any fault until the drives are disabled, even if other parts fail [s]."""


class SearchRig(Rig):
    """A simulated rig. Its calls may fail, and its time may stand still or jump."""

    def __init__(
        self,
        now: Any,
        operator: Hand | None = None,
        master: ForceMaster | None = None,
        slave_drive: SlaveDriveName | ForceSlave = "velocity",
    ) -> None:
        self.sim = SimulatedRig(
            CUBES["soft"],
            now,
            operator,
            watchdog=WATCHDOG,
            master=master,
            slave_drive=slave_drive,
            period=PERIOD,
        )
        self.faulty = FaultyRig(self.sim)
        self.failing: dict[str, str] = {}
        """Calls that fail, by name: `before` or `after` their effect."""
        self.standing = False
        self.offset = 0.0
        self.last: Measurement | None = None
        self.calls: list[tuple[str, Any]] = []
        """Calls since the previous tick, with their arguments."""

    def open(self) -> None:
        self.faulty.open()

    def close(self) -> None:
        self.faulty.close()

    def attempt(self, name: str, call: Any, *arguments: Any) -> Any:
        self.calls.append((name, arguments[0] if arguments else None))
        when = self.failing.get(name)
        if when == "before":
            raise RigError(f"{name} failed")
        result = call(*arguments)
        if when == "after":
            raise RigError(f"{name} failed after its effect")
        return result

    def read(self) -> Measurement:
        fresh = self.faulty.read()
        if not self.standing or self.last is None:
            self.last = fresh._replace(time=fresh.time + self.offset)
        return self.attempt("read", lambda: self.last)

    def enable(self) -> bool:
        return self.attempt("enable", self.faulty.enable)

    def write(self, command: Command) -> Command:
        return self.attempt("write", self.faulty.write, command)

    def idle(self) -> bool:
        return self.attempt("idle", self.faulty.idle)

    def rearm(self) -> None:
        self.faulty.rearm()

    @property
    def pushes(self) -> bool:
        """Whether a motor with a force input exerts a force, or is in operation."""
        plant = self.sim.plant
        return plant.slave.push is not None or bool(getattr(plant.handle, "push", 0.0))


class Pushing(Condition):
    """A condition that returns a force that the search chooses, or raises an exception.

    If the force is None, it is that of the hand.
    """

    force: float | None = 0.0
    error: Exception | None = None

    def drive_force(self, t: float, measurement: Measurement) -> float:
        if self.error:
            raise self.error
        return measurement.master_force if self.force is None else self.force
