"""Trials on emulated drives over SocketCAN, slow enough for user-mode Linux."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import tomlkit

RIGS = Path(__file__).parents[3] / "rigs"
BUSES = {"odrive-bota": "can", "cia402-ft300": "drives", "moteus": "can"}

pytestmark = pytest.mark.socketcan


def teleop(*arguments):
    return [sys.executable, "-m", "teleop", *map(str, arguments)]


def on_socketcan(name, folder):
    """An example rig on vcan0 at 50 Hz, with long timeouts for a slow guest system.

    There a system call takes 0.1 ms, and controller and emulator share one processor.
    """
    document = tomlkit.parse((RIGS / f"{name}.toml").read_text())
    document["rate_hz"] = 50
    document["limits"]["following_error_mm"] = 20
    document["buses"][BUSES[name]].update({"interface": "socketcan", "channel": "vcan0"})
    if name == "moteus":  # the coupling of its master is not passive at 50 Hz
        for section, part in (("drives", "master"), ("devices", "master"),
                              ("channels", "master_position")):  # fmt: skip
            del document[section][part]
    for channel in document["channels"].values():
        channel["max_age_ms"] = 300
    for device in document["devices"].values():
        if "watchdog_ms" in device:
            device["watchdog_ms"] = 1000
    path = folder / f"{name}.toml"
    path.write_text(tomlkit.dumps(document))
    return path


def trial(rig):
    """Run a short trial, after the emulator has reset the plant."""
    return subprocess.run(
        teleop("run", "--rig", rig, "--condition", "autonomous", "--duration", 4, "--json",
               "--no-record", "--realtime", "off", "--specimen", "soft", "--depth", "10mm",
               "--yes"),
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )  # fmt: skip


@pytest.mark.parametrize("name", BUSES)
def test_a_trial_on_the_kernels_can_estimates_the_cube(name, vcan0, tmp_path):
    rig, out = on_socketcan(name, tmp_path), tmp_path / "run.toml"
    emulator = subprocess.Popen(
        teleop("rig", "emulate", rig, "--condition", "autonomous", "--json", "--out", out),
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        while (line := emulator.stdout.readline()).rstrip() != "}":
            assert line, "the emulator ended"
        for _ in range(4):
            ran = trial(out)
            if ran.returncode != 3:  # stopped for safety: the guest was taken away: once more
                break
    finally:
        emulator.send_signal(signal.SIGTERM)
        emulator.communicate(timeout=20)
    assert ran.returncode == 0, ran.stderr
    estimates = json.loads(ran.stdout)["estimates"]
    assert estimates["rls"]["k"] == pytest.approx(2000.0, rel=0.1)
