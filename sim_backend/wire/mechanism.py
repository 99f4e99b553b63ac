"""Simulated telemanipulator whose motion emulated sensors measure and emulated drives command."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from drivers import AXES, Command, Measurement
from drivers.device import sole_drive
from drivers.rig_file import RigFile
from sim_backend.force_master import FreeHandle
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

    The driver of the device later computes the value of the channel from the signal again.
    """

    channel: str
    """Name of the channel, for example `master_force`."""
    gain: float
    """Gain, in the SI unit of the channel per unit of the signal."""
    offset: float
    """Offset, in the SI unit of the channel."""


class Mechanism:
    """Simulated telemanipulator to which the emulated devices are connected.

    The attribute `mounts` contains the interface of each device to the telemanipulator. When all
    drives have been disabled for the time `PUT_BACK`, the telemanipulator is replaced by a new one
    in its initial state. With a real telemanipulator, the experimenter moves it back to the start
    position between two trials.

    Parameters
    ----------
    file
        The rig file (TOML file that describes the telemanipulator). It states which device measures
        each channel, and which device has the drive of each axis.
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
        """Names of the axes (`master`, `slave`) whose drives are enabled."""
        self.early = 0
        """Number of times that a drive was enabled too early.

        Too early means that the telemanipulator was not yet reset to its initial state after the
        last time that the drives were disabled.
        """
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
        """Replace the simulated telemanipulator by another one, for example with another specimen.

        If all drives are disabled, the next call of `advance` replaces the telemanipulator. If a
        drive is enabled, the telemanipulator is replaced later, when the drives have been disabled
        for the time `PUT_BACK`.

        Parameters
        ----------
        make_rig
            Function that returns the new telemanipulator in its initial state.
        """
        self._make_rig = make_rig
        if not self.driven:
            self._idle_since = -math.inf

    def advance(self) -> Measurement:
        """Advance the telemanipulator to the present time; return the values of its sensors."""
        now = self._now()
        if now - self._idle_since > PUT_BACK:
            self.rig, self._idle_since = self._fresh(), math.inf
        if self.driven:
            self.rig.write(Command(*self._velocities.values()))
        self.measurement = self.rig.read()
        return self.measurement

    def drive(self, axis: str, velocity: float) -> None:
        """Command a velocity of an axis. If the drive of the axis is disabled, enable it first.

        Parameters
        ----------
        axis
            `master` or `slave`.
        velocity
            Velocity of the axis [m/s].
        """
        if not self.driven:
            self.rig.enable()
            self._enabled += 1
            self.early += self._idle_since < math.inf
            self._idle_since = math.inf
        self.driven.add(axis)
        self._velocities[axis] = velocity

    def push(self, axis: str, force: float) -> None:
        """Command the force of the motor of an axis [N]. If its drive is disabled, enable it."""
        self.drive(axis, 0.0)
        plant = self.rig.plant
        if axis == "slave":
            plant.slave.push = force
        elif isinstance(plant.handle, FreeHandle):
            plant.handle.push = force

    def brake(self, axis: str) -> None:
        """Disable the drive of an axis (`master` or `slave`). The axis stops."""
        self._velocities[axis] = 0.0
        plant = self.rig.plant
        if axis == "slave":
            plant.slave.push = None
        elif isinstance(plant.handle, FreeHandle):
            plant.handle.push = 0.0
        if self.driven == {axis}:
            self.rig.idle()
            self._idle_since = self._now()
        self.driven.discard(axis)

    def state(self, axis: str, signal: str) -> float:
        """Return the true position [m], velocity [m/s] or motor force [N] of an axis.

        Parameters
        ----------
        axis
            `master` or `slave`.
        signal
            `position`, `velocity` or `force`. For another signal, and for the force of a master
            with a velocity servo, the result is 0.
        """
        plant = self.rig.plant
        body = plant.slave if axis == "slave" else plant.handle
        if signal == "force":
            if axis == "slave":
                return plant.slave.motor_force
            return plant.handle.push or 0.0 if isinstance(plant.handle, FreeHandle) else 0.0
        return {"position": body.x, "velocity": body.v}.get(signal, 0.0)


class DeviceMount(Mount):
    """Interface of one emulated device to the simulated telemanipulator.

    Parameters
    ----------
    mechanism
        The simulated telemanipulator.
    rate
        Sample rate [Hz] of devices that send samples periodically.
    """

    def __init__(self, mechanism: Mechanism, rate: float) -> None:
        self.rate = rate
        self._mechanism = mechanism
        self.sources: dict[str, Source] = {}
        """Channel from which a signal is computed, by the name of the signal.

        Signals that no channel of the rig file uses are not contained.
        """
        self.axes: dict[str, tuple[str, int]] = {}
        """Axis that a drive moves, and sign of the drive, by the name of the drive.

        The sign is -1 if the positive directions of axis and drive are opposite, otherwise 1.
        """

    def sense(self, signal: str) -> float:
        """Return the present value of a signal of the device.

        If the rig file assigns the signal to a channel, the signal is computed
        from the simulated value of the channel. If not, the signals `position`, `velocity` and
        `force` are those of the axis that the first drive of the device moves, multiplied by the
        sign of the drive. For another signal, or if the device has no drive, the result is 0.
        """
        if source := self.sources.get(signal):
            value: float = getattr(self._mechanism.measurement, source.channel)
            return (value - source.offset) / source.gain
        for axis, sign in self.axes.values():
            return sign * self._mechanism.state(axis, signal)
        return 0.0

    def drive(self, name: str, velocity: float) -> None:
        """Enable a drive if it is disabled, and command its velocity.

        Parameters
        ----------
        name
            Name of the drive in its device.
        velocity
            Velocity [m/s], positive in the positive direction of the drive. This direction can be
            opposite to the positive direction of the axis.
        """
        if name in self.axes:
            axis, sign = self.axes[name]
            self._mechanism.drive(axis, sign * velocity)

    def push(self, name: str, force: float) -> None:
        """Enable a drive if it is disabled, and command the force of its motor.

        Parameters
        ----------
        name
            Name of the drive in its device.
        force
            Force on the moving part [N], positive in the positive direction of the drive.
        """
        if name in self.axes:
            axis, sign = self.axes[name]
            self._mechanism.push(axis, sign * force)

    def brake(self, name: str) -> None:
        """Disable the drive with this name. Its axis stops."""
        if name in self.axes:
            self._mechanism.brake(self.axes[name][0])
