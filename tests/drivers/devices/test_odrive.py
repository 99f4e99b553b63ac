"""The ODrive driver with the emulated axis, in virtual time, and with the mock of odrive-can."""

import asyncio
import logging
import math
import threading
import time
from collections.abc import Callable, Iterator

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st
from odrive_can.mock import ODriveCANMock
from pydantic import ValidationError

from drivers.device import NO_SAMPLE, ForceDrive
from drivers.devices.odrive import ODrive, ODriveSettings
from drivers.rig import RigError
from drivers.transports.can_bus import CanBus
from sim_backend.wire.devices.odrive import EmulatedODrive
from sim_backend.wire.emulated_device import Mount

NODE = 3
TRAVEL = 5e-3
"""Displacement per turn [m]."""
TICK = 1e-3
firmwares = pytest.mark.parametrize("firmware", ["0.5", "0.6"])


def settings(firmware: str, /, **changes: object) -> ODriveSettings:
    values = {
        "kind": "odrive",
        "bus": "can",
        "node": NODE,
        "firmware": firmware,
        "travel_mm_per_turn": 5.0,
        "max_velocity_mm_per_s": 50.0,
        "max_current_a": 10.0,
        "watchdog_ms": 50.0,
        "heartbeat_timeout_ms": 100.0,
    }
    if firmware == "0.5":
        values["torque_constant_nm_per_a"] = 0.04
    return ODriveSettings.model_validate(values | changes)


class Carriage(Mount):
    """Mount of the emulated axis."""

    def __init__(self) -> None:
        self.readings = {"position": 0.0, "velocity": 0.0, "force": 0.0}
        self.braked = True

    def sense(self, signal: str) -> float:
        return self.readings[signal]

    def drive(self, name: str, velocity: float) -> None:
        assert name == "axis"
        self.readings["velocity"] = velocity
        self.braked = False

    def push(self, name: str, force: float) -> None:
        assert name == "axis"
        self.readings["force"], self.braked = force, False

    def brake(self, name: str) -> None:
        self.drive(name, 0.0)
        self.braked = True


class Bench:
    """A driver and an emulated axis in virtual time; it replaces the driver's bus."""

    name = "can"

    def __init__(self, firmware: str, other: str = "", **changes: object) -> None:
        self.carriage = Carriage()
        self.odrive = ODrive("slave", settings(firmware, **changes))
        self.axis = EmulatedODrive("slave", settings(other or firmware), self.carriage)
        self.time = 0.0
        self.severed = False
        self.sent: list[can.Message] = []

    def now(self) -> float:
        return self.time

    def send(self, identifier: int, data: bytes, extended: bool = False) -> None:
        self._pass(
            can.Message(arbitration_id=identifier, data=data, is_extended_id=extended, check=True)
        )

    def request(self, identifier: int, length: int = 8) -> None:
        self._pass(
            can.Message(
                arbitration_id=identifier, dlc=length, is_remote_frame=True, is_extended_id=False
            )
        )

    def _pass(self, frame: can.Message) -> None:
        self.sent.append(frame)
        if not self.severed:
            self.axis.receive(frame, self.time)

    def tick(self) -> None:
        self.time += TICK
        self.carriage.readings["position"] += self.carriage.readings["velocity"] * TICK
        for frame in self.axis.emit(self.time):
            if not self.severed and frame.arbitration_id in self.odrive.identifiers():
                self.odrive.receive(frame, self.time)

    def wait_for(self, condition: Callable[[], object], seconds: float) -> bool:
        end = self.time + seconds
        while not condition() and self.time <= end:
            self.tick()
        return bool(condition())

    def run(self, seconds: float, velocity: float | None = None) -> None:
        """Run a tick of a rig; without a velocity there is no command."""
        for _ in range(round(seconds / TICK)):
            self.tick()
            self.odrive.update(self.time)
            if velocity is not None:
                self.odrive.command(velocity)
                self.odrive.transmit()

    def enable(self) -> bool:
        """Request operation until the axis is in operation, at most for 0.2 s."""
        for _ in range(200):
            if self.odrive.enable():
                return True
            self.run(TICK, 0.0)
        return False

    def from_axis(self, command: int, data: bytes, remote: bool = False) -> None:
        """Pass a frame with the identifier of the axis to the driver."""
        dlc = 8 if remote else None
        frame = can.Message(
            arbitration_id=NODE << 5 | command,
            data=None if remote else data,
            dlc=dlc,
            is_remote_frame=remote,
            is_extended_id=False,
        )
        self.odrive.receive(frame, self.time)

    @property
    def velocity(self) -> float:
        return self.carriage.readings["velocity"]


