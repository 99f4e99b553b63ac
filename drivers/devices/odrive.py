"""Driver of an axis of an ODrive motor controller on a CAN bus, in velocity or torque control."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, FiniteFloat, model_validator

from drivers.codecs import odrive as codec
from drivers.codecs.odrive import AxisState, Command
from drivers.device import (
    CanDevice,
    DeviceSettings,
    Drive,
    ForceDrive,
    OnlyDrive,
    Sample,
    VelocityDrive,
)
from drivers.rig import RigError, new_tuple

if TYPE_CHECKING:
    from drivers.transports.can_bus import CanBus
    from drivers.transports.can_frame import CanFrame

FIRST_HEARTBEAT = 1.0
"""Longest wait for the first heartbeat [s]. This is ten times the default period."""
LEAVING = 1.0
"""Longest wait at the start until the axis is out of operation [s]."""
ANSWER = 0.25
"""Longest wait for the firmware version [s]."""
IQ_PERIOD = 2e-3
"""Shortest time between two requests for the motor current [s]."""
FIRST_REPEAT = 5e-3
"""Time after which a request to leave operation is repeated for the first time [s]."""


class ODriveSettings(DeviceSettings):
    """Settings of an axis of an ODrive motor controller in the rig file."""

    bus: str
    node: Annotated[int, Field(ge=0, le=62)]
    firmware: codec.Firmware
    mode: Literal["velocity", "torque"] = "velocity"
    """What the axis accepts."""
    travel_mm_per_turn: Annotated[FiniteFloat, Field(gt=0)]
    """Displacement of the carriage per turn of the motor [mm]."""
    torque_constant_nm_per_a: Annotated[FiniteFloat, Field(ge=-100, le=100)] | None = None
    """Torque constant of the motor [N m/A], only for firmware 0.5. This firmware reports the
    current but not the torque. If `encoder.config.direction` is -1, the reported current has the
    opposite sign. In this case, give a negative constant."""
    max_velocity_mm_per_s: Annotated[FiniteFloat, Field(gt=0)]
    max_current_a: Annotated[FiniteFloat, Field(gt=0)]
    watchdog_ms: Annotated[FiniteFloat, Field(gt=0, le=1000)]
    """Watchdog time that is set on the ODrive [ms]. This time cannot be set or read over CAN."""
    heartbeat_timeout_ms: Annotated[FiniteFloat, Field(gt=0, le=10_000)] = 300.0

    @model_validator(mode="after")
    def _torque_has_one_source(self) -> Self:
        if self.torque_constant_nm_per_a is not None and self.firmware == "0.6":
            raise ValueError("torque_constant_nm_per_a: not expected: firmware 0.6 reports torques")
        if self.torque_constant_nm_per_a == 0:
            raise ValueError("torque_constant_nm_per_a: expected a number other than 0")
        return self


class TorqueMode(OnlyDrive, ForceDrive):
    """The axis in torque control."""

    _device: ODrive

    def command(self, force: float) -> float:
        """Store the force [N]; return it, or 0 if the axis is not in operation."""
        return self._device.command_force(force)


class ODrive(CanDevice, VelocityDrive):
    """An axis of an ODrive motor controller.

    The signals are `position` [m], `velocity` [m/s] and `force` [N]. The force is computed from the
    motor torque: 2 pi (motor torque) / (travel per turn). The firmware must be 0.5 or 0.6. The
    ODrive sends encoder estimates, heartbeats and, with firmware 0.6, torques periodically. The
    user must set the periods on the ODrive. Firmware 0.5 does not send torques. With this
    firmware, the class requests the motor current if the rig file gives the torque constant of the
    motor. The class computes the motor torque from the current and the torque constant.

    The device has one drive, `axis`, which is the device itself, or with `mode = "torque"` a
    `TorqueMode`. In torque control, the ODrive reduces the torque near the largest velocity. An
    error is stored until `rearm` is called or the axis is enabled again. The user must set the
    watchdog on the ODrive. Set-points reset the watchdog timer. With firmware 0.5, every frame to
    the axis resets this timer. Therefore, from a stop until a heartbeat reports the state IDLE,
    only the request for this state is sent. The pauses between these requests increase to twice the
    watchdog time.
    """

    Settings = ODriveSettings
    settings: ODriveSettings

    def __init__(self, name: str, settings: ODriveSettings) -> None:
        super().__init__(name, settings)
        self._torque_control = settings.mode == "torque"
        axis: Drive = TorqueMode(self) if self._torque_control else self
        self.drives = {"axis": axis}
        self._travel = settings.travel_mm_per_turn * 1e-3
        self._most = settings.max_velocity_mm_per_s * 1e-3
        self._silence = settings.heartbeat_timeout_ms * 1e-3
        self._longest_pause = max(FIRST_REPEAT, 2e-3 * settings.watchdog_ms)
        self._bus: CanBus | None = None
        self._version: codec.Version | None = None
        self._state = int(AxisState.UNDEFINED)
        """State in the latest heartbeat."""
        self._wanted = False
        """Whether operation of the axis is requested."""
        self._settling = False
        """Whether the next heartbeat can be one that was sent before the latest request."""
        self._ready = False
        """Whether the axis is in operation."""
        self._idle = False
        """Whether a heartbeat has reported the state IDLE after the request for it."""
        self._repeat = -math.inf
        """Earliest time of the next request for the state IDLE [s]."""
        self._pause = FIRST_REPEAT
        """Pause after the next request for the state IDLE [s]."""
        self._set_point = 0.0
        """Velocity [rev/s] or torque [N m] that `transmit` sends."""
        self._heard = False
        """Whether a heartbeat was received since the last tick."""
        self._now = self._heartbeat = self._asked = -math.inf
        """Times of this tick, the latest heartbeat, and the latest request for the current [s].

        These are times of ticks, not times of arrival. After a delay of the control loop, frames
        that were waiting in the buffer have earlier times of arrival.
        """
        self._question = Command.GET_IQ if settings.firmware == "0.5" else Command.GET_VERSION
        self._answered = False

    def signals(self) -> Mapping[str, str]:
        """Return the SI unit of each signal.

        With firmware 0.5, the signal `force` exists only if the rig file gives the torque constant
        of the motor.
        """
        units = {"position": "m", "velocity": "m/s"}
        if self.settings.firmware == "0.6" or self.settings.torque_constant_nm_per_a is not None:
            units["force"] = "N"
        return units

    def identifiers(self) -> Iterable[int]:
        """Yield the CAN identifiers of those frames of the axis that `receive` processes."""
        torque = Command.GET_IQ if self.settings.firmware == "0.5" else Command.GET_TORQUES
        for command in (
            Command.GET_VERSION,
            Command.HEARTBEAT,
            Command.GET_ENCODER_ESTIMATES,
            torque,
        ):
            yield codec.identifier(self.settings.node, command)

    def start(self, bus: CanBus) -> None:
        """Take the axis out of operation, and check the firmware version."""
        self._bus = bus
        self._wanted = self._idle = False
        wanted = self.settings.firmware
        who = f"{self.name}: node {self.settings.node} on {bus.name}"
        if not bus.wait_for(lambda: self._heard or self._heartbeat > -math.inf, FIRST_HEARTBEAT):
            raise RigError(
                f"{who}: no heartbeat within {FIRST_HEARTBEAT:g} s: expected an ODrive with "
                "heartbeats enabled"
            )
        if not bus.wait_for(lambda: self._idle or self.idle(), LEAVING):
            state = codec.state_name(self._state)
            raise RigError(
                f"{who}: in state {state} for {LEAVING:g} s: expected IDLE, as requested"
            )
        self._ask(Command.GET_VERSION)
        bus.wait_for(lambda: self._version, ANSWER)
        version = self._version
        if version and f"{version.major}.{version.minor}" != wanted:
            found = ".".join(map(str, version))
            raise RigError(f"{who}: firmware {found}: expected {wanted}, as in the rig file")
        if not version and wanted == "0.6":
            raise RigError(
                f"{who}: no firmware version reported, as by firmware 0.5: expected {wanted}, as "
                "in the rig file"
            )

    def about(self) -> dict[str, str]:
        """Return the firmware version; firmware 0.5 does not state it."""
        found = ".".join(map(str, self._version)) if self._version else "not stated"
        return {"firmware": found}

    def receive(self, frame: CanFrame, time: float) -> None:
        """Process a CAN frame that the axis has sent. `time` is its time of arrival [s]."""
        if frame.is_remote_frame:
            self.rejected["remote"] += 1
            return
        data = frame.data
        if len(data) != codec.LENGTH:
            self.rejected["length"] += 1
            return
        command = frame.arbitration_id & 0x1F
        self._answered = self._answered or command == self._question
        if command == Command.GET_ENCODER_ESTIMATES:
            position, velocity = codec.encoder_estimates(data)
            self._store(time, position=position * self._travel, velocity=velocity * self._travel)
        elif command == Command.HEARTBEAT:
            self._heard = True
            self._check_state(codec.heartbeat(self.settings.firmware, data))
        elif command == Command.GET_TORQUES:
            self._store(time, force=math.tau * codec.torques(data)[1] / self._travel)
        elif command == Command.GET_IQ and (constant := self.settings.torque_constant_nm_per_a):
            self._store(time, force=math.tau * constant * codec.iq(data)[1] / self._travel)
        elif command == Command.GET_VERSION:
            self._version = codec.version(data)

    def _store(self, time: float, **values: float) -> None:
        if not all(map(math.isfinite, values.values())):
            self.rejected["not finite"] += 1
            return
        for signal, value in values.items():
            self.samples[signal] = new_tuple(Sample, (value, time))

    def _check_state(self, heartbeat: codec.Heartbeat) -> None:
        """Check whether the axis is in the requested state; in operation, set `error` if not."""
        self._state = heartbeat.state
        if self._settling:
            self._settling = False
            return
        if not self._wanted:
            self._idle = heartbeat.state == AxisState.IDLE
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
        """Detect missing heartbeats, and request the motor current from the axis.

        The motor current is requested only if the rig file gives the torque constant of the motor.
        This method requests it only if the axis is out of operation. While operation is requested,
        `transmit` requests the current.
        """
        self._now = now
        if self._heard:
            self._heard, self._heartbeat = False, now
        silent = now - self._heartbeat
        if self._wanted and not self.error and silent > self._silence:
            self.error = f"no heartbeat for {silent * 1e3:.0f} ms"
        if self._idle:
            self._ask_for_current()

    def ping(self) -> bool:
        """Send a request whose round-trip time can be measured; return whether it was sent.

        The request is for the firmware version, or with firmware 0.5 for the motor current. It is
        sent only if the axis is out of operation, because it can reset the watchdog timer.
        """
        if not self._idle:
            return False
        self._answered = False
        self._ask(self._question)
        return True

    def answered(self) -> bool:
        """Return whether the answer to the last `ping` was received."""
        return self._answered

    def enable(self) -> bool:
        """Request operation with zero velocity; return whether the axis is in operation.

        Only the first call after `idle` sends messages. They set the limits, the control mode and
        zero velocity, clear all errors, and request operation. Zero velocity is sent before the
        request, because this resets the watchdog timer, which may have expired.
        """
        if not self._wanted:
            self._wanted, self._settling, self._idle, self.error = True, True, False, ""
            limits = codec.set_limits(self._most / self._travel, self.settings.max_current_a)
            control = codec.TORQUE_CONTROL if self._torque_control else codec.VELOCITY_CONTROL
            mode = codec.set_controller_mode(control, codec.PASSTHROUGH)
            self._send(Command.SET_LIMITS, limits)
            self._send(Command.SET_CONTROLLER_MODE, mode)
            self._send_set_point(0.0)
            self._send(Command.CLEAR_ERRORS, codec.clear_errors(self.settings.firmware))
            self._request(AxisState.CLOSED_LOOP_CONTROL)
        return self._ready and not self.error

    def command(self, velocity: float) -> float:
        """Store the velocity [m/s], limited to the range of the axis; return this velocity [m/s].

        If the axis is not in operation, or if there is an error, the velocity is 0.
        """
        operates = self._ready and not self.error
        applied = min(max(velocity, -self._most), self._most) if operates else 0.0
        self._set_point = applied / self._travel
        return applied

    def command_force(self, force: float) -> float:
        """Store the force [N] of an axis in torque control; return the force that is sent [N]."""
        applied = force if self._ready and not self.error else 0.0
        self._set_point = applied * self._travel / math.tau
        return applied

    def transmit(self) -> None:
        """If operation is requested, send the set-point. This also resets the watchdog timer.

        The watchdog of the ODrive must stop the axis if no set-point is sent. But with firmware
        0.5, a request for the motor current also resets the watchdog timer. Therefore, while
        operation is requested, only this method requests the current, directly after a set-point.
        """
        if self._wanted:
            self._send_set_point(self._set_point)
            self._ask_for_current()

    def idle(self) -> bool:
        """Command zero velocity or torque, and request the state IDLE; return whether it confirms.

        The first call, and calls after the confirmation, send the request at once. Until the
        confirmation, it is repeated after pauses of 5, 10, 20 ms and so on. With firmware 0.5, each
        request resets the watchdog timer, also if the axis does not obey. Therefore the pauses
        increase to twice the watchdog time.
        """
        if not self._bus:
            return True
        if self._wanted:
            # A heartbeat in which a requested operation is not visible yet confirms nothing.
            self._settling = not self._ready
            self._repeat, self._pause = -math.inf, FIRST_REPEAT
        self._wanted, self._ready, self._set_point = False, False, 0.0
        now = self._bus.now()
        if self._idle or now >= self._repeat:
            self._send_set_point(0.0)
            self._request(AxisState.IDLE)
            self._repeat = now + self._pause
            self._pause = min(2.0 * self._pause, self._longest_pause)
        return self._idle

    def _ask_for_current(self) -> None:
        if self.settings.torque_constant_nm_per_a and self._now - self._asked >= IQ_PERIOD:
            self._asked = self._now
            self._ask(Command.GET_IQ)

    def _ask(self, command: Command) -> None:
        assert self._bus
        self._bus.request(codec.identifier(self.settings.node, command))

    def _send_set_point(self, value: float) -> None:
        """Send a velocity [rev/s], or in torque control a torque [N m]."""
        if self._torque_control:
            self._send(Command.SET_INPUT_TORQUE, codec.set_input_torque(value))
        else:
            self._send(Command.SET_INPUT_VEL, codec.set_input_vel(value))

    def _request(self, state: AxisState) -> None:
        self._send(Command.SET_AXIS_STATE, codec.set_axis_state(state))

    def _send(self, command: Command, data: bytes) -> None:
        assert self._bus
        self._bus.send(codec.identifier(self.settings.node, command), data)
