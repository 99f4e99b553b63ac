"""Emulated axis of an ODrive controller on a CAN bus, with firmware 0.5 or 0.6.

Sources: ODrive's documentation ("CAN Protocol") and, for 0.5, `can_simple.cpp` and `axis.cpp` of
the firmware. With firmware 0.5, every frame to the axis resets the watchdog timer, and the watchdog
is active in every state. With firmware 0.6, only set-points of position, velocity or torque reset
the watchdog timer.
"""

from __future__ import annotations

import math
from struct import pack, unpack
from typing import TYPE_CHECKING

import can

from sim_backend.wire.emulated_device import EmulatedCanDevice, Mount

if TYPE_CHECKING:
    from drivers.devices.odrive import ODriveSettings

HEARTBEAT_PERIOD = 10e-3
BACKLOG = 5
"""Largest number of overdue frames of one kind that are sent at once; older ones are omitted."""
BOOT = 0.3
"""Time after a reset during which the axis neither sends nor receives frames [s]."""

IDLE, CLOSED_LOOP = 1, 8
TORQUE_CONTROL, VELOCITY_CONTROL, PASSTHROUGH = 1, 2, 1
WATCHDOG_EXPIRED = {"0.5": 0x800, "0.6": 0x1000000}
ESTOP_REQUESTED = {"0.5": 0x4000, "0.6": 0x2000000}
INVALID_STATE_05 = 0x1
SUCCESS, BUSY, CANCELLED, DISARMED = 0, 1, 2, 3
INVALID_STATE_06 = 13
SET_POINTS = (0x0C, 0x0D, 0x0E)


