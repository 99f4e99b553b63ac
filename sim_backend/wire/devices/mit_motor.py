"""Emulated motor with the MIT mode: a Damiao motor, or one of CubeMars (T-Motor).

Sources: the manual of the DM-J4310-2EC and the descriptions of its registers for Damiao; the AK
Series Actuator Driver Manual V1.0.8, and the published firmware of the MIT Mini Cheetah, from which
the firmware of CubeMars is derived.
"""

from __future__ import annotations

import math
from struct import pack
from typing import TYPE_CHECKING

import can

from sim_backend.wire.emulated_device import EmulatedCanDevice, Mount

if TYPE_CHECKING:
    from drivers.devices.mit_motor_settings import MitMotorSettings

PARAMETERS = 0x7FF
DISABLED, ENABLED, COMMUNICATION_LOST = 0x0, 0x1, 0xD


class EmulatedMitMotor(EmulatedCanDevice):
    """A motor with the MIT mode, which pushes one axis of the telemanipulator.

    The motor answers each frame with its identifier, and resets its CAN time-out. A Damiao motor
    whose time-out expires is disabled until its error is cleared. Another motor then exerts no
    torque until the next command.

    Attributes
    ----------
    registers
        Values of the registers of a Damiao motor, by number. A test may change them.
    fault
        Error of the motor, 0 for none. A test may set it.
    """

    settings: MitMotorSettings

    def __init__(self, name: str, settings: MitMotorSettings, mount: Mount) -> None:
        super().__init__(name, settings, mount)
        self._damiao = settings.model.startswith("DM")
        self._radius = settings.travel_mm_per_turn * 1e-3 / (2.0 * math.pi)
        ranges = settings.ranges
        self.registers: dict[int, float] = {
            9: round(settings.watchdog_ms * 20.0),
            10: 1,
            21: ranges.position,
            22: ranges.velocity,
            23: ranges.torque,
        }
        self.fault = 0
        self._operates = False
        self._set_point = (0.0, 0.0, 0.0, 0.0, 0.0)
        self._fed = -math.inf
        self._torque = 0.0
        self._states = 0
        self._answers: list[can.Message] = []

    def receive(self, frame: can.Message, now: float) -> None:
        """Process a CAN frame at time `now` [s]. Frames for other motors are ignored."""
        data = bytes(frame.data)
        if frame.is_extended_id or frame.is_remote_frame or len(data) != 8:
            return
        if self._damiao and frame.arbitration_id == PARAMETERS:
            self._parameter(data)
        elif frame.arbitration_id == self.settings.can_id:
            self._watch(now)
            self._fed = now
            self._obey(data)
            self._states += 1

    def _parameter(self, data: bytes) -> None:
        if data[0] | data[1] << 8 != self.settings.can_id:
            return
        if data[2] == 0xCC:
            self._states += 1
        elif data[2] == 0x33 and data[3] in self.registers:
            value = self.registers[data[3]]
            raw = pack("<f", value) if data[3] > 20 else pack("<I", int(value))
            self._answer(data[:4] + raw)

    def _obey(self, data: bytes) -> None:
        if data[:7] == b"\xff" * 7 and data[7] in (0xFB, 0xFC, 0xFD):
            if data[7] == 0xFB and self._damiao:
                self.fault = 0
            elif data[7] == 0xFC and not self.fault:
                self._operates = True
            elif data[7] == 0xFD:
                self._operates = False
        elif (self._damiao and self.registers[10] == 1) or self._operates:
            self._set_point = self._decoded(data)

    def _decoded(self, data: bytes) -> tuple[float, float, float, float, float]:
        """Return position, velocity, stiffness, damping and torque of a command."""
        p = data[0] << 8 | data[1]
        v = data[2] << 4 | data[3] >> 4
        kp = (data[3] & 0xF) << 8 | data[4]
        kd = data[5] << 4 | data[6] >> 4
        t = (data[6] & 0xF) << 8 | data[7]
        most_p, most_v, most_t = (self.registers[i] for i in (21, 22, 23))
        return (
            p * 2.0 * most_p / 65535.0 - most_p,
            v * 2.0 * most_v / 4095.0 - most_v,
            kp * 500.0 / 4095.0,
            kd * 5.0 / 4095.0,
            t * 2.0 * most_t / 4095.0 - most_t,
        )

    def _watch(self, now: float) -> None:
        """Apply the CAN time-out."""
        limit = self.registers[9] * 50e-6
        if not self._operates or limit == 0.0 or now - self._fed <= limit:
            return
        if self._damiao:
            self._operates, self.fault = False, COMMUNICATION_LOST
        else:
            self._set_point = (0.0, 0.0, 0.0, 0.0, 0.0)

    def emit(self, now: float) -> list[can.Message]:
        """Check the time-out, move the motor, and return the answers to the frames of the host."""
        self._watch(now)
        if self.fault:
            self._operates = False
        if self._operates:
            self._push()
        else:
            self._torque = 0.0
            self.mount.brake("axis")
        for _ in range(self._states):
            self._answer(self._state())
        self._states = 0
        frames, self._answers = self._answers, []
        return frames

    def _push(self) -> None:
        p, v, kp, kd, t = self._set_point
        angle = self.mount.sense("position") / self._radius
        rate = self.mount.sense("velocity") / self._radius
        most = self.registers[23]
        self._torque = min(max(kp * (p - angle) + kd * (v - rate) + t, -most), most)
        self.mount.push("axis", self._torque / self._radius)

    def _state(self) -> bytes:
        angle = self.mount.sense("position") / self._radius
        rate = self.mount.sense("velocity") / self._radius
        p = int(scaled(angle, self.registers[21], 65535)) & 0xFFFF
        v = min(max(int(scaled(rate, self.registers[22], 4095)), 0), 4095)
        t = min(max(int(scaled(self._torque, self.registers[23], 4095)), 0), 4095)
        body = pack(">HBBB", p, v >> 4, (v & 0xF) << 4 | t >> 8, t & 0xFF)
        if self._damiao:
            status = self.fault or (ENABLED if self._operates else DISABLED)
            return bytes((status << 4 | self.settings.can_id & 0xF,)) + body + bytes((35, 30))
        return bytes((self.settings.can_id,)) + body + bytes((35, self.fault))

    def _answer(self, data: bytes) -> None:
        self._answers.append(
            can.Message(arbitration_id=self.settings.reply_id, data=data, is_extended_id=False)
        )


def scaled(value: float, most: float, counts: int) -> float:
    """Return a value from -most to most as a number from 0 to `counts`."""
    return (value + most) * counts / (2.0 * most)
