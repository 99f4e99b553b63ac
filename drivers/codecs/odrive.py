"""Encode and decode CAN frames of the protocol ODrive CANSimple, firmware 0.5 and 0.6.

Only the frames for velocity and torque control are supported. The 11-bit identifier of a frame is
node << 5 | command. Data are little-endian, and floats are 32-bit floats of IEEE 754. Turns [rev]
are turns of the motor. The frames are described in "CAN Protocol" in the ODrive documentation of
both firmware versions, and in the vendor's files odrive-cansimple-0.5.6.dbc and
odrive-cansimple-0.6.10.dbc.
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import Literal, NamedTuple

Firmware = Literal["0.5", "0.6"]

LENGTH = 8
"""Number of data bytes in each frame that an axis sends."""


class Command(IntEnum):
    """Commands of the protocol ODrive CANSimple.

    A command is the lower 5 bits of the CAN identifier of a frame.
    """

    GET_VERSION = 0x00
    """This command exists only in firmware 0.6."""
    HEARTBEAT = 0x01
    SET_AXIS_STATE = 0x07
    GET_ENCODER_ESTIMATES = 0x09
    SET_CONTROLLER_MODE = 0x0B
    SET_INPUT_VEL = 0x0D
    SET_INPUT_TORQUE = 0x0E
    SET_LIMITS = 0x0F
    GET_IQ = 0x14
    CLEAR_ERRORS = 0x18
    GET_TORQUES = 0x1C
    """This command exists only in firmware 0.6."""


class AxisState(IntEnum):
    """States of an axis (a motor and its controller) of an ODrive."""

    UNDEFINED = 0
    IDLE = 1
    STARTUP_SEQUENCE = 2
    FULL_CALIBRATION_SEQUENCE = 3
    MOTOR_CALIBRATION = 4
    SENSORLESS_CONTROL = 5
    ENCODER_INDEX_SEARCH = 6
    ENCODER_OFFSET_CALIBRATION = 7
    CLOSED_LOOP_CONTROL = 8
    LOCKIN_SPIN = 9
    ENCODER_DIR_FIND = 10
    HOMING = 11
    ENCODER_HALL_POLARITY_CALIBRATION = 12
    ENCODER_HALL_PHASE_CALIBRATION = 13
    ANTICOGGING_CALIBRATION = 14


STATES = {state.value: state.name for state in AxisState}
TORQUE_CONTROL, VELOCITY_CONTROL = 1, 2
"""Numbers of the control modes for torque control and velocity control."""
PASSTHROUGH = 1
"""Number of the input mode in which the commanded velocity is used without a filter or ramp."""

AXIS_ERRORS: dict[Firmware, dict[int, str]] = {
    "0.5": {
        0x00001: "INVALID_STATE",
        0x00040: "MOTOR_FAILED",
        0x00080: "SENSORLESS_ESTIMATOR_FAILED",
        0x00100: "ENCODER_FAILED",
        0x00200: "CONTROLLER_FAILED",
        0x00800: "WATCHDOG_TIMER_EXPIRED",
        0x01000: "MIN_ENDSTOP_PRESSED",
        0x02000: "MAX_ENDSTOP_PRESSED",
        0x04000: "ESTOP_REQUESTED",
        0x20000: "HOMING_WITHOUT_ENDSTOP",
        0x40000: "OVER_TEMP",
        0x80000: "UNKNOWN_POSITION",
    },
    "0.6": {
        0x00000001: "INITIALIZING",
        0x00000002: "SYSTEM_LEVEL",
        0x00000004: "TIMING_ERROR",
        0x00000008: "MISSING_ESTIMATE",
        0x00000010: "BAD_CONFIG",
        0x00000020: "DRV_FAULT",
        0x00000040: "MISSING_INPUT",
        0x00000100: "DC_BUS_OVER_VOLTAGE",
        0x00000200: "DC_BUS_UNDER_VOLTAGE",
        0x00000400: "DC_BUS_OVER_CURRENT",
        0x00000800: "DC_BUS_OVER_REGEN_CURRENT",
        0x00001000: "CURRENT_LIMIT_VIOLATION",
        0x00002000: "MOTOR_OVER_TEMP",
        0x00004000: "INVERTER_OVER_TEMP",
        0x00008000: "VELOCITY_LIMIT_VIOLATION",
        0x00010000: "POSITION_LIMIT_VIOLATION",
        0x01000000: "WATCHDOG_TIMER_EXPIRED",
        0x02000000: "ESTOP_REQUESTED",
        0x04000000: "SPINOUT_DETECTED",
        0x08000000: "BRAKE_RESISTOR_DISARMED",
        0x10000000: "THERMISTOR_DISCONNECTED",
        0x40000000: "CALIBRATION_ERROR",
    },
}
REFUSALS = {
    4: "NO_RESPONSE",
    5: "POLE_PAIR_CPR_MISMATCH",
    6: "PHASE_RESISTANCE_OUT_OF_RANGE",
    7: "PHASE_INDUCTANCE_OUT_OF_RANGE",
    8: "UNBALANCED_PHASES",
    9: "INVALID_MOTOR_TYPE",
    10: "ILLEGAL_HALL_STATE",
    11: "TIMEOUT",
    12: "HOMING_WITHOUT_ENDSTOP",
    13: "INVALID_STATE",
    14: "NOT_CALIBRATED",
    15: "NOT_CONVERGING",
}
"""Names of the procedure results with which an axis refuses a requested state, by number.

