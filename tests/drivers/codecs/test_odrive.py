"""Codec of ODrive CANSimple, compared with the vendor's DBC file in the package odrive-can."""

import struct
from functools import cache

import pytest
from cantools.database import Database
from hypothesis import given
from hypothesis import strategies as st
from odrive_can import get_dbc

from drivers.codecs import odrive as codec
from drivers.codecs.odrive import AXIS_ERRORS, REFUSALS, AxisState, Command, Firmware


@cache
def vendor_dbc(firmware):
    """Return the DBC file of a firmware; reading one takes 0.2 s."""
    return get_dbc({"0.5": "odrive-cansimple-0.5.6", "0.6": "odrive-cansimple-0.6.10"}[firmware])


NODES = range(8)
"""Nodes in the DBC file."""

ONLY_06 = (Command.GET_VERSION, Command.GET_TORQUES)

floats = st.floats(width=32, allow_nan=False, allow_infinity=False)
integers = st.integers(0, 2**32 - 1)
firmwares = pytest.mark.parametrize("firmware", ["0.5", "0.6"])


def decoded(firmware: Firmware, message: str, data: bytes) -> dict:
    return vendor_dbc(firmware).decode_message(f"Axis0_{message}", data, decode_choices=False)


def encoded(firmware: Firmware, message: str, **values: float) -> bytes:
    return vendor_dbc(firmware).encode_message(f"Axis0_{message}", values)


def choices(database: Database, message: str, signal: str) -> dict[int, str]:
    table = database.get_message_by_name(f"Axis0_{message}").get_signal_by_name(signal).choices
    return {value: str(name) for value, name in table.items()}


@pytest.mark.parametrize(
    ("firmware", "command"),
    [("0.6", command) for command in Command]
    + [("0.5", command) for command in Command if command not in ONLY_06],
)
def test_identifiers_are_those_of_the_dbc(firmware: Firmware, command: Command) -> None:
    name = command.name.title()
    for node in NODES:
        message = vendor_dbc(firmware).get_message_by_name(f"Axis{node}_{name}")
        assert codec.identifier(node, command) == message.frame_id


@firmwares
@given(state=st.sampled_from(AxisState))
def test_requests_a_state(firmware: Firmware, state: AxisState) -> None:
    data = codec.set_axis_state(state)
    assert decoded(firmware, "Set_Axis_State", data) == {"Axis_Requested_State": state}


@firmwares
@given(control=integers, inputs=integers)
def test_sets_a_controller_mode(firmware: Firmware, control: int, inputs: int) -> None:
    data = codec.set_controller_mode(control, inputs)
    expected = {"Control_Mode": control, "Input_Mode": inputs}
    assert decoded(firmware, "Set_Controller_Mode", data) == expected


@firmwares
@given(velocity=floats)
def test_sets_a_velocity(firmware: Firmware, velocity: float) -> None:
    data = codec.set_input_vel(velocity)
    expected = {"Input_Vel": velocity, "Input_Torque_FF": 0.0}
    assert decoded(firmware, "Set_Input_Vel", data) == expected


@firmwares
@given(torque=floats)
def test_sets_a_torque(firmware: Firmware, torque: float) -> None:
    data = codec.set_input_torque(torque)
    assert decoded(firmware, "Set_Input_Torque", data) == {"Input_Torque": torque}


@firmwares
def test_the_control_modes_are_those_of_the_dbc(firmware: Firmware) -> None:
    modes = choices(vendor_dbc(firmware), "Set_Controller_Mode", "Control_Mode")
    assert modes[codec.TORQUE_CONTROL] == "TORQUE_CONTROL"
    assert modes[codec.VELOCITY_CONTROL] == "VELOCITY_CONTROL"


@firmwares
@given(velocity=floats, current=floats)
def test_sets_limits(firmware: Firmware, velocity: float, current: float) -> None:
    data = codec.set_limits(velocity, current)
    expected = {"Velocity_Limit": velocity, "Current_Limit": current}
    assert decoded(firmware, "Set_Limits", data) == expected


def test_clears_errors_without_blinking() -> None:
    assert decoded("0.6", "Clear_Errors", codec.clear_errors("0.6")) == {"Identify": 0}
    assert vendor_dbc("0.5").get_message_by_name("Axis0_Clear_Errors").length == 0
    assert codec.clear_errors("0.5") == b""


@firmwares
@given(position=floats, velocity=floats)
def test_reads_encoder_estimates(firmware: Firmware, position: float, velocity: float) -> None:
    data = encoded(firmware, "Get_Encoder_Estimates", Pos_Estimate=position, Vel_Estimate=velocity)
    assert codec.encoder_estimates(data) == (position, velocity)


