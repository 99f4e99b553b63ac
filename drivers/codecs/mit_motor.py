"""Encode and decode the CAN frames of motors with the "MIT mode": Damiao, CubeMars and T-Motor.

The frames are those of the motor controller of the MIT Mini Cheetah. A command has 8 bytes:
position (16 bits), velocity, stiffness, damping and torque (12 bits each). The torque of the motor
is kp (position - q) + kd (velocity - q') + torque. The frame is the same for all motors, but its
scales are not: they depend on the model, and on registers of a Damiao motor. See the manual of the
DM-J4310-2EC (registers, states), and the AK Series Actuator Driver Manual V1.0.8, section 5.3.
"""

from __future__ import annotations

import struct
from typing import Literal, NamedTuple

LENGTH = 8
"""Number of data bytes in each frame."""
ENTER = b"\xff" * 7 + b"\xfc"
"""Data of the frame with which the motor goes into operation."""
EXIT = b"\xff" * 7 + b"\xfd"
"""Data of the frame with which the motor leaves operation."""
CLEAR = b"\xff" * 7 + b"\xfb"
"""Data of the frame that clears the error of a Damiao motor."""
MOST_STIFFNESS = 500.0
"""Greatest stiffness kp in a command [N m/rad]."""
MOST_DAMPING = 5.0
"""Greatest damping kd in a command [N m s/rad]."""
POSITION_BITS = 16
OTHER_BITS = 12

REGISTERS = 0x7FF
"""CAN identifier of the frames that read registers of Damiao motors."""
READ = 0x33
REFRESH = 0xCC
TIMEOUT, CTRL_MODE, PMAX, VMAX, TMAX = 9, 10, 21, 22, 23
"""Registers of a Damiao motor."""
REGISTER_NAMES = {9: "TIMEOUT", 10: "CTRL_MODE", 21: "PMAX", 22: "VMAX", 23: "TMAX"}
MIT_MODE = 1
"""Value of the register CTRL_MODE for the MIT mode."""
TIMEOUT_UNIT = 50e-6
"""Time of one unit of the register TIMEOUT [s]."""
ENABLED = 1
"""State of a Damiao motor in operation."""

Maker = Literal["damiao", "cubemars"]


class Ranges(NamedTuple):
    """Largest magnitudes of the values in the frames of a motor."""

    position: float
    """Position [rad]."""
    velocity: float
    """Velocity [rad/s]."""
    torque: float
    """Torque [N m]."""

    @property
    def text(self) -> str:
        """The ranges as text with units."""
        return f"{self.position:g} rad, {self.velocity:g} rad/s, {self.torque:g} N m"


DAMIAO = {
    "DM3507": Ranges(12.566, 50, 5),
    "DM4310": Ranges(12.5, 30, 10),
    "DM4310P": Ranges(12.5, 50, 10),
    "DM4340": Ranges(12.5, 10, 28),
    "DM4340P": Ranges(12.5, 10, 28),
    "DM6006": Ranges(12.5, 45, 20),
    "DM6248P": Ranges(12.566, 20, 120),
    "DM8006": Ranges(12.5, 45, 40),
    "DM8009": Ranges(12.5, 45, 54),
    "DM10010": Ranges(12.5, 20, 200),
    "DM10010L": Ranges(12.5, 25, 200),
    "DMG6215": Ranges(12.5, 45, 10),
    "DMH3510": Ranges(12.5, 280, 1),
    "DMH6220": Ranges(12.5, 45, 10),
}
"""Ranges of Damiao motors as delivered. They can be changed in the registers of the motor."""
CUBEMARS = {
    "AK10-9": Ranges(12.5, 50, 65),
    "AK60-6": Ranges(12.5, 45, 15),
    "AK70-10": Ranges(12.5, 50, 25),
    "AK80-6": Ranges(12.5, 76, 12),
    "AK80-8": Ranges(12.5, 37.5, 32),
    "AK80-9": Ranges(12.5, 50, 18),
    "AK80-64": Ranges(12.5, 8, 144),
    "AK80-80": Ranges(12.5, 8, 144),
}
"""Ranges of the motors of CubeMars (T-Motor) with a firmware before version 3."""

