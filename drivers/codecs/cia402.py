"""Convert the messages of CANopen drives with the profile CiA 402 to SI units, and back.

CiA 301 defines the services NMT, SYNC, EMCY and heartbeat. CiA 402-2 defines the state machine, and
the objects that the following process data objects (PDO) contain:

- RPDO1: controlword 6040h, and target velocity 60FFh, target position 607Ah or target torque 6071h
- TPDO1: statusword 6041h, position actual value 6064h
- TPDO2: velocity actual value 606Ch, torque actual value 6077h
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Literal, NamedTuple

NMT, SYNC, EMCY, TPDO1, RPDO1, TPDO2, SDO_ANSWER, HEARTBEAT = (
    *(0x000, 0x080, 0x080, 0x180, 0x200, 0x280, 0x580, 0x700),
)
"""CAN identifiers of the predefined connection set, CiA 301 7.3.5.

The node id of the drive is added to each identifier except NMT and SYNC.
"""

COMMAND = struct.Struct("<Hi")
"""Layout of RPDO1 with a target velocity or position."""
TORQUE_COMMAND = struct.Struct("<Hh")
"""Layout of RPDO1 with a target torque."""
STATUS = struct.Struct("<Hi")
"""Layout of TPDO1."""
MOTION = struct.Struct("<ih")
"""Layout of TPDO2."""
EMERGENCY = struct.Struct("<HB5s")
"""Layout of EMCY, CiA 301 7.2.7: error code, error register 1001h, manufacturer's data."""
INT32 = (1 << 31) - 1
VelocityUnit = Literal["counts_per_s", "rpm", "milli_rpm"]
Mode = Literal["csv", "csp", "cst"]
"""Cyclic synchronous velocity, position or torque mode."""


class ModeObjects(NamedTuple):
    """Numbers of a mode of operation in the objects of a drive."""

    number: int
    """Value of the objects 6060h and 6061h. Bit `number` - 1 of 6502h states the support."""
    target: int
    """Index of the object with the target value."""
    name: str
    """Quantity of the target value."""


MODES: dict[Mode, ModeObjects] = {
    "csp": ModeObjects(8, 0x607A, "position"),
    "csv": ModeObjects(9, 0x60FF, "velocity"),
    "cst": ModeObjects(10, 0x6071, "torque"),
}
"""Modes of operation, CiA 402-2 tables 78 and 79."""


class NmtCommand(IntEnum):
    """Network management (NMT) commands from the controller to a device, CiA 301 7.2.8.2."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


class NmtState(IntEnum):
    """Network management (NMT) states, which a device sends in its heartbeat, CiA 301 7.2.8.3.2."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F

    @property
    def words(self) -> str:
        """Name of the state as in the standard CiA 301, for example `pre-operational`."""
        return self.name.lower().replace("_", "-")


class DriveState(Enum):
    """States of a drive, CiA 402-2 table 30.

    Each member is a pair of numbers: a mask and a pattern. The drive is in this state if
    `statusword & mask` is equal to the pattern.
    """

    NOT_READY_TO_SWITCH_ON = (0x4F, 0x00)
    SWITCH_ON_DISABLED = (0x4F, 0x40)
    READY_TO_SWITCH_ON = (0x6F, 0x21)
    SWITCHED_ON = (0x6F, 0x23)
    OPERATION_ENABLED = (0x6F, 0x27)
    QUICK_STOP_ACTIVE = (0x6F, 0x07)
    FAULT_REACTION_ACTIVE = (0x4F, 0x0F)
    FAULT = (0x4F, 0x08)

    @property
    def words(self) -> str:
        """Name of the state as in the standard CiA 402-2, for example `operation enabled`."""
        return self.name.lower().replace("_", " ")


class Control(IntEnum):
    """Values of the controlword, which requests a state of the drive, CiA 402-2 table 26."""

    DISABLE_VOLTAGE = 0x00
    QUICK_STOP = 0x02
    SHUTDOWN = 0x06
    SWITCH_ON = 0x07
    ENABLE_OPERATION = 0x0F
    FAULT_RESET = 0x80


TOWARDS_OPERATION: dict[DriveState | None, Control] = {
    DriveState.SWITCH_ON_DISABLED: Control.SHUTDOWN,
    DriveState.READY_TO_SWITCH_ON: Control.SWITCH_ON,
    DriveState.SWITCHED_ON: Control.ENABLE_OPERATION,
    DriveState.OPERATION_ENABLED: Control.ENABLE_OPERATION,
    DriveState.FAULT: Control.FAULT_RESET,
}
"""Controlword to send in each state of a drive, so that the drive starts and remains in operation.

The drive leaves all other states without a command. For QUICK_STOP_ACTIVE this is true if object
605Ah (quick stop option code) is 2.
"""


def nmt(command: NmtCommand, node: int) -> bytes:
    """Return the data of a network management (NMT) message to the device with the id `node`."""
    return bytes((command, node))


def state_of(statusword: int) -> DriveState | None:
    """Return the state of a drive from its statusword; None if CiA 402-2 has no such state."""
    return next((s for s in DriveState if statusword & s.value[0] == s.value[1]), None)