def started(firmware: str, **changes: object) -> Bench:
    bench = Bench(firmware, **changes)
    bench.odrive.start(bench)
    return bench


def enabled(firmware: str, **changes: object) -> Bench:
    bench = started(firmware, **changes)
    assert bench.enable()
    return bench


@pytest.mark.parametrize(
    ("expected", "there", "words"),
    [
        ("0.5", "0.6", "firmware 0.6.10: expected 0.5"),
        ("0.6", "0.5", "no firmware version reported"),
    ],
)
def test_refuses_another_firmware(expected: str, there: str, words: str) -> None:
    bench = Bench(expected, there)
    with pytest.raises(RigError, match=f"slave: node 3 on can: {words}"):
        bench.odrive.start(bench)


@firmwares
def test_refuses_a_silent_bus(firmware: str) -> None:
    bench = Bench(firmware)
    bench.severed = True
    with pytest.raises(RigError, match="slave: node 3 on can: no heartbeat within 1 s"):
        bench.odrive.start(bench)


@firmwares
def test_an_axis_that_was_left_running_is_idled_at_start(firmware: str) -> None:
    bench = enabled(firmware)
    bench.run(0.01, 0.02)
    again = ODrive("slave", settings(firmware))
    bench.odrive = again
    again.start(bench)
    bench.run(0.01)
    assert bench.velocity == 0.0


@firmwares
def test_reads_position_velocity_and_force_in_si_units(firmware: str) -> None:
    bench = started(firmware)
    bench.carriage.readings.update(position=0.0125, velocity=0.04, force=-7.5)
    bench.axis.mount = Still(bench.carriage.readings)
    bench.run(0.01)
    values = {signal: sample.value for signal, sample in bench.odrive.samples.items()}
    assert values == pytest.approx({"position": 0.0125, "velocity": 0.04, "force": -7.5}, rel=1e-6)
    for sample in bench.odrive.samples.values():
        assert bench.time - sample.time < 5e-3
    assert bench.odrive.signals() == {"position": "m", "velocity": "m/s", "force": "N"}


class Still(Carriage):
    """A carriage with constant readings for all commands."""

    def __init__(self, readings: dict[str, float]) -> None:
        self.readings = dict(readings)

    def drive(self, name: str, velocity: float) -> None:
        pass


def test_without_the_torque_constant_firmware_05_gets_no_request_for_the_current() -> None:
    bench = Bench("0.5", torque_constant_nm_per_a=None)
    bench.odrive.start(bench)
    bench.sent.clear()
    bench.run(0.1)
    assert not bench.sent
    assert "force" not in bench.odrive.signals()


@firmwares
def test_is_enabled_at_standstill(firmware: str) -> None:
    bench = started(firmware)
    assert not bench.odrive.enable()
    for _ in range(200):
        assert bench.odrive.command(0.03) == 0.0 or bench.odrive.enable()
        if bench.odrive.enable():
            break
        bench.odrive.transmit()
        bench.run(TICK)
        assert bench.velocity == 0.0
    assert bench.odrive.enable()
    assert not bench.odrive.error


@firmwares
def test_follows_a_velocity(firmware: str) -> None:
    bench = enabled(firmware)
    bench.run(0.5, 0.02)
    assert bench.odrive.samples["position"].value == pytest.approx(0.01, rel=0.01)
    assert bench.odrive.samples["velocity"].value == pytest.approx(0.02)
    assert not bench.odrive.error


@firmwares
def test_limits_a_velocity_above_its_maximum(firmware: str) -> None:
    bench = enabled(firmware)
    assert bench.odrive.command(-1.0) == -0.05
    assert bench.odrive.command(0.02) == 0.02