class EmulatedODrive(EmulatedCanDevice):
    """Emulated axis of an ODrive controller, which moves one axis of the telemanipulator.

    The axis moves only in the state closed-loop control, with the control mode velocity or torque
    control and the input mode passthrough. In this input mode, a command is applied without delay.
    """

    settings: ODriveSettings

    def __init__(self, name: str, settings: ODriveSettings, mount: Mount) -> None:
        super().__init__(name, settings, mount)
        self._travel = settings.travel_mm_per_turn * 1e-3
        self._old = settings.firmware == "0.5"
        self._awake = -math.inf
        self._reset()

    def _reset(self) -> None:
        """Reset the ODrive axis to its state at power-up."""
        self._state, self._result = IDLE, SUCCESS
        self._errors = 0
        """Error bits: of all errors (firmware 0.5), or of errors that disarmed the axis (0.6)."""
        self._mode = (3, PASSTHROUGH)
        self._input_vel, self._vel_limit = 0.0, 2.0
        self._input_torque = 0.0
        self._fed = math.nan
        self._due: dict[int, float] = {}
        self._answers: list[can.Message] = []

    def receive(self, frame: can.Message, now: float) -> None:
        """Process a CAN frame at time `now` [s]. Frames for other nodes are ignored."""
        node, command = frame.arbitration_id >> 5, frame.arbitration_id & 0x1F
        if frame.is_extended_id or node != self.settings.node or now < self._awake:
            return
        if self._old or command in SET_POINTS:
            self._fed = now
        data = bytes(frame.data)
        if frame.is_remote_frame:
            answer = self._reported_data(command, now)
            if answer:
                self._answers.append(self._frame(command, answer))
        elif command == 0x02:
            self._disarm(ESTOP_REQUESTED[self.settings.firmware])
        elif command == 0x16:
            self._reset()
            self._awake = now + BOOT
        elif command == 0x18:
            self._errors = 0
        elif len(data) == 8:
            self._set(command, data, now)

    def _set(self, command: int, data: bytes, now: float) -> None:
        if command == 0x07:
            self._enter(unpack("<I4x", data)[0], now)
        elif command == 0x0B:
            self._mode = unpack("<II", data)
        elif command == 0x0D:
            self._input_vel = unpack("<f4x", data)[0]
        elif command == 0x0E:
            self._input_torque = unpack("<f4x", data)[0]
        elif command == 0x0F:
            self._vel_limit = unpack("<f4x", data)[0]

    def _enter(self, state: int, now: float) -> None:
        """Change to the state that the host requests.

        Only the states idle and closed-loop control are emulated. The axis changes to closed-loop
        control only if it has no error. If the host requests another state, the axis changes to
        idle, and reports that the request was invalid.
        """
        if state == IDLE:
            self._state, self._result = IDLE, CANCELLED
        elif state != CLOSED_LOOP:
            self._errors |= INVALID_STATE_05 if self._old else 0
            self._state, self._result = IDLE, INVALID_STATE_06
        elif self._shown_errors(now):
            self._result = DISARMED
        else:
            self._state, self._result = CLOSED_LOOP, BUSY

    def _disarm(self, error: int) -> None:
        self._errors |= error
        self._state, self._result = IDLE, DISARMED

    def _expired(self, now: float) -> bool:
        return now - self._fed > self.settings.watchdog_ms * 1e-3

    def _shown_errors(self, now: float) -> int:
        """Return the error bits that the heartbeat frame contains.

        With firmware 0.6, the state determines how long the heartbeat reports an expired watchdog.
        If the watchdog expires in closed-loop control, the error is reported until the host has
        sent a set-point and cleared the errors. In another state, a set-point is sufficient.
        """
        active = WATCHDOG_EXPIRED["0.6"] if not self._old and self._expired(now) else 0
        return self._errors | active

    def due(self) -> float:
        """Return the time at which the axis sends its next periodic frame [s]."""
        return max(self._awake, min(self._due.values(), default=-math.inf))

    def emit(self, now: float) -> list[can.Message]:
        """Check the watchdog, move the motor, and return the CAN frames to be sent at `now` [s].

        The frames are answers to requests of the host, and periodic frames.
        """
        if now < self._awake:
            self.mount.brake("axis")
            return []
        if math.isnan(self._fed):
            self._fed = now
        if self._expired(now) and (self._old or self._state == CLOSED_LOOP):
            self._disarm(WATCHDOG_EXPIRED[self.settings.firmware])
        self._actuate()
        frames, self._answers = self._answers, []
        for command, period in self._cycles():
            due = self._due.get(command, now)
            due = max(due, now - (BACKLOG - 1) * period)
            while due <= now:
                frames.append(self._frame(command, self._reported_data(command, now)))
                due += period
            self._due[command] = due
        return frames

    def _cycles(self) -> tuple[tuple[int, float], ...]:
        feedback = 1.0 / self.mount.rate
        cycles = ((0x01, HEARTBEAT_PERIOD), (0x09, feedback))
        return cycles if self._old else (*cycles, (0x1C, feedback))

    def _actuate(self) -> None:
        if self._state != CLOSED_LOOP:
            self.mount.brake("axis")
            return
        if self._mode == (TORQUE_CONTROL, PASSTHROUGH):
            self.mount.push("axis", self._input_torque * math.tau / self._travel)
            return
        limit = self._vel_limit
        follows = self._mode == (VELOCITY_CONTROL, PASSTHROUGH)
        turns = min(max(self._input_vel, -limit), limit) if follows else 0.0
        self.mount.drive("axis", turns * self._travel)

    def _reported_data(self, command: int, now: float) -> bytes:
        """Return the data of the CAN frame with this command number, which the axis sends.

        The data are empty if the firmware does not send a frame with this command number.
        """
        if command == 0x01:
            errors = self._shown_errors(now)
            if self._old:
                return pack("<IBBBB", errors, self._state, 0, 0, 0x80)
            return pack("<IBBBx", errors, self._state, self._result, 1)
        if command == 0x09:
            position, velocity = self.mount.sense("position"), self.mount.sense("velocity")
            return pack("<ff", position / self._travel, velocity / self._travel)
        torque = self.mount.sense("force") * self._travel / math.tau
        if command == 0x14:
            current = torque / (self.settings.torque_constant_nm_per_a or math.inf)
            return pack("<ff", current, current)
        if command == 0x1C and not self._old:
            return pack("<ff", torque, torque)
        if command == 0x00 and not self._old:
            return pack("<8B", 2, 4, 4, 58, 0, 6, 10, 0)
        return b""

    def _frame(self, command: int, data: bytes) -> can.Message:
        identifier = self.settings.node << 5 | command
        return can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
