"""Simulated telemanipulator that emulated devices measure and move."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from drivers import AXES, Command, Measurement
from drivers.device import sole_drive
from drivers.rig_file import RigFile
from sim_backend.simulated_rig import SimulatedRig
from sim_backend.wire.emulated_device import Mount

PUT_BACK = 1.2
"""Time for which all drives are disabled before the telemanipulator is reset to its initial state
[s]."""
NEVER = 1e9
"""Watchdog time of the simulated drives [s], so long that it never expires.

The emulated devices have their own watchdogs.
"""
RigMaker = Callable[[Callable[[], float], int], SimulatedRig]
"""Function that returns a new telemanipulator in its initial state.

Its arguments are a function that returns the time [s], and the number of times that the drives were
enabled before. With this number, the operator and the sensor noise can differ from trial to trial.
"""


class Source(NamedTuple):
    """Channel from which a signal of an emulated device is computed.

    signal = (value of the channel - offset) / gain
    """

    channel: str
    """Name of the channel."""
    gain: float
    """Gain, in the SI unit of the channel per unit of the signal."""
    offset: float
    """Offset, in the SI unit of the channel."""


class Mechanism:
    """Simulated telemanipulator, with one mount (interface) for each emulated device.

    When all drives have been disabled for the time `PUT_BACK`, the telemanipulator is reset to its
    initial state. A person would do the same between two trials.

    Parameters
    ----------
    file
        The rig file, which assigns channels and drives to devices.
    make_rig
        Function that returns a new telemanipulator in its initial state.
    now
        Function that returns the time of the clock [s].
    """

    def __init__(
        self,
        file: RigFile,
        make_rig: RigMaker,
        now: Callable[[], float],
    ) -> None:
        self._make_rig = make_rig
        self._now = now
        self._velocities = dict.fromkeys(AXES, 0.0)
        self.driven: set[str] = set()
        """Names of the axes whose drives are enabled."""
        self.early = 0
        """Number of times that a drive was enabled before the reset to the initial state."""
        self._idle_since = math.inf
        self._enabled = 0
        self.rig = self._fresh()
        self.measurement = self.rig.read()
        devices = file.make_devices()
        self.mounts = {name: DeviceMount(self, file.sections.rate_hz) for name in devices}
        for channel, c in file.sections.channels.items():
            source = Source(channel, c.gain, c.offset)
            self.mounts[c.device].sources[c.signal] = source
        for axis, d in file.sections.drives.items():
            drive = sole_drive(devices[d.device], d.drive)
            self.mounts[d.device].axes[drive] = (axis, d.sign)

    def _fresh(self) -> SimulatedRig:
        rig = self._make_rig(self._now, self._enabled)
        rig.open()
        return rig

    def exchange(self, make_rig: RigMaker) -> None:
        """Replace the telemanipulator.

        If a drive is enabled, the present telemanipulator is used until the next reset to the
        initial state.

        Parameters
        ----------
        make_rig
            Function that returns the new telemanipulator, as in the constructor.
        """
        self._make_rig = make_rig
        if not self.driven:
            self._idle_since = -math.inf

    def advance(self) -> Measurement:
        """Advance the telemanipulator to the present time; return its measurement."""
        now = self._now()
        if now - self._idle_since > PUT_BACK:
            self.rig, self._idle_since = self._fresh(), math.inf
        if self.driven:
            self.rig.write(Command(*self._velocities.values()))
        self.measurement = self.rig.read()
        return self.measurement

    def drive(self, axis: str, velocity: float) -> None:
        """Enable the drive of an axis if it is disabled, and move the axis at a velocity [m/s]."""
        if not self.driven:
            self.rig.enable()
            self._enabled += 1
            self.early += self._idle_since < math.inf
            self._idle_since = math.inf
        self.driven.add(axis)
        self._velocities[axis] = velocity

    def brake(self, axis: str) -> None:
        """Disable the drive of an axis, and hold the axis."""
        self._velocities[axis] = 0.0
        if self.driven == {axis}:
            self.rig.idle()
            self._idle_since = self._now()
        self.driven.discard(axis)

    def state(self, axis: str, signal: str) -> float:
        """Return the true position [m], velocity [m/s] or motor force [N] of an axis.

        `signal` is `position`, `velocity` or `force`. The result is 0 for other signals, and for
        the force of the master.
        """
        plant = self.rig.plant
        body = plant.slave if axis == "slave" else plant.handle
        if signal == "force":
            return plant.slave.motor_force if axis == "slave" else 0.0
        return {"position": body.x, "velocity": body.v}.get(signal, 0.0)


class DeviceMount(Mount):
    """Interface of one emulated device to the simulated telemanipulator."""

    def __init__(self, mechanism: Mechanism, rate: float) -> None:
        self.rate = rate
        self._mechanism = mechanism
        self.sources: dict[str, Source] = {}
        """For each signal that the rig file uses: the channel from which it is computed."""
        self.axes: dict[str, tuple[str, int]] = {}
        """For each drive, by name: name of its axis, and sign (1 or -1) of its direction."""

    def sense(self, signal: str) -> float:
        """Return the value of a signal of the device.

        A signal that the rig file uses is computed from its channel. Any other signal is computed
        from the axis of the device's first drive. If the device has no drive, the result is 0.
        """
        if source := self.sources.get(signal):
            value: float = getattr(self._mechanism.measurement, source.channel)
            return (value - source.offset) / source.gain
        for axis, sign in self.axes.values():
            return sign * self._mechanism.state(axis, signal)
        return 0.0

    def drive(self, name: str, velocity: float) -> None:
        """Move the axis of a drive at a velocity [m/s], with the sign that the drive uses."""
        if name in self.axes:
            axis, sign = self.axes[name]
            self._mechanism.drive(axis, sign * velocity)

    def brake(self, name: str) -> None:
        """Disable a drive, and hold its axis."""
        if name in self.axes:
            self._mechanism.brake(self.axes[name][0])