@firmwares
def test_idle_stops_immediately_and_may_be_repeated(firmware: str) -> None:
    bench = enabled(firmware)
    bench.run(0.01, 0.02)
    for _ in range(3):
        bench.odrive.idle()
        bench.run(2e-3, 0.02)
        assert bench.carriage.braked
    bench.run(0.2, 0.02)
    assert bench.carriage.braked
    assert not bench.odrive.error


@firmwares
def test_may_be_enabled_again_after_idle(firmware: str) -> None:
    bench = enabled(firmware)
    bench.odrive.idle()
    assert not bench.odrive.enable()
    assert bench.enable()
    bench.run(0.01, 0.02)
    assert bench.velocity == pytest.approx(0.02)
    assert not bench.odrive.error


@firmwares
def test_the_watchdog_stops_an_axis_whose_host_is_silent(firmware: str) -> None:
    bench = enabled(firmware)
    bench.run(0.01, 0.02)
    bench.run(0.07)
    assert bench.velocity == 0.0
    assert bench.odrive.error == "WATCHDOG_TIMER_EXPIRED"


@firmwares
def test_an_error_stays_until_enabled_again_after_idle(firmware: str) -> None:
    bench = enabled(firmware)
    bench.send(NODE << 5 | 0x02, b"")
    bench.run(0.02, 0.02)
    assert bench.odrive.error == "ESTOP_REQUESTED"
    assert bench.odrive.command(0.02) == 0.0
    assert not bench.enable()
    bench.odrive.idle()
    bench.run(0.1, 0.02)
    assert bench.odrive.error == "ESTOP_REQUESTED"
    assert bench.velocity == 0.0
    assert bench.enable()
    assert not bench.odrive.error


@firmwares
def test_a_watchdog_that_expires_while_idle_is_not_an_error(firmware: str) -> None:
    bench = started(firmware, torque_constant_nm_per_a=None)
    bench.run(0.5, 0.0)
    assert not bench.odrive.error
    assert bench.enable()


@firmwares
def test_missing_heartbeats_are_an_error(firmware: str) -> None:
    bench = enabled(firmware)
    bench.severed = True
    bench.run(0.09, 0.02)
    assert not bench.odrive.error
    bench.run(0.03, 0.02)
    assert bench.odrive.error.startswith("no heartbeat for 10")
    assert bench.odrive.error.endswith(" ms")


@firmwares
def test_heartbeats_delayed_by_the_host_do_not_count_as_missing(firmware: str) -> None:
    bench = enabled(firmware)
    bench.from_axis(0x01, bytes([0, 0, 0, 0, 8, 0, 0, 0]))
    bench.odrive.update(bench.time + 1.0)
    assert not bench.odrive.error


@firmwares
def test_an_axis_that_was_reset_does_not_move_on(firmware: str) -> None:
    bench = enabled(firmware, heartbeat_timeout_ms=1000.0)
    bench.run(0.01, 0.02)
    bench.send(NODE << 5 | 0x16, b"")
    bench.run(0.5, 0.02)
    assert bench.odrive.error.startswith("in state IDLE without an error")
    assert not bench.enable()
    assert bench.velocity == 0.0


def pushed(bench: Bench, force: float, ticks: int = 1) -> float:
    """Command a force in each tick; return the force that the driver states."""
    applied = 0.0
    for _ in range(ticks):
        bench.tick()
        bench.odrive.update(bench.time)
        applied = bench.odrive.drives["axis"].command(force)
        bench.odrive.transmit()
    bench.tick()
    return applied


@firmwares
def test_in_torque_control_it_exerts_the_commanded_force(firmware: str) -> None:
    bench = started(firmware, mode="torque")
    drive = bench.odrive.drives["axis"]
    assert isinstance(drive, ForceDrive)
    while not drive.enable():
        applied = pushed(bench, 30.0)
        assert applied == 0.0 or drive.enable()
        assert bench.carriage.readings["force"] == 0.0 or drive.enable()
    assert pushed(bench, -30.0) == -30.0
    assert bench.carriage.readings["force"] == pytest.approx(-30.0, rel=1e-6)
    assert bench.velocity == 0.0