@firmwares
@given(setpoint=floats, measured=floats)
def test_reads_the_current(firmware: Firmware, setpoint: float, measured: float) -> None:
    data = encoded(firmware, "Get_Iq", Iq_Setpoint=setpoint, Iq_Measured=measured)
    assert codec.iq(data) == (setpoint, measured)


@given(target=floats, estimate=floats)
def test_reads_torques(target: float, estimate: float) -> None:
    data = encoded("0.6", "Get_Torques", Torque_Target=target, Torque_Estimate=estimate)
    assert codec.torques(data) == (target, estimate)


@given(firmware=st.tuples(*[st.integers(0, 255)] * 3), other=st.integers(0, 255))
def test_reads_the_version(firmware: tuple[int, int, int], other: int) -> None:
    names = ("Fw_Version_Major", "Fw_Version_Minor", "Fw_Version_Revision")
    others = (
        "Protocol_Version",
        "Hw_Version_Major",
        "Hw_Version_Minor",
        "Hw_Version_Variant",
        "Fw_Version_Unreleased",
    )
    values = dict(zip(names, firmware, strict=True)) | dict.fromkeys(others, other)
    assert codec.version(encoded("0.6", "Get_Version", **values)) == firmware


@given(
    bits=st.sets(st.sampled_from(sorted(AXIS_ERRORS["0.5"]))),
    state=st.sampled_from(AxisState),
    flags=st.tuples(*[st.booleans()] * 4),
)
def test_reads_a_heartbeat_of_05(bits: set[int], state: AxisState, flags: tuple[bool, ...]) -> None:
    motor, encoder, controller, done = flags
    data = encoded(
        "0.5",
        "Heartbeat",
        Axis_Error=sum(bits),
        Axis_State=state,
        Motor_Error_Flag=motor,
        Encoder_Error_Flag=encoder,
        Controller_Error_Flag=controller,
        Trajectory_Done_Flag=done,
    )
    names = choices(vendor_dbc("0.5"), "Heartbeat", "Axis_Error")
    expected = [names[bit] for bit in sorted(bits)]
    expected += ["MOTOR_ERROR"] * motor + ["ENCODER_ERROR"] * encoder
    expected += ["CONTROLLER_ERROR"] * controller
    assert codec.heartbeat("0.5", data) == (state, tuple(expected), "")


@given(
    bits=st.sets(st.sampled_from(sorted(AXIS_ERRORS["0.6"]))),
    state=st.sampled_from(AxisState),
    result=st.integers(0, 15),
    done=st.booleans(),
)
def test_reads_a_heartbeat_of_06(bits: set[int], state: AxisState, result: int, done: bool) -> None:
    data = encoded(
        "0.6",
        "Heartbeat",
        Axis_Error=sum(bits),
        Axis_State=state,
        Procedure_Result=result,
        Trajectory_Done_Flag=done,
    )
    names = choices(vendor_dbc("0.6"), "Heartbeat", "Axis_Error")
    refusal = (
        choices(vendor_dbc("0.6"), "Heartbeat", "Procedure_Result")[result] if result > 3 else ""
    )
    expected = tuple(names[bit] for bit in sorted(bits))
    assert codec.heartbeat("0.6", data) == (state, expected, refusal)


@firmwares
def test_knows_every_error_and_state_of_the_dbc(firmware: Firmware) -> None:
    errors = choices(vendor_dbc(firmware), "Heartbeat", "Axis_Error")
    assert AXIS_ERRORS[firmware] | {0: "NONE"} == errors
    states = choices(vendor_dbc(firmware), "Heartbeat", "Axis_State")
    assert {value: codec.state_name(value) for value in states} == states


def test_knows_every_refusal_of_the_dbc() -> None:
    results = choices(vendor_dbc("0.6"), "Heartbeat", "Procedure_Result")
    excused = {0: "SUCCESS", 1: "BUSY", 2: "CANCELLED", 3: "DISARMED"}
    assert REFUSALS | excused == results


@firmwares
def test_reports_unknown_errors_and_states_by_number(firmware: Firmware) -> None:
    heartbeat = codec.heartbeat(firmware, struct.pack("<IB3x", 1 << 31, 77))
    assert heartbeat.errors == ("error 0x80000000",)
    assert codec.state_name(heartbeat.state) == "state 77"


@firmwares
@given(data=st.binary(max_size=64).filter(lambda data: len(data) != codec.LENGTH))
def test_refuses_a_wrong_length(firmware: Firmware, data: bytes) -> None:
    readers = (codec.encoder_estimates, codec.iq, codec.torques, codec.version)
    for read in (*readers, lambda data: codec.heartbeat(firmware, data)):
        with pytest.raises(struct.error):
            read(data)
