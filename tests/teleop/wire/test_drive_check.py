"""The check of the drives detects a wrong sign or scale before the true slave moves far.

Travel and force are those of the simulated plant, not the measurements of the rig.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import signal
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
import tomlkit

from drivers import NotStoppedError
from sim_backend import RIGID, paper_setup
from sim_backend.wire.emulator import Emulator, PlannedFault
from teleop.cli import main
from teleop.control.clock import VirtualClock
from teleop.errors import InputError
from teleop.rig.drive_check import STROKES, check_drives
from teleop.safety import Fault, Limits
from teleop.safety.rig_limits import rig_limits
from teleop.trial.loop_verdict import LoopTiming, verdict_of
from teleop.trial.other_programs import NOT_KNOWN
from teleop.trial.realtime import RealTime

RIGS = ["serial-board", "odrive-bota", "cia402-ft300"]


def rewritten(*path: str, **values: Any) -> Callable[[str], str]:
    """Change a section of a rig file."""

    def rewrite(text: str) -> str:
        document: Any = tomlkit.parse(text)
        section = document
        for name in path:
            section = section[name]
        section.update(values)
        return tomlkit.dumps(document)

    return rewrite


def encoder_reads(factor: float, axis: str = "slave") -> dict[str, Any]:
    """Return a rig file whose encoder shows a multiple of the travel."""
    sign = -1 if factor < 0.0 else 1
    return {"rewrite": rewritten("channels", f"{axis}_position", scale=abs(factor), sign=sign)}


def drive_goes(factor: float, axis: str = "slave") -> dict[str, Any]:
    """Make a drive move at a multiple of the commanded velocity."""

    def prepare(emulator: Emulator) -> None:
        drive = emulator.mechanism.drive

        def wrong(name: str, velocity: float) -> None:
            drive(name, factor * velocity if name == axis else velocity)

        emulator.mechanism.drive = wrong

    return {"prepare": prepare}


class Checked:
    """The check of an emulated rig, and the largest true displacement [m] and force [N]."""

    def __init__(self, trial: Any, move: bool = True) -> None:
        self.travel = self.force = 0.0
        clock = VirtualClock(trial.settings.loop_rate)
        with contextlib.suppress(NotStoppedError), trial.make_rig(clock.now) as rig:
            self.limits = rig_limits(rig.file.sections)
            step = rig.emulator.step

            def watched(wires: Any = None) -> None:
                step(wires)
                slave = rig.emulator.mechanism.rig.plant.slave
                self.travel = max(self.travel, abs(slave.x))
                self.force = max(self.force, abs(slave.force))

            rig.emulator.step = watched
            self.report = check_drives(rig, clock, move)
            for _ in range(30):
                clock.wait()
                rig.read()
            self.driven = set(rig.emulator.mechanism.driven)
        self.problems = {drive.name: drive.problem for drive in self.report.drives}

    def stayed_small(self) -> bool:
        return self.travel < 1e-3 and self.force < 0.1 * self.limits.hard_force


def check_refused(checked: Checked, factor: float, axis: str = "slave") -> None:
    assert checked.stayed_small(), (checked.travel, checked.force)
    assert checked.report.fault is None
    assert not checked.driven
    problem = checked.problems[axis]
    assert problem.startswith("commanded ")
    assert f"{axis}_position shows" in problem
    assert f"check the {'sign' if factor < 0.0 else 'scale'} of drives.{axis}" in problem
    assert "\n" not in problem


@pytest.fixture
def in_memory(in_memory: Callable[..., Any]) -> Callable[..., Any]:
    """Makes a trial on lines in memory at a low rate, at which a drive goes further in a tick."""
    return partial(in_memory, rate=250.0)


@pytest.fixture
def stepped(stepped: Callable[..., Any]) -> Callable[..., Any]:
    """Makes a trial on pseudo-terminals at the same rate."""
    return partial(stepped, rate=250.0)


@pytest.fixture
def quick_strokes(monkeypatch):
    """Makes all strokes quicker, where no drive moves too fast."""
    monkeypatch.setattr("teleop.rig.drive_check.STROKE_TIMES", (0.2,) * len(STROKES))


@pytest.mark.parametrize(
    ("name", "factor", "wrong"),
    [
        *((RIGS[0], factor, drive_goes) for factor in (20.0, 0.5, -1.0)),
        *((RIGS[0], factor, encoder_reads) for factor in (20.0, 2.0, -1.0)),
        *((name, 2.0, drive_goes) for name in RIGS[1:]),
    ],
)
def test_a_wrong_sign_or_scale_is_refused_before_the_slave_gets_far(in_memory, name, factor, wrong):
    checked = Checked(in_memory(name, **wrong(factor)))
    check_refused(checked, factor)
    assert checked.travel < 0.4e-3


@pytest.mark.parametrize("name", RIGS[:1])
@pytest.mark.parametrize(("factor", "wrong"), [(20.0, drive_goes), (-1.0, encoder_reads)])
def test_a_wrong_sign_or_scale_of_the_master_is_refused_too(in_memory, name, factor, wrong):
    check_refused(Checked(in_memory(name, **wrong(factor, "master"))), factor, "master")


LOW = rewritten(
    "limits",
    soft_position_mm=[-2.5, 2.5],
    hard_position_mm=[-3, 3],
    soft_force_n=4,
    hard_force_n=5,
)


@pytest.mark.parametrize(
    ("name", "cube", "factor"),
    [
        *((RIGS[0], "hard", factor) for factor in (20.0, 5.0, -1.0)),
        (RIGS[0], "medium", 20.0),
        *((RIGS[0], "soft", factor) for factor in (2.0, -1.0)),
        *((name, "hard", 20.0) for name in RIGS[1:]),
    ],
)
def test_a_tenth_of_a_low_force_limit_is_not_exceeded(in_memory, name, cube, factor):
    checked = Checked(in_memory(name, cube=cube, rewrite=LOW, **drive_goes(factor)))
    assert checked.stayed_small(), (checked.travel, checked.force)
    assert checked.report.fault or checked.problems["slave"]
    assert not checked.driven


def test_a_scale_that_drive_and_velocity_channel_share_is_refused(in_memory):
    shared = rewritten("devices", "board", velocity_um_per_s_per_count=[1.0, 0.05])
    check_refused(Checked(in_memory("serial-board", rewrite=shared)), 20.0)


@pytest.mark.parametrize(
    ("name", "values"),
    [(RIGS[0], {"scale": 2.0}), *((name, {"sign": -1}) for name in RIGS)],
    ids=["scale", *RIGS],
)
def test_a_wrong_sign_or_scale_of_the_velocity_channel_alone_is_refused(in_memory, name, values):
    checked = Checked(in_memory(name, rewrite=rewritten("channels", "slave_velocity", **values)))
    assert checked.stayed_small()
    assert "slave_velocity shows" in checked.problems["slave"]


@pytest.mark.usefixtures("quick_strokes")
@pytest.mark.parametrize("name", RIGS)
def test_a_sound_rig_passes_and_its_watchdogs_act(in_memory, name):
    rigid = replace(paper_setup("injector", "soft"), transmission=RIGID)
    checked = Checked(in_memory(name, custom_setup=rigid))
    assert checked.stayed_small()
    assert checked.report.fault is None
    assert not checked.driven
    assert set(checked.problems.values()) == {""}
    for drive in checked.report.drives:
        assert drive.commanded_m == pytest.approx(STROKES[-1], rel=0.05)
        assert drive.moved_m == pytest.approx(drive.commanded_m, abs=10e-6)
        assert drive.ratio == pytest.approx(1.0, abs=0.025)
        assert drive.remark == ""
        assert 0.01 < drive.watchdog_s < 0.15


@pytest.mark.parametrize("name", RIGS)
def test_without_a_motion_the_watchdogs_are_checked_at_standstill(in_memory, name):
    checked = Checked(in_memory(name), move=False)
    assert checked.travel < 2e-6
    assert set(checked.problems.values()) == {""}
    for drive in checked.report.drives:
        assert math.isnan(drive.commanded_m)
        assert 0.01 < drive.watchdog_s < 0.15


@pytest.mark.usefixtures("quick_strokes")
def test_a_slave_held_by_its_limits_fails_the_check(in_memory):
    checked = Checked(in_memory("serial-board", rewrite=LOW))
    assert checked.stayed_small()
    assert "expected a slave that is free to move" in checked.problems["slave"]


def test_a_slave_beyond_its_hard_limits_is_refused(in_memory):
    beyond = rewritten("limits", soft_position_mm=[5, 25], hard_position_mm=[1, 30])
    with pytest.raises(InputError, match="slave_position is -?0 mm: expected it within hard_pos"):
        Checked(in_memory("serial-board", rewrite=beyond))


@pytest.mark.usefixtures("quick_strokes")
def test_near_the_end_of_its_range_the_slave_first_moves_away_from_it(in_memory):
    near = rewritten("limits", soft_position_mm=[0.2, 25], hard_position_mm=[-0.1, 30])
    checked = Checked(in_memory("serial-board", rewrite=near))
    assert set(checked.problems.values()) == {""}
    assert checked.report.fault is None


def test_the_boards_emergency_stop_stops_the_check(in_memory):
    def prepare(emulator: Emulator) -> None:
        step = emulator.step

        def press(wires: Any = None) -> None:
            emulator.devices["board"].emergency_stop = bool(emulator.mechanism.driven)
            step(wires)

        emulator.step = press

    checked = Checked(in_memory("serial-board", prepare=prepare))
    assert checked.report.fault["fault"] == Fault.EMERGENCY_STOP
    assert checked.travel < 2e-6
    assert not checked.driven


@pytest.mark.parametrize("at", [0.1, 0.25, 0.6, 3.0])
def test_a_wire_that_fails_during_the_check_is_a_stop_for_safety(in_memory, at):
    faults = [PlannedFault("silence", "usb", at)]
    checked = Checked(in_memory("serial-board", faults=faults))
    assert checked.stayed_small()
    assert checked.report.fault["fault"] == Fault.STALE
    assert not checked.driven


CALM = np.zeros(1000)
PUNCTUAL = verdict_of(
    LoopTiming.of_ticks(1000.0, CALM, CALM, CALM + 1e-4, CALM[:0], NOT_KNOWN), Limits()
)


@pytest.fixture
def command(monkeypatch):
    """Runs `teleop rig check --move` on an emulated rig in virtual time."""

    def run(trial: Any, *options: str) -> int:
        monkeypatch.setattr("teleop.control.clock.RealClock", VirtualClock)
        monkeypatch.setattr("drivers.wired_rig.WiredRig", lambda file, now: trial.make_rig(now))
        monkeypatch.setattr("teleop.trial.realtime.realtime", lambda mode: RealTime("off", ()))
        monkeypatch.setattr("teleop.rig.whole_check.round_trips", lambda rig, clock: [])
        # the emulated devices run in this process, and would be a part of each tick
        monkeypatch.setattr("teleop.rig.whole_check.check_loop", lambda rig, seconds: PUNCTUAL)
        path = str(trial.file.path)
        return main(["rig", "check", path, "--seconds", "0.2", "--move", "--yes", *options])

    return run


@pytest.mark.parametrize(
    ("settings", "code", "words"),
    [
        (drive_goes(-1.0), 2, "check the sign of drives.slave and of channels.slave_position"),
        ({"faults": [PlannedFault("silence", "usb", 0.3)]}, 3, "stopped at 0.3"),
    ],
    ids=["wrong sign", "silent wire"],
)
def test_a_problem_or_a_safety_stop_ends_the_command_with_its_exit_code_and_one_line(
    command, stepped, capsys, settings, code, words
):
    assert command(stepped("serial-board", **settings), "--json") == code
    out, err = capsys.readouterr()
    assert err.count("\n") == 1
    assert words in err
    assert len(json.loads(out)["drives"]) == 2


def test_the_drives_stay_idle_while_a_channel_has_a_problem(command, stepped, capsys):
    beyond = rewritten("channels", "contact_force", range_n=[100.0, 200.0])
    emulators: list[Emulator] = []
    made = stepped("serial-board", prepare=emulators.append, rewrite=beyond)
    assert command(made) == 2
    assert "contact_force: " in capsys.readouterr().err
    assert not math.isfinite(emulators[0]._started)


def test_ctrl_c_during_the_check_ends_it_with_130(command, stepped, capsys):
    def prepare(emulator: Emulator) -> None:
        step, driven = emulator.step, itertools.count()

        def interrupt(wires: Any = None) -> None:
            if emulator.mechanism.driven and next(driven) == 400:
                signal.raise_signal(signal.SIGINT)
            step(wires)

        emulator.step = interrupt

    assert command(stepped("serial-board", prepare=prepare), "--json") == 130
    out, err = capsys.readouterr()
    assert err == ""
    assert all(drive["commanded_m"] is None for drive in json.loads(out)["drives"])


@pytest.mark.usefixtures("quick_strokes")
def test_lost_motion_of_the_emulated_slave_is_remarked_and_is_no_problem(
    command, in_memory, capsys
):
    assert command(in_memory("serial-board"), "--json") == 0
    out, err = capsys.readouterr()
    assert err == ""
    master, slave = json.loads(out)["drives"]
    assert master["remark"] == ""
    assert slave["problem"] == ""
    assert slave["moved_m"] / slave["commanded_m"] < 0.9
    assert slave["ratio"] == pytest.approx(0.81, abs=0.02)
    assert "moved 81% of the commanded travel" in slave["remark"]
    assert "lost motion or friction" in slave["remark"]


@pytest.mark.usefixtures("quick_strokes")
def test_the_tables_of_the_check_fit_80_columns_and_have_units(
    command, in_memory, capsys, monkeypatch
):
    monkeypatch.setenv("COLUMNS", "80")
    assert command(in_memory("odrive-bota")) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    text = " ".join(" ".join(lines).split())
    units = ("rate jitter age oldest", "[Hz] [ms] [ms] [ms]", "0.000 mm/s", " N ")
    for part in (*units, "lost motion"):
        assert part in text
