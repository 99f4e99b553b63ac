"""The emulated ODrive, with frames encoded and decoded by the vendor's DBC file."""

from collections import Counter
from functools import cache

import can
import pytest
from odrive_can import get_dbc

from drivers.devices.odrive import ODriveSettings
from sim_backend.wire.devices.odrive import EmulatedODrive
from sim_backend.wire.emulated_device import Mount


@cache
def vendor_dbc(firmware):
    """Return the DBC file of a firmware; reading one takes 0.2 s."""
    return get_dbc({"0.5": "odrive-cansimple-0.5.6", "0.6": "odrive-cansimple-0.6.10"}[firmware])


NODE = 4
WATCHDOG = 0.05
"""Watchdog time [s]."""


class Carriage(Mount):
    def __init__(self) -> None:
        self.velocity: float | None = None
        """Velocity [m/s]; None while the axis is braked."""
        self.readings = {"position": 0.01, "velocity": -0.02, "force": 100.0}

    def sense(self, signal: str) -> float:
        return self.readings[signal]

    def drive(self, name: str, velocity: float) -> None:
        assert name == "axis"
        self.velocity = velocity

    def brake(self, name: str) -> None:
        assert name == "axis"
        self.velocity = None


class Wire:
    """A host that uses the DBC file, in virtual time."""

    def __init__(self, firmware: str) -> None:
        self.dbc = vendor_dbc(firmware)
        self.carriage = Carriage()
        self.now = 0.0
        self.axis = EmulatedODrive(
            "slave",
            ODriveSettings(
                kind="odrive",
                bus="can",
                node=NODE,
                firmware=firmware,
                travel_mm_per_turn=5.0,
                torque_constant_nm_per_a=0.04 if firmware == "0.5" else None,
                max_velocity_mm_per_s=50.0,
                max_current_a=10.0,
                watchdog_ms=WATCHDOG * 1e3,
            ),
            self.carriage,
        )

    def send(self, message: str, node: int = NODE, **values: float) -> None:
        definition = self.dbc.get_message_by_name(f"Axis{node}_{message}")
        self.axis.receive(
            can.Message(
                arbitration_id=definition.frame_id,
                data=definition.encode(values),
                is_extended_id=False,
            ),
            self.now,
        )

    def ask(self, message: str) -> dict | None:
        definition = self.dbc.get_message_by_name(f"Axis{NODE}_{message}")
        self.axis.emit(self.now)
        self.axis.receive(
            can.Message(
                arbitration_id=definition.frame_id,
                dlc=8,
                is_remote_frame=True,
                is_extended_id=False,
            ),
            self.now,
        )
        return dict(self.decoded(self.axis.emit(self.now))).get(message)

    def decoded(self, frames: list[can.Message]) -> list[tuple[str, dict]]:
        return [
            (
                self.dbc.get_message_by_frame_id(frame.arbitration_id).name.removeprefix(
                    f"Axis{NODE}_"
                ),
                self.dbc.decode_message(frame.arbitration_id, frame.data),
            )
            for frame in frames
        ]

    def run(self, seconds: float, feed: bool = False) -> list[tuple[str, dict]]:
        heard = []
        for _ in range(round(seconds * 1e3)):
            self.now += 1e-3
            if feed:
                self.send("Set_Input_Vel", Input_Vel=2.0, Input_Torque_FF=0.0)
            heard += self.decoded(self.axis.emit(self.now))
        return heard

    def heartbeat(self) -> dict:
        return [values for name, values in self.run(0.02) if name == "Heartbeat"][-1]

    def operate(self) -> None:
        """Start operation at 2 rev/s."""
        self.send("Set_Limits", Velocity_Limit=10.0, Current_Limit=10.0)
        self.send("Set_Controller_Mode", Control_Mode=2, Input_Mode=1)
        self.send("Set_Input_Vel", Input_Vel=2.0, Input_Torque_FF=0.0)
        self.send("Set_Axis_State", Axis_Requested_State=8)
        self.run(1e-3)
        assert self.carriage.velocity == pytest.approx(0.01)


@pytest.fixture(params=["0.5", "0.6"])
def wire(request: pytest.FixtureRequest) -> Wire:
    return Wire(request.param)


def test_sends_unrequested_frames_at_power_up(wire: Wire) -> None:
    heard = wire.run(0.1)
    counts = Counter(name for name, _ in heard)
    assert counts["Heartbeat"] == pytest.approx(10, abs=1)
    assert counts["Get_Encoder_Estimates"] == pytest.approx(100, abs=1)
    estimates = dict(heard)["Get_Encoder_Estimates"]
    assert estimates["Pos_Estimate"] == pytest.approx(2.0)
    assert estimates["Vel_Estimate"] == pytest.approx(-4.0)
    assert dict(heard)["Heartbeat"]["Axis_State"] == "IDLE"
    assert wire.carriage.velocity is None


def test_firmware_06_sends_torques() -> None:
    torques = dict(Wire("0.6").run(0.01))["Get_Torques"]
    assert torques["Torque_Estimate"] == pytest.approx(100.0 * 5e-3 / 6.283185, rel=1e-6)


def test_reports_its_current() -> None:
    current = Wire("0.5").ask("Get_Iq")
    assert current["Iq_Measured"] == pytest.approx(100.0 * 5e-3 / 6.283185 / 0.04, rel=1e-6)


