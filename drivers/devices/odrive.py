"""An axis of an ODrive on a CAN bus, firmware 0.5 or 0.6, that follows a velocity."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Self

from pydantic import Field, FiniteFloat, model_validator

from drivers.codecs import odrive as codec
from drivers.codecs.odrive import AxisState, Command
from drivers.device import CanDevice, DeviceSettings, Sample, VelocityDrive
from drivers.rig import RigError

if TYPE_CHECKING:
    import can

    from drivers.transports.can_bus import CanBus

FIRST_HEARTBEAT = 1.0
"""Longest wait for it: ten times the period that an ODrive comes with [s]."""
ANSWER = 0.25
"""Longest wait for the firmware's version [s]."""
IQ_PERIOD = 2e-3
"""Between two requests for the current [s]."""


class ODriveSettings(DeviceSettings):
    """An axis of an ODrive in a rig file."""

    bus: str
    node: Annotated[int, Field(ge=0, le=62)]
    firmware: codec.Firmware
    travel_mm_per_turn: Annotated[FiniteFloat, Field(gt=0)]
    """How far the carriage goes in a turn of the motor."""
    torque_constant_nm_per_a: Annotated[FiniteFloat, Field(ge=-100, le=100)] | None = None
    """Of the motor, by which 0.5, which tells its current alone, gives the force; negative where
    `encoder.config.direction` is -1, since the current counts in the motor's direction."""
    max_velocity_mm_per_s: Annotated[FiniteFloat, Field(gt=0)]
    max_current_a: Annotated[FiniteFloat, Field(gt=0)]
    watchdog_ms: Annotated[FiniteFloat, Field(gt=0, le=1000)]
    """As it is set up on the ODrive; CANSimple can neither set nor read it."""
    heartbeat_timeout_ms: Annotated[FiniteFloat, Field(gt=0, le=10_000)] = 300.0

    @model_validator(mode="after")
    def _torque_has_one_source(self) -> Self:
        if self.torque_constant_nm_per_a is not None and self.firmware == "0.6":
            raise ValueError("torque_constant_nm_per_a: not expected: 0.6 tells torques itself")
        if self.torque_constant_nm_per_a == 0:
            raise ValueError("torque_constant_nm_per_a: expected a constant other than 0")
        return self