@dataclass(frozen=True)
class Units:
    """Conversion between the units of a CiA 402 drive and SI units along the axis of motion.

    Parameters
    ----------
    counts_per_turn
        Position increments per turn of the motor. The increment is the drive's unit of position.
    travel_per_turn
        Displacement of the axis per turn of the motor [m].
    velocity
        Unit of the objects 60FFh (target velocity) and 606Ch (velocity actual value): position
        increments per second, turns of the motor per minute, or thousandths of the latter.
    rated_torque
        Rated torque, object 6076h [N m]; NaN if unknown. The object 6077h (torque actual value)
        is in thousandths of the rated torque.
    """

    counts_per_turn: float
    travel_per_turn: float
    velocity: VelocityUnit
    rated_torque: float = math.nan

    @property
    def metres(self) -> float:
        """Displacement of the axis for one position increment of the drive [m]."""
        return self.travel_per_turn / self.counts_per_turn

    @property
    def metres_per_second(self) -> float:
        """Velocity of the axis for one velocity unit of the drive [m/s].

        The velocity unit is that of the objects 60FFh (target velocity) and 606Ch (velocity actual
        value).
        """
        if self.velocity == "milli_rpm":
            return self.travel_per_turn / 60e3
        return self.metres if self.velocity == "counts_per_s" else self.travel_per_turn / 60.0

    @property
    def newtons(self) -> float:
        """Force along the axis for one torque unit of the drive [N].

        The torque unit is that of the object 6077h (torque actual value): a thousandth of the rated
        torque. Friction between the motor and the axis is neglected.
        """
        return 1e-3 * self.rated_torque * 2.0 * math.pi / self.travel_per_turn

    def target(self, velocity: float) -> int:
        """Return the integer value of object 60FFh (target velocity) for a velocity [m/s]."""
        return round(max(-INT32, min(INT32, velocity / self.metres_per_second)))

    def target_position(self, position: float) -> int:
        """Return the integer value of object 607Ah (target position) for a position [m]."""
        return round(max(-INT32, min(INT32, position / self.metres)))

    def target_torque(self, force: float, most: int) -> int:
        """Return the integer value of object 6071h (target torque) for a force [N].

        Its magnitude is at most `most`. The unit is a thousandth of the rated torque.
        """
        return round(max(-most, min(most, force / self.newtons)))

    def position(self, data: bytes) -> float:
        """Return the position [m] in the data of TPDO1.

        TPDO1 is the message in which a drive sends its statusword and its position.

        Raises
        ------
        struct.error
            The data do not have 6 bytes.
        """
        return float(STATUS.unpack(data)[1] * self.metres)

    def velocity_and_force(self, data: bytes) -> tuple[float, float]:
        """Return the velocity [m/s] and the force [N] in the data of TPDO2.

        TPDO2 is the message in which a drive sends its velocity and its torque. The force is
        computed from the torque.

        Raises
        ------
        struct.error
            The data do not have 6 bytes.
        """
        velocity, torque = MOTION.unpack(data)
        return velocity * self.metres_per_second, torque * self.newtons


def command(control: Control, target: int, mode: Mode = "csv") -> bytes:
    """Return the data of RPDO1, the message with which the controller commands a drive.

    Parameters
    ----------
    control
        The controlword.
    target
        Target as the value of the object of the mode, see `Units.target`.
    mode
        Mode of operation.
    """
    return (TORQUE_COMMAND if mode == "cst" else COMMAND).pack(control, target)


def statusword(data: bytes) -> int:
    """Return the statusword in the data of TPDO1.

    TPDO1 is the message in which a drive sends its statusword and its position.

    Raises
    ------
    struct.error
        The data do not have 6 bytes.
    """
    return int(STATUS.unpack(data)[0])


def emergency(data: bytes) -> str:
    """Return a text that describes the error in the data of an emergency (EMCY) message.

    The text is empty if the message reports the end of an error.

    Raises
    ------
    struct.error
        The data do not have 8 bytes.
    """
    code, register, _ = EMERGENCY.unpack(data)
    if code >> 8 == 0:
        return ""
    known = (EMERGENCIES.get(code & mask) for mask in (0xFFFF, 0xFFF0, 0xFF00, 0xF000))
    meaning = next(filter(None, known), "unknown error")
    return f"{meaning} (EMCY {code:04X}h, error register {register:02X}h)"


EMERGENCIES = {
    0x1000: "generic error",
    0x2000: "current",
    0x2300: "current at the drive's output",
    0x2310: "continuous over-current at the output",
    0x2320: "short circuit or earth leakage at the output",
    0x2340: "short circuit at the motor",
    0x2350: "motor overload (I2t)",
    0x3000: "voltage",
    0x3110: "mains over-voltage",
    0x3120: "mains under-voltage",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x4000: "temperature",
    0x4210: "drive too hot",
    0x4310: "power stage too hot",
    0x5000: "drive hardware",
    0x5441: "emergency stop or safe torque off",
    0x5530: "parameter memory",
    0x6000: "drive software",
    0x6010: "drive software was reset (watchdog)",
    0x6320: "parameter",
    0x7000: "additional modules",
    0x7120: "motor",
    0x7121: "motor blocked",
    0x7122: "motor or commutation",
    0x7300: "position sensor",
    0x7305: "incremental encoder",
    0x8000: "monitoring",
    0x8100: "communication",
    0x8110: "CAN overrun, frames lost",
    0x8120: "CAN error passive",
    0x8130: "the controller's heartbeat was missed",
    0x8140: "CAN bus-off",
    0x8150: "CAN identifier collision",
    0x8210: "PDO too short",
    0x8220: "PDO too long",
    0x8250: "the controller's PDO was missed",
    0x8300: "torque control",
    0x8400: "velocity control",
    0x8500: "position control",
    0x8611: "following error",
    0x8612: "reference limit",
    0x8700: "SYNC missed",
    0x9000: "external error",
    0xF000: "additional functions",
    0xFF00: "manufacturer-specific error",
}
"""Meaning of error codes and of groups of error codes, CiA 301 table 26 and CiA 402-2 annex."""