DAMIAO_ERRORS = {
    0x8: "over-voltage",
    0x9: "under-voltage",
    0xA: "over-current",
    0xB: "over-temperature of the MOSFETs",
    0xC: "over-temperature of the rotor",
    0xD: "communication lost: no command arrived in time",
    0xE: "overload",
}
CUBEMARS_ERRORS = {
    1: "over-temperature of the motor",
    2: "over-current",
    3: "over-voltage",
    4: "under-voltage",
    5: "encoder",
    6: "phase currents are not balanced",
}


class State(NamedTuple):
    """State of a motor, which is its answer to each frame."""

    motor: int
    """CAN identifier of the motor; of a Damiao motor, its last four bits."""
    status: int
    """State of a Damiao motor (0 disabled, 1 enabled, from 8 an error); error of another motor."""
    position: int
    """Position [counts], 0 to 65535."""
    velocity: float
    """Velocity [rad/s]."""
    torque: float
    """Torque [N m]."""


def counts(value: float, low: float, high: float, bits: int) -> int:
    """Return a value, limited to the range from `low` to `high`, as an unsigned integer."""
    most = (1 << bits) - 1
    return round((min(max(value, low), high) - low) / (high - low) * most)


def value(number: int, low: float, high: float, bits: int) -> float:
    """Return the value that an unsigned integer stands for."""
    return low + number / ((1 << bits) - 1) * (high - low)


def rounded(wanted: float, low: float, high: float, bits: int) -> float:
    """Return the value nearest to the wanted one that a frame can contain."""
    return value(counts(wanted, low, high, bits), low, high, bits)


def command(
    ranges: Ranges, position: float, velocity: float, kp: float, kd: float, torque: float
) -> bytes:
    """Return the data of a command; position [rad], kp [N m/rad], torque [N m] and so on."""
    p = counts(position, -ranges.position, ranges.position, POSITION_BITS)
    v = counts(velocity, -ranges.velocity, ranges.velocity, OTHER_BITS)
    stiffness = counts(kp, 0.0, MOST_STIFFNESS, OTHER_BITS)
    damping = counts(kd, 0.0, MOST_DAMPING, OTHER_BITS)
    t = counts(torque, -ranges.torque, ranges.torque, OTHER_BITS)
    return (p << 48 | v << 36 | stiffness << 24 | damping << 12 | t).to_bytes(LENGTH, "big")


def state(maker: Maker, ranges: Ranges, data: bytes) -> State:
    """Return the state in the 8 bytes of an answer of a motor.

    The error is in the first byte of the answer of a Damiao motor, else in the last one.
    """
    first, position, rest = struct.unpack_from(">BHI", data)
    v, t = rest >> 20, rest >> 8 & 0xFFF
    damiao = maker == "damiao"
    return State(
        first & 0xF if damiao else first,
        first >> 4 if damiao else data[7],
        position,
        value(v, -ranges.velocity, ranges.velocity, OTHER_BITS),
        value(t, -ranges.torque, ranges.torque, OTHER_BITS),
    )


def read_register(motor: int, register: int) -> bytes:
    """Return the data of the request for a register of a Damiao motor."""
    return struct.pack("<HBB4x", motor, READ, register)


def refresh(motor: int) -> bytes:
    """Return the data of the request for the state of a Damiao motor.

    It does not reset the CAN time-out of the motor, because its identifier is not that of the
    motor.
    """
    return struct.pack("<HB5x", motor, REFRESH)


def register_value(motor: int, register: int, data: bytes) -> float | None:
    """Return the value of a register in an answer of a Damiao motor; None for another answer."""
    if data[:4] != struct.pack("<HBB", motor, READ, register):
        return None
    kind = "<f" if register in (PMAX, VMAX, TMAX) else "<I"
    return float(struct.unpack_from(kind, data, 4)[0])
