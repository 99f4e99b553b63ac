"""Estimate the external force on a drive without a force sensor, by a disturbance observer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, FiniteFloat

from drivers.device import NO_SAMPLE, DerivedDevice, Device, DeviceSettings, Sample
from drivers.rig import RigError

NEEDED = {"force": "N", "velocity": "m/s"}
"""Signals of the drive that the observer needs, with their SI units."""


class ReactionForceSettings(DeviceSettings):
    """Settings of a reaction force observer in the rig file.

    The observer estimates the external force on a drive from its motor force and its velocity.
    """

    kind: Literal["reaction_force"]
    drive: str
    """Name of the device that has the signals `force` and `velocity` of the drive."""
    moving_mass_kg: Annotated[FiniteFloat, Field(ge=0)]
    """Total mass that moves with the drive [kg], including the equivalent mass of the rotor."""
    bandwidth_hz: Annotated[FiniteFloat, Field(gt=0, le=500)]
    coulomb_friction_n: Annotated[FiniteFloat, Field(ge=0)] = 0.0
    viscous_friction_n_s_per_m: Annotated[FiniteFloat, Field(ge=0)] = 0.0


class ReactionForceObserver(DerivedDevice):
    """Estimates the external force on a drive from its motor force and its velocity.

    The equation of motion is m dv/dt = F_motor - F_friction - F, with the moving mass m, its
    velocity v and the external force F. The disturbance observer
    (Murakami, Yu, Ohnishi: Torque sensorless control in multidegree-of-freedom manipulator, IEEE
    Trans. Industrial Electronics 40(2), 1993) estimates F without a derivative,

        F_hat = LPF(F_motor - F_friction + g m v) - g m v,    LPF = g / (s + g),

    where LPF is a first-order low-pass filter with the bandwidth g [1/s]. F_hat is equal to
    LPF(F_motor - F_friction - m dv/dt), which is F after a first-order lag. Let h be the time
    between two samples of the drive. The update is

        F_hat' = F_hat + (1 - exp(-g h)) (mean(F_motor - F_friction) - m (v' - v) / h - F_hat),

    where the mean is over the two samples. The new sample contains the velocity v', and F_hat' is
    the new estimate. If the forces are constant, the update is exact for every h.

    The signal is `force` [N]. It is positive if F acts against the positive direction of the drive.
    The estimate has these errors: an error of the mass in the settings causes a force error
    proportional to the acceleration. Friction that the settings do not include is part of the
    estimate. At standstill, external forces up to the static friction cannot be detected. The time
    of an estimate is the time of the drive's sample. But the low-pass filter delays the estimate by
    `lag`. If a channel in the rig file uses this signal, its setting `lag_ms` must include this
    delay.
    """

    Settings = ReactionForceSettings
    settings: ReactionForceSettings
    estimated: ClassVar[bool] = True
    """Whether the signals are estimated and not measured."""

    def __init__(self, name: str, settings: ReactionForceSettings) -> None:
        super().__init__(name, settings)
        self.rate = 2 * math.pi * settings.bandwidth_hz
        """Bandwidth g [1/s]."""
        self._drive: Device | None = None
        self._force = self._velocity = NO_SAMPLE
        """Samples of the drive from which the latest estimate was computed."""
        self._driven = math.nan
        """Motor force minus friction at the time of the latest estimate [N]."""

    @property
    def lag(self) -> float:
        """Delay of the estimate by the filter [s], for frequencies well below the bandwidth."""
        return 1.0 / self.rate

    def signals(self) -> dict[str, str]:
        """Return the SI unit of the only signal, the estimated force."""
        return {"force": "N"}

    def start(self, devices: Mapping[str, Device]) -> None:
        """Find the device that measures the force and the velocity of the drive.

        The setting `drive` gives the name of this device.
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
        """Update the estimate if the drive has new samples of both force and velocity."""
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
        """Return the motor force minus the Coulomb and viscous friction of the drive [N]."""
        s = self.settings
        coulomb = math.copysign(s.coulomb_friction_n, velocity) if velocity else 0.0
        return force - coulomb - s.viscous_friction_n_s_per_m * velocity
