"""Every drive stands still after a stop, whichever frames to it are lost.

The driver of each drive and its emulated device are connected in virtual time. As in the control
loop, `idle` is called once per tick until the drive has confirmed it, and nothing else is sent in
this time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import can
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from drivers.codecs.odrive import AxisState, Command, identifier, set_axis_state, set_input_vel
from drivers.device import Device, ForceDrive, PositionDrive, SerialDevice
from drivers.devices.board import Board
from drivers.devices.board_settings import BoardSettings
from drivers.devices.cia402 import Cia402
from drivers.devices.cia402_settings import Cia402Settings
from drivers.devices.mit_motor import MitMotor
from drivers.devices.mit_motor_settings import MitMotorSettings
from drivers.devices.moteus import Moteus, MoteusSettings
from drivers.devices.odrive import ODrive, ODriveSettings
from sim_backend.wire.devices.board import EmulatedBoard
from sim_backend.wire.devices.cia402 import DECELERATION, EmulatedCia402
from sim_backend.wire.devices.mit_motor import EmulatedMitMotor
from sim_backend.wire.devices.moteus import EmulatedMoteus
from sim_backend.wire.devices.odrive import EmulatedODrive
from sim_backend.wire.emulated_device import EmulatedDevice, Mount

TICK = 1e-3
FORCE = 1000.0
"""Force of a drive that accepts forces, in place of a velocity of 1 m/s [N]."""
WATCHDOG = 0.05
SPEED = 0.02
SLACK = 3 * TICK + SPEED / DECELERATION
"""Time for the transmission, and for the quick stop ramp of the CiA 402 drive [s]."""


def odrive(firmware: str, mode: str = "velocity") -> tuple[Device, type[EmulatedDevice]]:
    given = {"torque_constant_nm_per_a": 0.04} if firmware == "0.5" else {}
    section = ODriveSettings(
        kind="odrive",
        bus="wire",
        node=3,
        firmware=firmware,
        mode=mode,
        travel_mm_per_turn=5.0,
        max_velocity_mm_per_s=50.0,
        max_current_a=10.0,
        watchdog_ms=WATCHDOG * 1e3,
        **given,
    )
    return ODrive("slave", section), EmulatedODrive


def cia402(mode: str = "csv") -> tuple[Device, type[EmulatedDevice]]:
    section = Cia402Settings(
        kind="cia402",
        bus="wire",
        node_id=5,
        counts_per_turn=10_000,
        travel_mm_per_turn=5.0,
        watchdog_ms=round(WATCHDOG * 1e3),
        mode=mode,
    )
    return Cia402("slave", section), EmulatedCia402


def moteus() -> tuple[Device, type[EmulatedDevice]]:
    section = MoteusSettings(
        kind="moteus",
        bus="wire",
        node=2,
        mode="velocity",
        travel_mm_per_turn=5.0,
        max_velocity_mm_per_s=50.0,
        max_torque_nm=0.5,
        watchdog_ms=WATCHDOG * 1e3,
    )
    return Moteus("slave", section), EmulatedMoteus


def board(**scales: Any) -> tuple[Device, type[EmulatedDevice]]:
    section = BoardSettings(
        kind="board",
        bus="wire",
        position_um_per_count=[1.0],
        watchdog_ms=round(WATCHDOG * 1e3),
        **(scales or {"velocity_um_per_s_per_count": [1.0]}),
    )
    return Board("slave", section), EmulatedBoard


def mit_motor(model: str, **ranges: float) -> tuple[Device, type[EmulatedDevice]]:
    section = MitMotorSettings(
        kind="mit_motor",
        bus="wire",
        model=model,
        mode="torque",
        can_id=3,
        reply_id=0x13,
        travel_mm_per_turn=500.0,
        watchdog_ms=WATCHDOG * 1e3,
        **ranges,
    )
    return MitMotor("slave", section), EmulatedMitMotor


KINDS: dict[str, Callable[[], tuple[Device, type[EmulatedDevice]]]] = {
    "odrive-0.5": lambda: odrive("0.5"),
    "odrive-0.6": lambda: odrive("0.6"),
    "odrive-0.6-torque": lambda: odrive("0.6", "torque"),
    "cia402": cia402,
    "cia402-csp": lambda: cia402("csp"),
    "cia402-cst": lambda: cia402("cst"),
    "board": board,
    "board-force": lambda: board(axis_force_n_per_count=[1e-3]),
    "mit_motor-damiao": lambda: mit_motor("DM4310"),
    "mit_motor-cubemars": lambda: mit_motor(
        "AK80-9", p_max_rad=12.5, v_max_rad_per_s=50, t_max_nm=18
    ),
    "moteus": moteus,
}


class Line(Mount):
    """The bus or port of one drive, and the carriage that the drive moves, in virtual time."""

    name = port = "wire"
    received = 0

    def __init__(self, kind: str) -> None:
        self.device, emulated = KINDS[kind]()
        self.emulated = emulated("slave", self.device.settings, self)
        (self.drive_name,) = self.device.drives
        self.time = self.velocity = self.position = self.target = 0.0
        self.driven = False
        self.lost: Iterator[bool] = iter(())
        """Whether each of the next frames to the drive is lost; then none is lost."""
        self.deaf = False
        """Whether no frame of the drive arrives."""
        self.sent: list[can.Message | bytes] = []
        self.device.start(self)

    @property
    def driver(self) -> Any:
        return self.device.drives[self.drive_name]

    def now(self) -> float:
        return self.time

    def sense(self, signal: str) -> float:
        if signal == "position":
            return self.position
        return self.velocity if signal.startswith("velocity") else 0.0

    def drive(self, name: str, velocity: float) -> None:
        self.velocity, self.driven = velocity, True

    def push(self, name: str, force: float) -> None:
        self.velocity, self.driven = force / FORCE, force != 0.0

    def brake(self, name: str) -> None:
        self.velocity, self.driven = 0.0, False

    def write(self, frame: can.Message | bytes) -> None:
        self.sent.append(frame)
        if not next(self.lost, False):
            self.emulated.receive(frame, self.time)

    def send(
        self,
        identifier: int,
        data: bytes,
        extended: bool = False,
        fd: bool = False,
        bitrate_switch: bool = False,
    ) -> None:
        self.write(
            can.Message(
                arbitration_id=identifier, data=data, is_extended_id=extended, is_fd=fd, check=True
            )
        )

    def request(self, identifier: int, length: int = 8) -> None:
        self.write(
            can.Message(
                arbitration_id=identifier, dlc=length, is_remote_frame=True, is_extended_id=False
            )
        )

    def receive(self) -> None:
        """Advance the time by a tick, and receive the frames of the drive."""
        self.time += TICK
        self.position += self.velocity * TICK
        frames = self.emulated.emit(self.time)
        if not isinstance(self.device, SerialDevice):
            frames = [f for f in frames if f.arbitration_id in self.device.identifiers()]
        for frame in () if self.deaf else frames:
            self.device.receive(frame, self.time)
        self.device.update(self.time)

    def wait_for(self, condition: Callable[[], object], seconds: float) -> bool:
        end = self.time + seconds
        while not condition():
            if self.time > end:
                return False
            self.receive()
        return True

    def move(self, ticks: int) -> None:
        """Request operation, and then command a velocity."""
        for _ in range(ticks):
            self.receive()
            if self.driver.enable():
                if isinstance(self.driver, ForceDrive):
                    self.driver.command(SPEED * FORCE)
                elif isinstance(self.driver, PositionDrive):
                    self.target += SPEED * TICK
                    self.driver.command(self.target)
                else:
                    self.driver.command(SPEED)
            self.device.transmit()

    def stop(self, seconds: float) -> Iterator[bool]:
        """Stop as the controller does; yield after each tick whether the stop is confirmed."""
        confirmed = False
        for _ in range(round(seconds / TICK)):
            if confirmed:
                self.device.transmit()
            else:
                confirmed = self.driver.idle()
            yield confirmed
            self.receive()


losses = st.one_of(
    st.integers(0, 400).map(lambda n: [True] * n),
    st.lists(st.booleans(), max_size=200),
)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=12, deadline=None)
@given(lost=losses, ticks=st.integers(1, 80), deaf=st.booleans())
@example(lost=[True] * 2, ticks=60, deaf=False)
@example(lost=[True] * 4, ticks=60, deaf=False)
@example(lost=[True] * 100_000, ticks=60, deaf=False)
@example(lost=[True] * 100_000, ticks=60, deaf=True)
def test_a_drive_stands_still_after_a_stop_whichever_frames_to_it_are_lost(kind, lost, ticks, deaf):
    line = Line(kind)
    line.move(ticks)
    line.lost, line.deaf = iter(lost), deaf
    begun = line.time
    for confirmed in line.stop(0.5):
        if line.time - begun > WATCHDOG + SLACK:
            assert line.velocity == 0.0
        if confirmed and not deaf:
            assert line.velocity < SPEED
    if len(lost) < 400 or not deaf:
        assert not line.driven


@pytest.mark.parametrize("kind", KINDS)
def test_a_stop_is_confirmed_by_the_drive_only(kind):
    line = Line(kind)
    line.move(60)
    assert line.velocity == pytest.approx(SPEED, rel=0.05)
    line.deaf = True
    assert not any(line.stop(0.3))
    line.deaf = False
    assert list(line.stop(3 * WATCHDOG))[-1]


@pytest.mark.parametrize("firmware", ["0.5", "0.6"])
def test_until_an_odrive_confirms_the_stop_only_the_request_is_sent_ever_more_rarely(firmware):
    line = Line(f"odrive-{firmware}")
    line.move(60)
    line.sent.clear()
    line.deaf = True
    times = []
    for _ in line.stop(1.0):
        assert not line.device.ping()
        times += [line.time] * len(line.sent[len(times) :])
    stop = {
        identifier(3, Command.SET_AXIS_STATE): set_axis_state(AxisState.IDLE),
        identifier(3, Command.SET_INPUT_VEL): set_input_vel(0.0),
    }
    assert {frame.arbitration_id: bytes(frame.data) for frame in line.sent} == stop
    pauses = [late - early for early, late in zip(times[::2], times[2::2], strict=False)]
    assert pauses[:3] == pytest.approx([5e-3, 10e-3, 20e-3], abs=1.5 * TICK)
    assert pauses[-1] == pytest.approx(2 * WATCHDOG, abs=1.5 * TICK)
