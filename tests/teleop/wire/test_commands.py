"""`teleop rig` and `teleop run --rig`, in another process than the emulated devices."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
import time
import zipfile
from pathlib import Path
from unittest.mock import Mock

import can
import pytest

from drivers.rig_file import read_rig_file
from drivers.transports.can_bus import CanBus
from sim_backend.wire.emulator import Emulator, host_file
from teleop.cli import main
from teleop.rig.emulation import make_emulator
from teleop.settings.trial_settings import TrialSettings

from ...busy_machine import REPEATS, busy_cause
from ...forked_command import run_command, start_command

RIGS = Path(__file__).parents[3] / "rigs"
BOARD = str(RIGS / "serial-board.toml")
RUN = ("run", "--specimen", "soft", "--depth", "10mm", "--yes", "--rig")
EXAMPLES = ["serial-board", "odrive-bota", "cia402-ft300", "ati-netft"]

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="there are no pseudo-terminals on this system"
)


@contextlib.contextmanager
def served(path, folder):
    """Run an emulator of a rig file in a thread of this process; yield the file for the host."""
    rig = read_rig_file(path)
    settings = TrialSettings(condition="autonomous")
    emulator: Emulator = make_emulator(rig, settings, folder)
    out = folder / "run.toml"
    out.write_text(host_file(emulator))
    stop = threading.Event()
    with emulator:
        thread = threading.Thread(target=emulator.serve, args=(stop.is_set,))
        thread.start()
        try:
            yield out, emulator
        finally:
            stop.set()
            thread.join()


@pytest.mark.real_time
def test_the_check_reports_channels_round_trips_and_watchdogs(tmp_path, undemanding_rig):
    path = undemanding_rig("odrive-bota", tmp_path / "odrive-bota.toml")
    with served(path, tmp_path) as (rig, emulator):
        for _ in range(1 + REPEATS):
            command = ("rig", "check", rig, "--seconds", 0.3, "--duration", 0.5, "--json")
            checked = run_command(*command)
            if not busy_cause(checked.stderr, on_devices=True):
                break
        assert not emulator.mechanism.driven
    assert checked.returncode == 0, checked.stderr
    report = json.loads(checked.stdout)
    channels = {channel["name"]: channel for channel in report["channels"]}
    assert channels.keys() >= {"master_force", "slave_position", "contact_force"}
    assert channels["contact_force"]["noise"] > 0.0
    assert report["round_trip_s"].keys() == {"master", "slave"}
    assert {drive["name"] for drive in report["drives"]} == {"master", "slave"}
    assert all(drive["watchdog_s"] > 0.0 for drive in report["drives"])
    assert all(drive["moved_m"] is None for drive in report["drives"])
    loop = report["loop"]
    assert loop["verdict"] in ("yes", "with delays")
    assert loop["ticks"] + loop["skipped"] == pytest.approx(0.5 * loop["rate_hz"], rel=0.2)
    assert loop["tick_us"]["devices"]["p50"] > 0.0
    assert loop["watchdog_s"] == 0.08  # of the supervisor: those of this rig are longer
    assert loop["margin_s"] == loop["watchdog_s"] - loop["longest_gap_s"]
    assert all(0.0 < load < 1.0 for load in loop["bus_load"].values())


@pytest.mark.real_time
def test_a_report_has_everything_that_the_developers_need(tmp_path, undemanding_rig):
    path = undemanding_rig("odrive-bota", tmp_path / "odrive-bota.toml")
    out = tmp_path / "report.zip"
    short = ("--seconds", 0.3, "--duration", 0.3)
    with served(path, tmp_path) as (rig, _):
        for _ in range(1 + REPEATS):
            done = run_command("rig", "report", rig, "--out", out, *short, "--overwrite")
            if not busy_cause(done.stderr, on_devices=True):
                break
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(out) as archive:
        report = json.loads(archive.read("report.json"))
        assert archive.read("rig.toml").decode() == rig.read_text()
        wire = archive.read("wire.txt").decode().splitlines()
    assert report["error"] == ""
    assert report["software"]["software"].startswith("teleop ")
    assert "python-can" in report["software"]["drivers"]
    assert report["devices"]["master"] == {"firmware": "0.6.10"}
    assert report["check"]["loop"]["ticks"] > 0
    assert {drive["name"] for drive in report["check"]["drives"]} == {"master", "slave"}
    buses = {line.split()[1] for line in wire}
    assert buses == {"can", "handle", "contact"}
    ways = {tuple(line.split()[1:3]) for line in wire}
    assert {("can", ">"), ("can", "<"), ("contact", "<")} <= ways


def test_a_report_about_a_rig_that_cannot_be_opened_states_why(tmp_path, refused):
    out = tmp_path / "report.zip"
    line = refused("rig", "report", BOARD, "--out", out)
    assert "port /dev/ttyACM0 cannot be opened" in line
    assert f"this is in {out}" in line
    with zipfile.ZipFile(out) as archive:
        report = json.loads(archive.read("report.json"))
    assert "port /dev/ttyACM0 cannot be opened" in report["error"]
    assert report["check"] is None
    assert "expected a new file, or --overwrite" in refused("rig", "report", BOARD, "--out", out)
    assert "expected a file ending in .zip" in refused("rig", "report", BOARD, "--out", "a.txt")


def controller(rig):
    """A palpation in another process."""
    return start_command(
        *(*RUN, rig, "--condition", "autonomous", "--no-record", "--realtime", "off"),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )


@pytest.mark.real_time
@pytest.mark.parametrize("name", EXAMPLES)
def test_when_the_controller_is_killed_the_drives_stop_by_their_own_watchdogs(
    name, tmp_path, undemanding_rig
):
    path = undemanding_rig(name, tmp_path / f"{name}.toml")
    with served(path, tmp_path) as (rig, emulator):
        run, repeats = controller(rig), 0
        deadline = time.monotonic() + 40.0
        try:
            while abs(emulator.mechanism.measurement.slave_velocity) < 0.01:
                if run.poll() is not None:
                    _, error = run.communicate()
                    assert busy_cause(error, on_devices=True), error
                    assert (repeats := repeats + 1) <= REPEATS, error
                    run = controller(rig)
                assert time.monotonic() < deadline
                time.sleep(0.01)
            assert emulator.mechanism.driven
        finally:
            run.kill()
            run.communicate()
        deadline = time.monotonic() + 5.0
        while emulator.mechanism.driven:
            assert time.monotonic() < deadline
            time.sleep(0.01)


def test_each_problem_of_a_rig_file_is_reported_on_its_own_line(tmp_path, capsys):
    text = (RIGS / "serial-board.toml").read_text()
    text = text.replace('signal = "force_1"', 'signal = "force_9"')
    text = text.replace("max_velocity_mm_per_s = 200\nmax_acc", "max_speed = 3\nmax_acc")
    path = tmp_path / "wrong.toml"
    path.write_text(text)
    assert main(["run", "--rig", str(path)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    for expected in ("limits.max_speed", "limits.max_velocity_mm_per_s", "force_9"):
        assert sum(expected in line for line in lines) == 1


@pytest.mark.parametrize(
    "arguments",
    [("rig", "check"), ("rig", "tare", "--rig"), (*RUN[:-1], "--no-record", "--rig")],
    ids=" ".join,
)
def test_a_missing_port_is_reported_in_one_line(refused, arguments):
    assert "port /dev/ttyACM0 cannot be opened" in refused(*arguments, BOARD)


@pytest.fixture
def used_bus(tmp_path, monkeypatch):
    """A rig file and a plan, whose CAN bus is used by this process; no adapter is opened."""
    channel = f"bus-of-{os.getpid()}"
    text = (RIGS / "odrive-bota.toml").read_text().replace('"slcan"', '"socketcan"')
    (tmp_path / "rig.toml").write_text(text.replace("/dev/ttyACM0", channel))
    (tmp_path / "plan.toml").write_text(PLAN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(can, "Bus", lambda **options: Mock())
    bus = CanBus("can", time.monotonic, "socketcan", channel, None, {})
    bus.open()
    monkeypatch.setattr(can, "Bus", lambda **options: pytest.fail("the bus was opened"))
    yield
    bus.close()


PLAN = """
name = "one"
factors = { specimen = ["soft"] }
settings = { rig = "rig.toml", depth_m = 0.01 }
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs abstract sockets")
@pytest.mark.parametrize(
    "arguments",
    [
        ("rig", "check", "rig.toml"),
        ("rig", "tare", "--rig", "rig.toml"),
        (*RUN[:-1], "--no-record", "--rig", "rig.toml"),
        ("series", "plan.toml", "--yes"),
    ],
    ids=" ".join,
)
def test_a_bus_that_another_process_uses_is_not_opened(used_bus, refused, arguments):
    assert f"(socketcan) is used by process {os.getpid()} (" in refused(*arguments)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("run", "--rig", BOARD, "--clock", "virtual"), "runs in real time"),
        (("run", "--rig", "nowhere.toml"), "nowhere.toml"),
        (("run", "--depth", "5"), "expected a length with its unit"),
        (("run", "--depth", "5m"), "expected more than 0 and at most 100 mm"),
        (("rig", "check", BOARD, "--seconds", "0"), "expected 0.1 to 3600"),
        (("rig", "check", BOARD, "--duration", "0"), "duration 0 s: expected 0.1 to 3600"),
        (("rig", "emulate", "nowhere.toml"), "nowhere.toml"),
        (("rig", "emulate", BOARD, "--fault", "melt:usb@1"), "KIND:BUS@SECONDS"),
        (("rig", "emulate", BOARD, "--fault", "drop:usb"), "KIND:BUS@SECONDS"),
        (("rig", "emulate", BOARD, "--fault", "drop:nowhere@1"), "expected one of usb"),
        (("rig", "emulate", BOARD, "--fault", "bus-off:usb@1"), "expected one of none"),
        (("rig", "emulate", BOARD, "--fault", "reset:usb@1"), "expected one of board"),
    ],
)
def test_an_impossible_request_is_reported_in_one_line(refused, arguments, expected):
    assert expected in refused(*arguments)


def test_the_ports_of_this_machine_are_listed(capsys):
    assert main(["rig", "list", "--json"]) == 0
    for port in json.loads(capsys.readouterr().out)["ports"]:
        assert port["kind"] in ("serial", "can")
        assert port["name"]
