"""Axes of a rig: each axis accepts a velocity, whatever its drive accepts.

The controller commands velocities only. Below it, a drive with a position input receives the
integral of the velocity, and a drive with a force input closes a virtual coupling.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace

from drivers.coupling import CouplingParameters, VirtualCoupling
from drivers.device import Drive, ForceDrive, ImpedanceDrive, PositionDrive, Sample, VelocityDrive

MOST_ROUNDING = 1e-4
"""Largest difference of wanted and sent position that counts as rounding of the drive [m]."""


class Axis(ABC):
    """An axis of a rig with its drive.

    Positions, velocities and forces are those of the rig. `sign` is -1 if the positive direction of
    the drive is opposite, otherwise 1.
    """

    error = ""
    """Reason why the rig must stop, as text; empty if there is none."""
    waits_for = ""
    """What `enable` waits for, as text; empty for the drive itself."""
    force = math.nan
    """Force of the moving part on the rig [N]; NaN if no coupling computes it."""

    def __init__(self, drive: Drive, sign: int) -> None:
        self.drive = drive
        self._sign = sign

    def measure(self, sample: Sample) -> None:  # noqa: B027
        """Process the newest position of the axis [m]."""

    def enable(self) -> bool:
        """Request operation of the drive; return whether it is in operation."""
        return self.drive.enable()

    def rearm(self) -> None:
        """Clear the stored error. If its cause is still present, the error is reported again."""
        self.error = ""

    @abstractmethod
    def command(self, velocity: float, now: float) -> float:
        """Command a velocity [m/s] at the time `now` [s]; return the velocity that is applied."""

    def idle(self) -> bool:
        """Take the drive out of operation; return whether it has confirmed this."""
        return self.drive.idle()


class VelocityAxis(Axis):
    """An axis whose drive accepts velocities."""

    drive: VelocityDrive

    def command(self, velocity: float, now: float) -> float:
        """Send the velocity."""
        return self._sign * self.drive.command(self._sign * velocity)


class PositionAxis(Axis):
    """An axis whose drive accepts positions: the integral of the velocity.

    `reading` returns the newest position on the scale of the drive. After an interruption of the
    loop, the commanded position changes by at most that of `longest_step` seconds.
    """

    drive: PositionDrive

    def __init__(
        self, drive: PositionDrive, sign: int, reading: Callable[[], float], longest_step: float
    ) -> None:
        super().__init__(drive, sign)
        self._reading = reading
        self._longest_step = longest_step
        self._position = self._time = math.nan
        self._velocity = 0.0
        self._operates = False

    def enable(self) -> bool:
        """Start at the position at which the drive goes into operation."""
        if not self._operates:
            self._position, self._velocity, self._time = self._reading(), 0.0, math.nan
            self.drive.command(self._position)
        self._operates = self.drive.enable()
        return self._operates

    def command(self, velocity: float, now: float) -> float:
        """Send the position that the last velocity has reached."""
        if not self._operates:
            return 0.0
        dt = min(now - self._time, self._longest_step) if self._time == self._time else 0.0
        wanted = self._position + self._velocity * dt
        sent = self.drive.command(wanted)
        # The rounding of the drive must not accumulate, but a limit of the drive must hold.
        self._position = min(max(wanted, sent - MOST_ROUNDING), sent + MOST_ROUNDING)
        self._time, self._velocity = now, self._sign * velocity
        return velocity

    def idle(self) -> bool:
        """Take the drive out of operation."""
        self._operates = False
        return self.drive.idle()


class CoupledAxis(Axis):
    """An axis whose drive accepts forces, or closes a coupling itself.

    Parameters
    ----------
    drive
        The drive.
    sign
        Direction of the drive.
    coupling
        Virtual coupling between the commanded motion and the moving part.
    rest_velocity
        Largest speed of the moving part at which the drive may be enabled [m/s].
    max_velocity
        Largest permitted speed of the moving part [m/s].
    """

    def __init__(
        self,
        drive: ForceDrive | ImpedanceDrive,
        sign: int,
        coupling: VirtualCoupling,
        rest_velocity: float,
        max_velocity: float,
    ) -> None:
        super().__init__(drive, sign)
        self.coupling = coupling
        self._rest_velocity = rest_velocity
        self._max_velocity = max_velocity
        self._operates = False

    def measure(self, sample: Sample) -> None:
        """Update the force of the coupling, and check the motion of the moving part."""
        coupling = self.coupling
        self.force = coupling.measure(*sample)
        self.error = coupling.error
        if self._operates and abs(coupling.speed) > self._max_velocity and not self.error:
            self.error = coupling.error = (
                f"the moving part has {abs(coupling.speed) * 1e3:.0f} mm/s, at most "
                f"{self._max_velocity * 1e3:.0f} mm/s"
            )

    def rearm(self) -> None:
        """Clear the stored error of the coupling."""
        super().rearm()
        self.coupling.error = ""

    def enable(self) -> bool:
        """Request operation without force. The moving part must be at rest."""
        if not self._operates:
            if abs(self.coupling.speed) > self._rest_velocity:
                self.waits_for = f"a speed below {self._rest_velocity * 1e3:g} mm/s"
                return False
            self._operates, self.waits_for = True, ""
            self.coupling.hold()
        self._send(0.0)
        return self.drive.enable()

    def command(self, velocity: float, now: float) -> float:
        """Move the proxy with the velocity, and send the force of the coupling."""
        if not self._operates:
            return 0.0
        self.coupling.velocity = velocity
        self._send(self.coupling.force)
        return velocity

    def _send(self, force: float) -> None:
        assert isinstance(self.drive, ForceDrive)
        self.drive.command(-self._sign * force)

    def idle(self) -> bool:
        """Take the drive out of operation, without force."""
        if self._operates:
            self._operates = False
            self.coupling.release()
        self._send(0.0)
        return self.drive.idle()


class DeviceCoupledAxis(CoupledAxis):
    """An axis whose drive closes the coupling itself, from its own encoder.

    The force is also computed here, for the rig. `reading` returns the newest position on the scale
    of the drive. The drive receives the proxy on this scale.
    """

    drive: ImpedanceDrive

    def __init__(
        self,
        drive: ImpedanceDrive,
        sign: int,
        coupling: VirtualCoupling,
        rest_velocity: float,
        max_velocity: float,
        reading: Callable[[], float],
    ) -> None:
        super().__init__(drive, sign, coupling, rest_velocity, max_velocity)
        self._reading = reading

    def _send(self, force: float) -> None:
        coupling, sign = self.coupling, self._sign
        p = coupling.parameters
        if not self._operates:
            self.drive.command(self._reading(), 0.0, 0.0, 0.0)
            return
        # The spring of the drive has no limit of its own.
        most = p.max_force / p.stiffness
        lead = sign * min(max(coupling.proxy - coupling.position, -most), most)
        self.drive.command(self._reading() + lead, sign * coupling.velocity, p.stiffness, p.damping)


def make_axis(
    drive: Drive,
    sign: int,
    reading: Callable[[], float],
    coupling: CouplingParameters | None,
    rest_velocity: float,
    max_velocity: float,
    longest_step: float,
) -> Axis:
    """Return the axis of a drive of any kind.

    Parameters
    ----------
    drive
        The drive.
    sign
        -1 if the positive directions of drive and rig are opposite, otherwise 1.
    reading
        Returns the newest position on the scale of the drive [m].
    coupling
        Virtual coupling. It is needed for a drive that accepts forces or closes a coupling.
    rest_velocity
        Largest speed at which a coupled drive may be enabled [m/s].
    max_velocity
        Largest permitted speed of a moving part that is coupled [m/s].
    longest_step
        Longest time for which a commanded velocity is integrated in one period [s].
    """
    if isinstance(drive, VelocityDrive):
        return VelocityAxis(drive, sign)
    if isinstance(drive, PositionDrive):
        return PositionAxis(drive, sign, reading, longest_step)
    if not coupling:
        raise ValueError(f"{type(drive).__name__}: expected a virtual coupling")
    if isinstance(drive, ImpedanceDrive):
        stiffness, damping = drive.rounded(coupling.stiffness, coupling.damping)
        coupling = replace(coupling, stiffness=stiffness, damping=damping)
    virtual = VirtualCoupling(coupling, longest_step)
    if isinstance(drive, ImpedanceDrive):
        return DeviceCoupledAxis(drive, sign, virtual, rest_velocity, max_velocity, reading)
    if isinstance(drive, ForceDrive):
        return CoupledAxis(drive, sign, virtual, rest_velocity, max_velocity)
    raise ValueError(f"{type(drive).__name__}: expected a drive of a known kind")
