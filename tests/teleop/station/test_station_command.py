"""`teleop station` in two processes on one computer, in real time."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from teleop.cli import main
from teleop.control.admittance import AdmittanceParameters
from teleop.control.clock import RealClock
from teleop.control.feedback.settings import FeedbackSettings
from teleop.errors import InputError
from teleop.recording.recording import load
from teleop.safety import Mode
from teleop.settings.feedback_checks import check_feedback
from teleop.settings.trial_settings import TrialSettings
from teleop.station import connection
from teleop.station.address import parse_address
from teleop.station.agreement import longest_round_trip
from teleop.station.connection import connect, listen
from teleop.station.keys import read_key
from teleop.station.station_port import StationPort
from teleop.trial.station_waiting import Waiting

from ...busy_machine import REPEATS, busy_cause
from ...forked_command import run_command, start_command
from .proxy import Proxy

RATE = "200"


@pytest.fixture
def key(tmp_path):
    path = tmp_path / "station.key"
    assert main(["station", "key", str(path)]) == 0
    return path


class Stations:
    """Both stations in processes, connected by a proxy."""

    def __init__(self, folder, key, *options, duration=2.0, **network):
        self.paths = {side: folder / f"{side}.mcap" for side in ("master", "slave")}
        for path in self.paths.values():
            path.unlink(missing_ok=True)
        free = StationPort(parse_address("127.0.0.1:47991"), listens=False)
        free.send(b"", ("127.0.0.1", 9))
        port = free.place[1]
        free.__exit__(None, None, None)
        self.proxy = Proxy(port, **network)
        self.key, self.options = key, options
        self.slave = self._start("slave", "--listen", f"127.0.0.1:{port}")
        assert "waits for the master" in self.slave.stderr.readline()
        self.master = self._start(
            "master", "--connect", self.proxy.address, "--duration", str(duration)
        )

    def _start(self, side, *arguments):
        return start_command(
            "station", side, *arguments, "--key", self.key, "--rate", RATE, "--json",
            "--record", self.paths[side], "--estimators", "rls", *self.options,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )  # fmt: skip

    def wait_active(self):
        """Wait until the master has been active for 0.5 s; return False if it never was."""
        end = time.monotonic() + 60.0
        while self.proxy.active["master"] < 0.5 * float(RATE):
            if time.monotonic() > end or None not in (self.master.poll(), self.slave.poll()):
                return False
            time.sleep(0.01)
        return True

    def __enter__(self):
        self.proxy.__enter__()
        return self

    def __exit__(self, *_):
        for process in (self.master, self.slave):
            process.kill()
            process.communicate()
        self.proxy.__exit__()

    def results(self):
        """Return exit code, document and standard error of both."""
        found = {}
        for side in ("master", "slave"):
            process = getattr(self, side)
            out, error = process.communicate(timeout=90)
            document = json.loads(out) if out else None
            found[side] = (process.returncode, document, error)
        return found


def repeated(run, lost=""):
    """Run until the machine was not too busy; return the result.

    The station that is `lost` is not judged: it overruns when it continues after SIGSTOP.
    """
    for _ in range(1 + REPEATS):
        found = run()
        if not any(busy_cause(found[side][2]) for side in found if side != lost):
            return found
    pytest.skip("the machine is too busy for two stations in real time")


@pytest.mark.real_time
def test_both_stations_run_and_their_recordings_become_one(tmp_path, key, capsys):
    network = {"delay": 0.01, "jitter": 0.005, "loss": 0.05, "doubled": 0.1, "replayed": 5}

    def run():
        with Stations(tmp_path, key, "--feedback", "model-mediated", **network) as stations:
            return stations.results()

    found = repeated(run)
    for side, (code, document, error) in found.items():
        assert code == 0, error
        assert document["station"]["side"] == side
        assert 0.02 < document["station"]["round_trip_s"] < 0.1
        assert document["station"]["rejected"] > 4 * document["station"]["lost"] > 0
    result = found["slave"][1]["result"]
    assert result["k"] is not None
    out = tmp_path / "both.mcap"
    capsys.readouterr()
    paths = [str(tmp_path / "master.mcap"), str(tmp_path / "slave.mcap")]
    assert main(["merge", *paths, "--out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["offset_error_s"] < 0.02
    assert main(["estimate", str(out), "--json"]) == 0
    merged = json.loads(capsys.readouterr().out)
    assert merged["result"]["k"] == pytest.approx(result["k"])


@pytest.mark.real_time
@pytest.mark.parametrize("cause", ["kill", "stop"])
def test_the_slave_stops_when_the_master_is_lost(tmp_path, key, cause):
    def run():
        with Stations(tmp_path, key, duration=20.0, delay=0.005) as stations:
            if not stations.wait_active():
                stations.master.kill()
                stations.slave.kill()
                return stations.results()
            number = signal.SIGKILL if cause == "kill" else signal.SIGSTOP
            os.kill(stations.master.pid, number)
            code = stations.slave.wait(60)
            if cause == "stop":
                os.kill(stations.master.pid, signal.SIGCONT)
            assert code in (2, 3)
            return stations.results()

    found = repeated(run, lost="master")
    code, _, error = found["slave"]
    assert code == 3, error
    assert "communication channel: silent" in error
    recording = load(tmp_path / "slave.mcap")
    active = np.flatnonzero(recording["mode"] == Mode.ACTIVE)
    assert not np.any(recording["commanded_slave_velocity"][active[-1] + 10 :])
    if cause != "kill":
        assert found["master"][0] == 3
    assert len(load(tmp_path / "master.mcap")) > 50  # whatever happened to its process


@pytest.mark.real_time
def test_the_slave_of_the_documentation_runs_from_python(tmp_path, key):
    page = Path(__file__).parents[3] / "docs" / "stations.md"
    code = re.search(r"```python\n(.*?)```", page.read_text(), re.DOTALL)[1]
    code = code.replace("TrialSettings(", f"TrialSettings(rate={RATE}.0, estimators=('rls',), ")

    def run():
        (tmp_path / "slave.mcap").unlink(missing_ok=True)
        slave = subprocess.Popen(
            [sys.executable, "-c", code], cwd=tmp_path, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert "waits for the master" in slave.stdout.readline()
        master = run_command(
            "station", "master", "--connect", "127.0.0.1", "--key", key, "--rate", RATE,
            "--duration", "2", "--no-record", timeout=90,
        )  # fmt: skip
        out, error = slave.communicate(timeout=60)
        return {"master": (0, None, master.stderr), "slave": (slave.returncode, out, error)}

    code_of, out, error = repeated(run)["slave"]
    assert code_of == 0, error
    assert "'k': " in out


# Handshake


@pytest.fixture
def ports():
    with (
        StationPort(parse_address("127.0.0.1:47992"), True) as slave,
        StationPort(parse_address("127.0.0.1:47992"), False) as master,
    ):
        yield master, slave


DOCUMENT = {
    "settings": {"feedback.law": "none"},
    "longest_round_trip": None,
    "rig": "simulated",
    "duration": 1.0,
}


def test_a_session_begins_and_the_shorter_round_trip_is_that_of_both(ports, key):
    master, slave = ports
    secret, found = read_key(key), []
    strict = DOCUMENT | {"longest_round_trip": 0.02}
    waiting = threading.Thread(
        target=lambda: found.append(listen(slave, secret, strict, lambda text: None))
    )
    waiting.start()
    connected = connect(master, secret, DOCUMENT, lambda text: None)
    waiting.join(10.0)
    assert connected.session.number == found[0].session.number
    assert connected.longest == found[0].longest == 0.02
    assert connected.others["longest_round_trip"] == 0.02


def test_different_settings_begin_no_session_and_the_slave_waits_on(ports, key):
    master, slave = ports
    secret, shown, found = read_key(key), [], []
    waiting = threading.Thread(
        target=lambda: found.append(listen(slave, secret, DOCUMENT, shown.append))
    )
    waiting.start()
    other = DOCUMENT | {"settings": {"feedback.law": "model-mediated"}}
    with pytest.raises(InputError, match=r"law: here model-mediated, at the other station none"):
        connect(master, secret, other, lambda text: None)
    assert not found
    connect(master, secret, DOCUMENT, lambda text: None)
    waiting.join(10.0)
    assert found
    assert "refused the master" in shown[1]


def test_a_master_without_an_answer_ends_with_a_reason(ports, key, monkeypatch, capsys):
    monkeypatch.setattr(connection, "CONNECTING", 0.2)
    command = ["station", "master", "--connect", "127.0.0.1:47993", "--key", str(key)]
    assert main(command) == 2
    assert "no answer from 127.0.0.1:47993" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--clock", "virtual"], "two stations run in real time"),
        (["--channel", "delay=1ms"], "simulated within one computer"),
        (["--protocol", "creep"], "not with a protocol"),
        (["--max-silence", "2"], "max_silence must be more than 0"),
    ],
)
def test_options_that_two_stations_cannot_have_are_refused(key, capsys, options, message):
    command = ["station", "master", "--connect", "127.0.0.1", "--key", str(key), *options]
    assert main(command) == 2
    assert message in capsys.readouterr().err


def test_the_longest_round_trip_is_that_of_the_check_of_the_law():
    settings = TrialSettings(clock="virtual")
    assert longest_round_trip(settings) == float("inf")
    stable = TrialSettings(
        feedback=FeedbackSettings("position-force"), admittance=AdmittanceParameters(damping=100.0)
    )
    longest = longest_round_trip(stable)
    assert 1e-3 < longest < 0.1
    check_feedback(stable, 0.99 * longest)
    with pytest.raises(InputError, match="unstable|oscillate"):
        check_feedback(stable, 1.01 * longest + 1e-3)


def test_a_station_that_ends_before_its_loop_tells_the_other_one(ports, key):
    master, slave = ports
    secret, found = read_key(key), []
    waiting = threading.Thread(
        target=lambda: found.append(listen(slave, secret, DOCUMENT, lambda text: None))
    )
    waiting.start()
    with Waiting(connect(master, secret, DOCUMENT, lambda text: None)):
        waiting.join(10.0)
    station = found[0].begin(RealClock(1.0))
    station.read(True, False)
    assert "the master station ended before the drives were armed" in station.reason
