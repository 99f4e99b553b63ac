"""Reaction force observer: contact force of a drive without a force sensor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, FiniteFloat

from drivers.device import NO_SAMPLE, DerivedDevice, Device, DeviceSettings, Sample
from drivers.rig import RigError

NEEDED = {"force": "N", "velocity": "m/s"}
"""Required signals of the drive, with their units."""


class ReactionForceSettings(DeviceSettings):
    """Rig file section of an observer."""

    kind: Literal["reaction_force"]
    drive: str
    """Name of the device with the signals `force` and `velocity` of the drive."""
    moving_mass_kg: Annotated[FiniteFloat, Field(ge=0)]
    """Total mass that moves with the drive, including the inertia of the rotor."""
    bandwidth_hz: Annotated[FiniteFloat, Field(gt=0, le=500)]
    coulomb_friction_n: Annotated[FiniteFloat, Field(ge=0)] = 0.0
    viscous_friction_n_s_per_m: Annotated[FiniteFloat, Field(ge=0)] = 0.0


class ReactionForceObserver(DerivedDevice):
    """Observer of the force on a moving mass from the force and velocity of its drive.

    The equation of motion is m dv/dt = F_motor - F_friction - F. The disturbance observer
    (Murakami, Yu, Ohnishi: Torque sensorless control in multidegree-of-freedom manipulator, IEEE
    Trans. Industrial Electronics 40(2), 1993) estimates F without a derivative,

        F_hat = LPF(F_motor - F_friction + g m v) - g m v,    LPF = g / (s + g),

    which equals LPF(F_motor - F_friction - m dv/dt), the force after a first-order lag. Between
    two samples the means of force and acceleration are used, so that

        F_hat' = F_hat + (1 - exp(-g dt)) (mean(F_motor - F_friction) - m (v' - v) / dt - F_hat)

    is exact for constant forces and every dt.

    The signal is `force` [N], positive if it acts against the positive direction of the drive. It
    is not measured at the contact. An error of the mass causes a force error proportional to the
    acceleration. Friction that is not modelled is fully included in the estimate. At standstill,
    static friction hides forces up to its size. The time of a sample is that of the drive's
    sample. Its value has an additional delay of `lag`, which belongs in `lag_ms` of the channel.
    """

    Settings = ReactionForceSettings
    settings: ReactionForceSettings
    estimated: ClassVar[bool] = True
    """Whether the signals are estimated instead of measured."""

    def __init__(self, name: str, settings: ReactionForceSettings) -> None:
        super().__init__(name, settings)
        self.rate = 2 * math.pi * settings.bandwidth_hz
        """Bandwidth g [1/s]."""
        self._drive: Device | None = None
        self._force = self._velocity = NO_SAMPLE
        """Samples of the drive that the latest estimate used."""
        self._driven = math.nan
        """Motor force minus friction at that time [N]."""

    @property
    def lag(self) -> float:
        """Delay of the estimate [s], for frequencies well below the bandwidth."""
        return 1.0 / self.rate

    def signals(self) -> dict[str, str]:
        """Return the unit of the estimated force."""
        return {"force": "N"}

    def start(self, devices: Mapping[str, Device]) -> None:
        """Look up the drive.

        Raises
        ------
        RigError
            There is no device of this name with a force and a velocity in SI units.
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
        """Update the estimate if both samples of the drive are new."""
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
        """Return motor force minus friction [N]."""
        s = self.settings
        coulomb = math.copysign(s.coulomb_friction_n, velocity) if velocity else 0.0
        return force - coulomb - s.viscous_friction_n_s_per_m * velocity
