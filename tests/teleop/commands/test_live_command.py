"""Options of the live page, and `teleop live`."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from teleop.cli import main
from teleop.commands import live_options
from teleop.recording.recording import load

from ...forked_command import start_command

RIG = Path(__file__).parents[3] / "rigs" / "serial-board.toml"
WIRED = ("--rig", RIG, "--specimen", "a", "--depth", "3mm", "--yes")


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("live") / "one.mcap"
    arguments = ["run", "--clock", "virtual", "--duration", "0.3", "--record", str(path)]
    assert main(arguments) == 0
    return path


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--operator", "pointer"], "needs --live"),
        (["--open"], "--open: needs --live"),
        (["--live-arm"], "--live-arm: needs --live"),
        (["--foxglove"], "--foxglove: needs --live"),
        (["--live", "--clock", "virtual"], "expected --clock real"),
        (["--live", "--live-arm", "--yes"], "at most one"),
        (["--live", "--operator", "pointer", "--condition", "autonomous"], "free or mimic"),
        (["--live", "--host", "0.0.0.0"], "expected one address"),
        (["--live", "--host", "0"], "host '0': expected one address"),
        (["--live", "--host", "no.such.host.invalid"], "cannot be used"),
        (["--live", "--port", "70000"], "expected 0 to 65535"),
        (["--live", "--host", "192.0.2.1"], "192.0.2.1, port 0: cannot be used"),
        (
            [
                *[
                    "--live",
                    "--operator",
                    "pointer",
                    "--specimen",
                    "a",
                    "--depth",
                    "3mm",
                    "--yes",
                    "--rig",
                ],
                RIG,
            ],
            "expected the simulated rig",
        ),
    ],
)
def test_options_that_contradict_each_other_are_refused(refused, arguments, expected):
    assert expected in refused("run", "--no-record", *arguments)


def test_a_missing_library_is_named(refused, monkeypatch):
    monkeypatch.setattr(live_options, "find_spec", lambda name: None)
    assert "pip install 'telepalpation[live]'" in refused("run", "--no-record", "--live")


def test_a_used_port_is_refused(refused, recording):
    with socket.create_server(("127.0.0.1", 0)) as used:
        port = used.getsockname()[1]
        assert "cannot be used" in refused("live", recording, "--port", port)
        assert "cannot be used" in refused("run", "--no-record", "--live", "--port", port)


def test_a_file_that_is_no_recording_is_refused(refused, tmp_path):
    (tmp_path / "a.mcap").write_bytes(b"no recording")
    assert "a.mcap" in refused("live", tmp_path / "a.mcap")
    assert "b.mcap" in refused("live", tmp_path / "b.mcap")


def test_the_configuration_file_can_request_the_page(refused, tmp_path):
    (tmp_path / "trial.toml").write_text('live = true\nclock = "virtual"\n')
    assert "expected --clock real" in refused("run", "--config", tmp_path / "trial.toml")


@pytest.mark.parametrize("rate", ["fast", None, [1], 0, 1e300])
def test_a_recording_with_an_invalid_rate_in_its_settings_is_shown(recording, monkeypatch, rate):
    changed = load(recording)
    changed.settings["rate_hz"] = rate
    monkeypatch.setattr("teleop.recording.recording.load", lambda file: changed)
    rows = []

    async def show(stopped, replay, host, port, ready):
        replay.request({"type": "seek", "t": 0.3})
        rows.append(replay.history.end)

    monkeypatch.setattr("teleop.live.server.serve", show)
    assert main(["live", str(recording)]) == 0
    assert 50 < rows[0] <= 0.26 * len(changed)  # at most 250 rows per second


@pytest.mark.skipif(not hasattr(signal, "SIGINT") or sys.platform == "win32", reason="needs POSIX")
def test_a_replay_is_served_until_a_signal(recording):
    with start_command("live", recording, stderr=subprocess.PIPE) as process:
        assert "live page: http://127.0.0.1:" in process.stderr.readline()
        process.send_signal(signal.SIGTERM)
        assert process.communicate(timeout=20)[1] == ""
        assert process.returncode == 0


@pytest.mark.parametrize(("host", "warns"), [("127.0.0.1", False), ("192.168.0.7", True)])
def test_an_address_that_other_machines_can_reach_is_a_warning(capsys, host, warns):
    live_options.show_address(f"http://{host}:1/#t=0", host, open_page=False)
    error = capsys.readouterr().err
    assert ("without encryption" in error) is warns
    assert f"http://{host}:1/#t=0" in error