@firmwares
def test_in_torque_control_a_stop_and_the_watchdog_end_the_force(firmware: str) -> None:
    bench = started(firmware, mode="torque")
    drive = bench.odrive.drives["axis"]
    while not drive.enable():
        pushed(bench, 0.0)
    pushed(bench, 30.0, 5)
    bench.sent.clear()
    drive.idle()
    assert {frame.arbitration_id & 0x1F for frame in bench.sent} == {0x0E, 0x07}
    bench.run(0.05)
    assert bench.carriage.braked
    while not drive.enable():
        pushed(bench, 0.0)
    pushed(bench, 30.0, 5)
    assert not bench.carriage.braked
    bench.run(0.07)
    assert bench.carriage.braked
    assert bench.odrive.error == "WATCHDOG_TIMER_EXPIRED"


def test_reports_why_closed_loop_control_is_refused() -> None:
    bench = started("0.6")
    bench.odrive.enable()
    not_calibrated = bytes([0, 0, 0, 0, 1, 14, 0, 0])
    bench.from_axis(0x01, not_calibrated)
    bench.from_axis(0x01, not_calibrated)
    assert bench.odrive.error == "refuses CLOSED_LOOP_CONTROL: NOT_CALIBRATED"


@firmwares
def test_a_heartbeat_before_the_request_is_not_its_answer(firmware: str) -> None:
    bench = started(firmware)
    bench.odrive.enable()
    bench.from_axis(0x01, bytes([0, 8, 0, 1, 1, 0, 0, 0]))
    assert not bench.odrive.error
    assert bench.enable()


@firmwares
def test_answers_a_ping(firmware: str) -> None:
    bench = started(firmware, torque_constant_nm_per_a=None)
    for _ in range(2):
        assert bench.odrive.ping()
        assert not bench.odrive.answered()
        bench.tick()
        assert bench.odrive.answered()


@firmwares
def test_counts_rejected_frames(firmware: str) -> None:
    bench = started(firmware)
    before = dict(bench.odrive.samples)
    bench.from_axis(0x09, b"\0" * 7)
    bench.from_axis(0x01, b"\0" * 5)
    bench.from_axis(0x09, b"", remote=True)
    bench.from_axis(0x09, b"\0\0\xc0\x7f" * 2)
    assert bench.odrive.rejected == {"length": 2, "remote": 1, "not finite": 1}
    assert bench.odrive.samples == before


@firmwares
@given(frames=st.lists(st.tuples(st.integers(0, 31), st.binary(max_size=8)), max_size=20))
def test_no_frame_raises_or_gives_a_value_that_is_not_finite(
    firmware: str, frames: list[tuple[int, bytes]]
) -> None:
    odrive = ODrive("slave", settings(firmware))
    for command, data in frames:
        identifier = NODE << 5 | command
        if identifier in odrive.identifiers():
            odrive.receive(can.Message(arbitration_id=identifier, data=data), 1.0)
    for sample in odrive.samples.values():
        assert sample == NO_SAMPLE or math.isfinite(sample.value)


FRAMES = {"estop": 0x02, "reset": 0x16}
"""Frames of another host on the bus."""
ACTIONS = ["enable", "command", "idle", "silence", "wait", "sever", *FRAMES]


@firmwares
@given(actions=st.lists(st.sampled_from(ACTIONS), max_size=15))
def test_moves_in_operation_alone_and_never_out_of_an_error(
    firmware: str, actions: list[str]
) -> None:
    bench = started(firmware)
    odrive = bench.odrive
    idled = True
    for action in actions:
        failed = odrive.error
        if action == "enable":
            bench.enable()
        elif action == "idle":
            odrive.idle()
        elif action == "wait":
            bench.run(0.15, 0.0)
        elif action == "silence":
            bench.run(0.08)
        elif action == "sever":
            bench.severed = not bench.severed
        elif action in FRAMES:
            bench.send(NODE << 5 | FRAMES[action], b"")
        bench.run(0.03, 0.02)
        if failed and not (idled and action == "enable"):
            assert odrive.error == failed
        if bench.velocity and not bench.severed:
            assert odrive.enable()
            assert action != "idle"
        idled = action == "idle" or (idled and action != "enable")