def test_reports_its_version_from_06_on() -> None:
    version = Wire("0.6").ask("Get_Version")
    assert (version["Fw_Version_Major"], version["Fw_Version_Minor"]) == (0, 6)
    wire = Wire("0.5")
    wire.axis.emit(wire.now)
    question = can.Message(arbitration_id=NODE << 5, is_remote_frame=True, is_extended_id=False)
    wire.axis.receive(question, wire.now)
    assert not wire.axis.emit(wire.now)


def test_late_it_sends_a_few_frames_of_each_kind(wire: Wire) -> None:
    wire.run(0.01)
    wire.now += 1.0
    counts = Counter(name for name, _ in wire.decoded(wire.axis.emit(wire.now)))
    assert set(counts.values()) == {5}
    assert not wire.axis.emit(wire.now)


def test_processes_only_frames_to_its_node(wire: Wire) -> None:
    wire.operate()
    wire.send("Set_Axis_State", node=5, Axis_Requested_State=1)
    wire.run(1e-3)
    assert wire.carriage.velocity is not None


def test_limits_its_velocity(wire: Wire) -> None:
    wire.operate()
    wire.send("Set_Limits", Velocity_Limit=1.0, Current_Limit=10.0)
    wire.run(1e-3)
    assert wire.carriage.velocity == pytest.approx(0.005)


def test_stands_still_in_other_modes(wire: Wire) -> None:
    wire.operate()
    wire.send("Set_Controller_Mode", Control_Mode=3, Input_Mode=1)
    wire.run(1e-3)
    assert wire.carriage.velocity == 0.0


def test_brakes_when_idle(wire: Wire) -> None:
    wire.operate()
    assert wire.heartbeat()["Axis_State"] == "CLOSED_LOOP_CONTROL"
    wire.send("Set_Axis_State", Axis_Requested_State=1)
    wire.run(1e-3)
    assert wire.carriage.velocity is None
    heartbeat = wire.heartbeat()
    assert (heartbeat["Axis_State"], heartbeat["Axis_Error"]) == ("IDLE", "NONE")


def test_operates_while_the_watchdog_is_reset(wire: Wire) -> None:
    wire.operate()
    wire.run(1.0, feed=True)
    assert wire.carriage.velocity == pytest.approx(0.01)


def test_its_watchdog_stops_it(wire: Wire) -> None:
    wire.operate()
    wire.run(WATCHDOG - 5e-3)
    assert wire.carriage.velocity is not None
    wire.run(10e-3)
    assert wire.carriage.velocity is None
    heartbeat = wire.heartbeat()
    assert heartbeat["Axis_Error"] == "WATCHDOG_TIMER_EXPIRED"
    assert heartbeat["Axis_State"] == "IDLE"
    wire.run(0.02, feed=True)
    assert wire.heartbeat()["Axis_Error"] == "WATCHDOG_TIMER_EXPIRED"


@pytest.mark.parametrize(("firmware", "feeds"), [("0.5", True), ("0.6", False)])
def test_a_request_resets_only_the_watchdog_of_05(firmware: str, feeds: bool) -> None:
    wire = Wire(firmware)
    wire.operate()
    for _ in range(10):
        wire.run(0.01)
        wire.ask("Get_Iq")
    assert (wire.carriage.velocity is not None) == feeds


def test_an_error_keeps_it_idle_until_it_is_cleared(wire: Wire) -> None:
    wire.operate()
    estop = can.Message(arbitration_id=NODE << 5 | 0x02, is_extended_id=False)
    wire.axis.receive(estop, wire.now)
    assert wire.heartbeat()["Axis_Error"] == "ESTOP_REQUESTED"
    wire.send("Set_Input_Vel", Input_Vel=2.0, Input_Torque_FF=0.0)
    wire.send("Set_Axis_State", Axis_Requested_State=8)
    wire.run(1e-3)
    assert wire.carriage.velocity is None
    clear = wire.dbc.get_message_by_name(f"Axis{NODE}_Clear_Errors")
    wire.send("Clear_Errors", **{signal.name: 0 for signal in clear.signals})
    wire.send("Set_Axis_State", Axis_Requested_State=8)
    wire.run(1e-3)
    assert wire.carriage.velocity is not None


def test_a_reset_leaves_it_silent_and_then_idle_without_an_error(wire: Wire) -> None:
    wire.operate()
    reboot = wire.dbc.get_message_by_name(f"Axis{NODE}_Reboot")
    wire.send("Reboot", **{signal.name: 0 for signal in reboot.signals})
    assert not wire.run(0.2)
    assert wire.carriage.velocity is None
    wire.run(0.2)
    heartbeat = wire.heartbeat()
    assert heartbeat["Axis_State"] == "IDLE"


def test_wrong_lengths_and_extended_frames_are_ignored(wire: Wire) -> None:
    wire.operate()
    for command in range(32):
        for extended in (False, True):
            if command in (0x02, 0x16, 0x18) and not extended:
                continue
            frame = can.Message(
                arbitration_id=NODE << 5 | command, data=b"\1", is_extended_id=extended
            )
            wire.axis.receive(frame, wire.now)
    wire.run(1e-3)
    assert wire.carriage.velocity == pytest.approx(0.01)
