"""A reaction force observer: the contact force of a drive that has no force sensor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, FiniteFloat

from drivers.device import NO_SAMPLE, DerivedDevice, Device, DeviceSettings, Sample
from drivers.rig import RigError

NEEDED = {"force": "N", "velocity": "m/s"}
"""Signals of the drive."""


class ReactionForceSettings(DeviceSettings):
    """An observer on one of the rig's devices."""

    kind: Literal["reaction_force"]
    drive: str
    """Device whose signals `force` and `velocity` are those of the drive."""
    moving_mass_kg: Annotated[FiniteFloat, Field(ge=0)]
    """All that moves with the drive, the rotor's inertia included."""
    bandwidth_hz: Annotated[FiniteFloat, Field(gt=0, le=500)]
    coulomb_friction_n: Annotated[FiniteFloat, Field(ge=0)] = 0.0
    viscous_friction_n_s_per_m: Annotated[FiniteFloat, Field(ge=0)] = 0.0


class ReactionForceObserver(DerivedDevice):
    """Estimates the force on a moving mass from its drive's force and velocity.

    The mass moves by m dv/dt = F_motor - F_friction - F. The disturbance observer (Murakami, Yu,
    Ohnishi: Torque sensorless control in multidegree-of-freedom manipulator, IEEE Trans.
    Industrial Electronics 40(2), 1993) has F without a derivative,

        F_hat = LPF(F_motor - F_friction + g m v) - g m v,    LPF = g / (s + g),

    which is LPF(F_motor - F_friction - m dv/dt): the force behind a first-order lag. Between two
    samples the mean of the forces and of the acceleration is held, so that

        F_hat' = F_hat + (1 - exp(-g dt)) (mean(F_motor - F_friction) - m (v' - v) / dt - F_hat)

    is exact under constant forces, at any dt.

    Its signal is `force` [N], positive where it pushes against the drive's positive direction.
    Nothing of it is measured at the contact: an error of the mass shows as a force in proportion
    to the acceleration, friction that is not modelled shows whole, and at standstill static
    friction hides forces up to its size. A sample has the time of the drive's sample; that its
    value is late by `lag` besides is for the channel's `lag_ms`.
    """

    Settings = ReactionForceSettings
    settings: ReactionForceSettings
    estimated: ClassVar[bool] = True
    """Its signals are estimated, not measured."""

    def __init__(self, name: str, settings: ReactionForceSettings) -> None:
        super().__init__(name, settings)
        self.rate = 2 * math.pi * settings.bandwidth_hz
        """g [1/s]."""
        self._drive: Device | None = None
        self._force = self._velocity = NO_SAMPLE
        """What the latest estimate comes from."""
        self._driven = math.nan
        """Motor's force less friction at that time [N]."""

    @property
    def lag(self) -> float:
        """How late the estimate is [s], at frequencies well below the bandwidth."""
        return 1.0 / self.rate

    def signals(self) -> dict[str, str]:
        """The estimate."""
        return {"force": "N"}

    def start(self, devices: Mapping[str, Device]) -> None:
        """Find the drive.

        Raises
        ------
        RigError
            There is none of that name with a force and a velocity in SI units.
        """
        fitting = [
            name for name, device in devices.items() if NEEDED.items() <= device.signals().items()
        ]
        if self.settings.drive not in fitting:
            raise RigError(
                f"{self.name}: drive {self.settings.drive!r}: expected a device with the signals "
                f"force [N] and velocity [m/s]: {', '.join(fitting) or 'there is none'}"
            )
        self._drive = devices[self.settings.drive]

    def update(self, now: float) -> None:
        """Go on to the drive's latest samples, once both are new."""
        if not self._drive:
            return
        force, velocity = self._drive.samples["force"], self._drive.samples["velocity"]
        if force.time <= self._force.time or velocity.time <= self._velocity.time:
            return
        if not (math.isfinite(force.value) and math.isfinite(velocity.value)):
            self.rejected["not finite"] += 1
            return
        time = min(force.time, velocity.time)
        last = self.samples["force"]
        driving = self._driving(force.value, velocity.value)
        if last is NO_SAMPLE:
            estimate = driving
        else:
            acceleration = (velocity.value - self._velocity.value) / (
                velocity.time - self._velocity.time
            )
            reaction = 0.5 * (self._driven + driving) - self.settings.moving_mass_kg * acceleration
            share = -math.expm1(-self.rate * (time - last.time))
            estimate = last.value + share * (reaction - last.value)
        self._driven = driving
        self._force, self._velocity = force, velocity
        self.samples["force"] = Sample(estimate, time)

    def _driving(self, force: float, velocity: float) -> float:
        """The motor's force less friction [N]."""
        s = self.settings
        coulomb = math.copysign(s.coulomb_friction_n, velocity) if velocity else 0.0
        return force - coulomb - s.viscous_friction_n_s_per_m * velocity