Heartbeats of firmware 0.6 contain a procedure result. The results success, busy, cancelled and
disarmed are not refusals.
"""

TWO_FLOATS = struct.Struct("<ff")
TWO_INTEGERS = struct.Struct("<II")
HEARTBEAT_05 = struct.Struct("<IBBBB")
HEARTBEAT_06 = struct.Struct("<IBB2x")


class Heartbeat(NamedTuple):
    """State and errors of an axis (a motor and its controller), as sent in its heartbeat."""

    state: int
    """One of `AxisState`, or an unknown state of a later firmware."""
    errors: tuple[str, ...]
    """Names of the active errors and of the errors that disarmed the axis."""
    refusal: str = ""
    """Reason why the axis refused a requested state. The text is empty if no state was refused, and
    always for firmware 0.5."""


class Version(NamedTuple):
    """Version numbers of the firmware of an ODrive."""

    major: int
    minor: int
    revision: int


def identifier(node: int, command: Command) -> int:
    """Return the 11-bit CAN identifier of a frame."""
    return node << 5 | command


def set_axis_state(state: AxisState) -> bytes:
    """Return the data of the message Set_Axis_State, which requests this state of an axis."""
    return struct.pack("<I", state).ljust(LENGTH, b"\0")


def set_controller_mode(control: int, inputs: int) -> bytes:
    """Return the data of the message Set_Controller_Mode."""
    return TWO_INTEGERS.pack(control, inputs)


def set_input_torque(torque: float) -> bytes:
    """Return the data of the message Set_Input_Torque, which sets the target torque [N m]."""
    return struct.pack("<f", torque).ljust(LENGTH, b"\0")


def set_input_vel(velocity: float) -> bytes:
    """Return the data of the message Set_Input_Vel, which sets the target velocity [rev/s].

    The torque feed-forward in the message is zero.
    """
    return TWO_FLOATS.pack(velocity, 0.0)


def set_limits(velocity: float, current: float) -> bytes:
    """Return the data of the message Set_Limits: velocity limit [rev/s], current limit [A]."""
    return TWO_FLOATS.pack(velocity, current)


def clear_errors(firmware: Firmware) -> bytes:
    """Return the data of the message Clear_Errors.

    There are no data with firmware 0.5, and one byte with firmware 0.6. The value 0 of this byte
    switches off the blinking light that identifies a device.
    """
    return b"" if firmware == "0.5" else b"\0"


def heartbeat(firmware: Firmware, data: bytes) -> Heartbeat:
    """Return the state and the errors of an axis in the data of its heartbeat message."""
    if firmware == "0.5":
        errors, state, motor, encoder, controller = HEARTBEAT_05.unpack(data)
        flags = {"MOTOR_ERROR": motor, "ENCODER_ERROR": encoder, "CONTROLLER_ERROR": controller}
        names = error_names(firmware, errors) + tuple(n for n, flag in flags.items() if flag & 1)
        return Heartbeat(state, names)
    errors, state, result = HEARTBEAT_06.unpack(data)
    return Heartbeat(state, error_names(firmware, errors), REFUSALS.get(result, ""))


def encoder_estimates(data: bytes) -> tuple[float, float]:
    """Return the position [rev] and the velocity [rev/s] of the motor.

    `data` are the data of the message Get_Encoder_Estimates.
    """
    position, velocity = TWO_FLOATS.unpack(data)
    return position, velocity


def iq(data: bytes) -> tuple[float, float]:
    """Return the setpoint and the measured value of the motor current Iq [A].

    Iq is the current that produces the torque. `data` are the data of the message Get_Iq.
    """
    setpoint, measured = TWO_FLOATS.unpack(data)
    return setpoint, measured


def torques(data: bytes) -> tuple[float, float]:
    """Return the setpoint and the estimated value of the motor torque [N m].

    `data` are the data of the message Get_Torques.
    """
    target, estimate = TWO_FLOATS.unpack(data)
    return target, estimate


def version(data: bytes) -> Version:
    """Return the firmware version in the data of the message Get_Version."""
    return Version(*struct.unpack("<4x3Bx", data))


def error_names(firmware: Firmware, errors: int) -> tuple[str, ...]:
    """Return the names of the errors whose bits are set in the integer `errors`.

    If a bit is unknown, the name contains the value of the bit, for example `error 0x20`.
    """
    if not errors:
        return ()
    names = AXIS_ERRORS[firmware]
    bits = [1 << i for i in range(32) if errors >> i & 1]
    return tuple(names.get(bit, f"error 0x{bit:x}") for bit in bits)


def state_name(state: int) -> str:
    """Return the name of a state of an axis, given its number.

    If the number is unknown, the name contains the number, for example `state 20`.
    """
    return STATES.get(state, f"state {state}")
