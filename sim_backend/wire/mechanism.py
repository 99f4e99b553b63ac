"""The simulated telemanipulator that emulated devices are mounted on."""

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
"""Time after which a telemanipulator whose drives are idle is put back to its start [s]."""
NEVER = 1e9
"""Watchdog of the simulated drives [s]: the emulated devices have their own."""


class Source(NamedTuple):
    """What a device's signal reads of a channel: (value - offset) / gain."""

    channel: str
    gain: float
    offset: float


class Mechanism:
    """The simulated telemanipulator, and where each emulated device is mounted on it.

    Once its drives have been idle for a while it is put back to its start, as a person would
    between trials.

    Parameters
    ----------
    file
        Which device is mounted where.
    make_rig
        Makes the telemanipulator at its start, on a clock [s].
    now
        The clock [s].
    """

    def __init__(
        self,
        file: RigFile,
        make_rig: Callable[[Callable[[], float]], SimulatedRig],
        now: Callable[[], float],
    ) -> None:
        self._make_rig = make_rig
        self._now = now
        self._velocities = dict.fromkeys(AXES, 0.0)
        self.driven: set[str] = set()
        """The axes that are not held."""
        self._idle_since = math.inf
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
        rig = self._make_rig(self._now)
        rig.open()
        return rig

    def advance(self) -> Measurement:
        """Let the telemanipulator catch up with the clock; what a perfect reading gives."""
        now = self._now()
        if now - self._idle_since > PUT_BACK:
            self.rig, self._idle_since = self._fresh(), math.inf
        if self.driven:
            self.rig.write(Command(*self._velocities.values()))
        self.measurement = self.rig.read()
        return self.measurement

    def drive(self, axis: str, velocity: float) -> None:
        """Let an axis go at a velocity [m/s]."""
        if not self.driven:
            self.rig.enable()
            self._idle_since = math.inf
        self.driven.add(axis)
        self._velocities[axis] = velocity

    def brake(self, axis: str) -> None:
        """Hold an axis."""
        self._velocities[axis] = 0.0
        if self.driven == {axis}:
            self.rig.idle()
            self._idle_since = self._now()
        self.driven.discard(axis)

    def state(self, axis: str, signal: str) -> float:
        """Position [m], velocity [m/s] or motor force [N] of an axis, as its own encoder has it."""
        plant = self.rig.plant
        body = plant.slave if axis == "slave" else plant.handle
        if signal == "force":
            return plant.slave.motor_force if axis == "slave" else 0.0
        return {"position": body.x, "velocity": body.v}.get(signal, 0.0)


class DeviceMount(Mount):
    """Where one device is mounted on the mechanism."""

    def __init__(self, mechanism: Mechanism, rate: float) -> None:
        self.rate = rate
        self._mechanism = mechanism
        self.sources: dict[str, Source] = {}
        """The channels that it measures, by signal."""
        self.axes: dict[str, tuple[str, int]] = {}
        """The axes that it drives and their signs, by drive."""

    def sense(self, signal: str) -> float:
        """What the signal reads: of the channel that it is for, or of the axis that it drives."""
        if source := self.sources.get(signal):
            value: float = getattr(self._mechanism.measurement, source.channel)
            return (value - source.offset) / source.gain
        for axis, sign in self.axes.values():
            return sign * self._mechanism.state(axis, signal)
        return 0.0

    def drive(self, name: str, velocity: float) -> None:
        """Let the axis behind a drive go."""
        if name in self.axes:
            axis, sign = self.axes[name]
            self._mechanism.drive(axis, sign * velocity)

    def brake(self, name: str) -> None:
        """Hold that axis."""
        if name in self.axes:
            self._mechanism.brake(self.axes[name][0])