class ODrive(CanDevice, VelocityDrive):
    """An axis of an ODrive.

    Signals are `position`, `velocity`, and `force`: that which the motor exerts along its travel,
    2 pi torque / travel of a turn. The ODrive sends encoder estimates, torques (0.6) and heartbeats
    by itself at periods set up on it; 0.5 is asked for its current.

    It has one drive, `axis`, which is itself. An error is latched until the axis is enabled anew.
    The ODrive's watchdog, which must be set up on it, is fed by the velocities, and on 0.5 by every
    frame to the axis.

    Parameters
    ----------
    name
        What the rig file calls it.
    settings
        Its section of the rig file.
    """

    Settings = ODriveSettings
    settings: ODriveSettings

    def __init__(self, name: str, settings: ODriveSettings) -> None:
        super().__init__(name, settings)
        self.drives = {"axis": self}
        self._travel = settings.travel_mm_per_turn * 1e-3
        self._most = settings.max_velocity_mm_per_s * 1e-3
        self._silence = settings.heartbeat_timeout_ms * 1e-3
        self._bus: CanBus | None = None
        self._version: codec.Version | None = None
        self._wanted = False
        """Whether the rig wants the axis in operation."""
        self._settling = False
        """Whether the next heartbeat may be older than the request for operation."""
        self._ready = False
        """Whether it is in operation."""
        self._velocity = 0.0
        self._heard = False
        """Whether a heartbeat came since the last tick."""
        self._now = self._heartbeat = self._asked = -math.inf
        """The tick, that of the last heartbeat, and that of the last question for the current [s].

        In ticks, since frames that wait while the host stalls are dated back.
        """
        self._question = Command.GET_IQ if settings.firmware == "0.5" else Command.GET_VERSION
        self._answered = False

    def signals(self) -> Mapping[str, str]:
        """Position and velocity; force where the firmware or the rig file tells the torque."""
        units = {"position": "m", "velocity": "m/s"}
        if self.settings.firmware == "0.6" or self.settings.torque_constant_nm_per_a is not None:
            units["force"] = "N"
        return units

    def identifiers(self) -> Iterable[int]:
        """Those of the frames that it reads."""
        torque = Command.GET_IQ if self.settings.firmware == "0.5" else Command.GET_TORQUES
        for command in (
            Command.GET_VERSION,
            Command.HEARTBEAT,
            Command.GET_ENCODER_ESTIMATES,
            torque,
        ):
            yield codec.identifier(self.settings.node, command)

    def start(self, bus: CanBus) -> None:
        """Wait for a heartbeat, check the firmware's version, and take the axis out of operation.

        Raises
        ------
        RigError
            There is no heartbeat, or it is another firmware.
        """
        self._bus = bus
        wanted = self.settings.firmware
        who = f"{self.name}: node {self.settings.node} on {bus.name}"
        if not bus.wait_for(lambda: self._heard or self._heartbeat > -math.inf, FIRST_HEARTBEAT):
            raise RigError(
                f"{who}: no heartbeat within {FIRST_HEARTBEAT:g} s: expected an ODrive whose "
                "heartbeats are switched on"
            )
        self._ask(Command.GET_VERSION)
        bus.wait_for(lambda: self._version, ANSWER)
        version = self._version
        if version and f"{version.major}.{version.minor}" != wanted:
            found = ".".join(map(str, version))
            raise RigError(f"{who}: firmware {found}: expected {wanted}, as in the rig file")
        if not version and wanted == "0.6":
            raise RigError(
                f"{who}: does not tell its firmware, as 0.5 does not: expected {wanted}, as in the "
                "rig file"
            )
        self.idle()

    def receive(self, frame: can.Message, time: float) -> None:
        """Take in a frame of the axis."""
        if frame.is_remote_frame:
            self.rejected["remote"] += 1
            return
        data = bytes(frame.data)
        if len(data) != codec.LENGTH:
            self.rejected["length"] += 1
            return
        command = frame.arbitration_id & 0x1F
        self._answered = self._answered or command == self._question
        if command == Command.GET_ENCODER_ESTIMATES:
            position, velocity = codec.encoder_estimates(data)
            self._take(time, position=position * self._travel, velocity=velocity * self._travel)
        elif command == Command.HEARTBEAT:
            self._heard = True
            self._judge(codec.heartbeat(self.settings.firmware, data))
        elif command == Command.GET_TORQUES:
            self._take(time, force=math.tau * codec.torques(data)[1] / self._travel)
        elif command == Command.GET_IQ and (constant := self.settings.torque_constant_nm_per_a):
            self._take(time, force=math.tau * constant * codec.iq(data)[1] / self._travel)
        elif command == Command.GET_VERSION:
            self._version = codec.version(data)

    def _take(self, time: float, **values: float) -> None:
        if not all(map(math.isfinite, values.values())):
            self.rejected["not finite"] += 1
            return
        for signal, value in values.items():
            self.samples[signal] = Sample(value, time)

    def _judge(self, heartbeat: codec.Heartbeat) -> None:
        """Whether the axis does what the rig wants."""
        if not self._wanted:
            return
        if self._settling:
            self._settling = False
            return
        operates = heartbeat.state == AxisState.CLOSED_LOOP_CONTROL
        problem = ", ".join(heartbeat.errors)
        if not problem and not operates and self._ready:
            state = codec.state_name(heartbeat.state)
            problem = f"in state {state} without an error: expected CLOSED_LOOP_CONTROL"
        elif not problem and not operates and heartbeat.refusal:
            problem = f"refuses CLOSED_LOOP_CONTROL: {heartbeat.refusal}"
        self.error = self.error or problem
        self._ready = operates

    def update(self, now: float) -> None:
        """Notice that heartbeats have ceased; ask for the current while out of operation."""
        self._now = now
        if self._heard:
            self._heard, self._heartbeat = False, now
        silent = now - self._heartbeat
        if self._wanted and not self.error and silent > self._silence:
            self.error = f"no heartbeat for {silent * 1e3:.0f} ms"
        if self._bus and not self._wanted:
            self._ask_for_current()

    def ping(self) -> bool:
        """Ask for the version, 0.5 for the current."""
        self._answered = False
        self._ask(self._question)
        return True

    def answered(self) -> bool:
        """Whether the answer has come."""
        return self._answered

    def enable(self) -> bool:
        """Ask the axis to follow velocities, at standstill; whether it does by now.

        The first time after `idle` it clears the errors of the ODrive, and its own. The velocity
        goes ahead of the request for operation: it feeds a watchdog that may have expired.
        """
        if not self._wanted:
            self._wanted, self._settling, self.error = True, True, ""
            limits = codec.set_limits(self._most / self._travel, self.settings.max_current_a)
            mode = codec.set_controller_mode(codec.VELOCITY_CONTROL, codec.PASSTHROUGH)
            self._send(Command.SET_LIMITS, limits)
            self._send(Command.SET_CONTROLLER_MODE, mode)
            self._send(Command.SET_INPUT_VEL, codec.set_input_vel(0.0))
            self._send(Command.CLEAR_ERRORS, codec.clear_errors(self.settings.firmware))
            self._request(AxisState.CLOSED_LOOP_CONTROL)
        return self._ready and not self.error

    def command(self, velocity: float) -> float:
        """Set the velocity within its limit; zero while the axis is not in operation."""
        operates = self._ready and not self.error
        self._velocity = min(max(velocity, -self._most), self._most) if operates else 0.0
        return self._velocity

    def transmit(self) -> None:
        """Send the velocity, which feeds the watchdog, while the rig wants the axis to operate.

        In operation the current is asked for here and nowhere else: on 0.5 the question feeds the
        watchdog too, which has to expire when velocities cease.
        """
        if self._wanted:
            self._send(Command.SET_INPUT_VEL, codec.set_input_vel(self._velocity / self._travel))
            self._ask_for_current()

    def idle(self) -> None:
        """Stand still and leave operation."""
        self._wanted, self._ready, self._velocity = False, False, 0.0
        self._send(Command.SET_INPUT_VEL, codec.set_input_vel(0.0))
        self._request(AxisState.IDLE)

    def _ask_for_current(self) -> None:
        if self.settings.torque_constant_nm_per_a and self._now - self._asked >= IQ_PERIOD:
            self._asked = self._now
            self._ask(Command.GET_IQ)

    def _ask(self, command: Command) -> None:
        assert self._bus
        self._bus.request(codec.identifier(self.settings.node, command))

    def _request(self, state: AxisState) -> None:
        self._send(Command.SET_AXIS_STATE, codec.set_axis_state(state))

    def _send(self, command: Command, data: bytes) -> None:
        assert self._bus
        self._bus.send(codec.identifier(self.settings.node, command), data)