@pytest.mark.parametrize(
    "changes",
    [
        {"node": 63},
        {"firmware": "0.4"},
        {"travel_mm_per_turn": 0.0},
        {"watchdog_ms": 0.0},
        {"max_current_a": math.inf},
        {"torque_constant_nm_per_a": 0.0},
        {"firmware": "0.6", "torque_constant_nm_per_a": 0.04},
        {"acceleration": 1.0},
    ],
)
def test_settings_out_of_bounds_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        settings("0.5", **changes)


class ForeignMock(ODriveCANMock):
    """Mock of odrive-can that also reports a version.

    Without this, it answers every request with zeros, so that its firmware is 0.0.0.
    """

    def send_message(self, msg_name: str, msg_dict: dict | None = None, rtr: bool = False) -> None:
        if msg_name == "Axis0_Get_Version":
            msg_dict = {"Fw_Version_Minor": 6, "Fw_Version_Revision": 10}
        super().send_message(msg_name, msg_dict, rtr)


@pytest.fixture
def mocked(request: pytest.FixtureRequest) -> Iterator[tuple[CanBus, ODrive]]:
    """The driver and the mock of odrive-can on a bus of python-can."""
    logging.getLogger("odrive.mock.0").setLevel(logging.CRITICAL)
    channel = request.node.name
    running: dict[str, object] = {}
    up = threading.Event()

    async def serve() -> None:
        mock = request.param(0, can.Bus(interface="virtual", channel=channel))
        running.update(loop=asyncio.get_running_loop(), task=asyncio.current_task())
        up.set()
        try:
            await mock.main()
        except asyncio.CancelledError:
            mock.notifier.stop()
            mock.bus.shutdown()

    thread = threading.Thread(target=lambda: asyncio.run(serve()))
    thread.start()
    assert up.wait(5.0)
    bus = CanBus("can", time.perf_counter, "virtual", channel, None, {})
    # The mock sends a heartbeat every 200 ms.
    odrive = ODrive("slave", settings("0.6", node=0, heartbeat_timeout_ms=1000.0))
    bus.attach(odrive.identifiers(), odrive.receive)
    bus.open()
    try:
        yield bus, odrive
    finally:
        bus.close()
        running["loop"].call_soon_threadsafe(running["task"].cancel)
        thread.join(5.0)
        assert not thread.is_alive()


def ticking(
    bus: CanBus, odrive: ODrive, condition: Callable[[], object], velocity: float, seconds: float
) -> bool:
    """Run ticks of a rig until a condition is true; return whether it is true."""

    def tick() -> object:
        odrive.update(bus.now())
        odrive.command(velocity)
        odrive.transmit()
        return condition()

    return bus.wait_for(tick, seconds)


@pytest.mark.parametrize("mocked", [ForeignMock], indirect=True)
def test_moves_the_mock_of_odrive_can(mocked: tuple[CanBus, ODrive]) -> None:
    bus, odrive = mocked
    odrive.start(bus)
    assert ticking(bus, odrive, odrive.enable, 0.0, 4.0), odrive.error

    def turns() -> float:
        return odrive.samples["position"].value / TRAVEL

    before = turns()
    assert odrive.command(1.0 * TRAVEL) == TRAVEL
    assert ticking(bus, odrive, lambda: turns() > before + 0.3, 1.0 * TRAVEL, 4.0), odrive.error
    assert odrive.samples["velocity"].value == pytest.approx(1.0 * TRAVEL)
    odrive.idle()
    assert bus.wait_for(lambda: odrive.samples["velocity"].value == 0.0, 4.0)
    assert not odrive.error
    assert not odrive.rejected


@pytest.mark.parametrize("mocked", [ODriveCANMock], indirect=True)
def test_refuses_the_mock_that_reports_no_version(mocked: tuple[CanBus, ODrive]) -> None:
    bus, odrive = mocked
    with pytest.raises(RigError, match=r"firmware 0\.0\.0: expected 0\.6"):
        odrive.start(bus)
