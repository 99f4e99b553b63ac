"""A reader of a trial in real time that fails, hangs or is killed does not stop the drives."""

from __future__ import annotations

import os
import signal
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import registry
from teleop.cli import main
from teleop.recording.recording import load, load_intact
from teleop.safety import Mode
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.child_process import ChildProcess
from teleop.trial.readers import ReadersInProcesses
from teleop.trial.run import run_trial

from ...busy_machine import REPEATS, busy_cause

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="needs POSIX"),
]
SETTINGS = TrialSettings(condition="autonomous", rate=100.0, duration=1.5, estimators=("rls",))
"""A low rate, so that a busy machine can run the trial."""


@pytest.fixture
def at(monkeypatch):
    """Return a function that acts once on the processes of the readers of each trial.

    It returns the streams of the trials, with the times at which it acted.
    """

    def set_up(t, act):
        after_tick, acted = ReadersInProcesses.after_tick, {}

        def hooked(readers, record):
            if record.t >= t and readers._stream not in acted:
                acted[readers._stream] = record.t
                act(readers._processes)
            after_tick(readers, record)

        monkeypatch.setattr(ReadersInProcesses, "after_tick", hooked)
        return acted

    return set_up


def performed(path, settings=SETTINGS, is_good=lambda trial: not trial.fault):
    """Run a trial, again if the machine was too busy."""
    for _ in range(1 + REPEATS):
        trial = run_trial(settings, path, overwrite=True)
        if is_good(trial):
            break
    assert trial.fault is None
    return trial


def notes(trial):
    return [e["text"] for e in trial.ticks.events if e.get("source") == "estimation"]


def kill(name):
    return lambda processes: os.kill(processes[name].pid, signal.SIGKILL)


def pause(name, seconds):
    def act(processes):
        pid = processes[name].pid
        os.kill(pid, signal.SIGSTOP)
        threading.Timer(seconds, os.kill, (pid, signal.SIGCONT)).start()

    return act


def assert_moved_until_the_end(recording):
    assert recording["time"][-1] > SETTINGS.duration - 0.2
    np.testing.assert_allclose(np.diff(recording["time"]), recording["dt"][1:], atol=1e-9)
    late = recording.where(recording["time"] > 0.7 * SETTINGS.duration)
    assert np.abs(late["commanded_slave_velocity"]).max() > 1e-3
    assert (late["mode"] == Mode.ACTIVE).any()


def test_the_trial_goes_on_if_the_estimation_is_killed(at, tmp_path):
    path = tmp_path / "a.mcap"
    at(0.5, kill("estimation"))
    trial = performed(path)
    assert not trial.interrupted
    assert trial.estimation_failure == "the estimation was killed"
    assert notes(trial) == ["no further estimates: the estimation was killed"]
    assert trial.without_estimates == (
        "the estimates are not complete: the estimation was killed; "
        f"teleop estimate {path} computes them"
    )
    recording = load(path)
    assert_moved_until_the_end(recording)
    known = recording["time"][np.isfinite(recording["rls_k"])]
    assert 0.2 < known[-1] < 0.8
    assert trial.summary()["estimation_failure"] == trial.estimation_failure


def test_a_killed_estimation_is_a_warning_of_the_command_and_the_estimates_can_be_computed(
    at, tmp_path, capsys
):
    path = tmp_path / "a.mcap"
    at(0.5, kill("estimation"))
    command = ["run", "--condition", "autonomous", "--rate", "100", "--duration", "1.5"]
    for _ in range(1 + REPEATS):
        code = main([*command, "--estimators", "rls", "--record", str(path), "--overwrite"])
        err = capsys.readouterr().err
        if not busy_cause(err):
            break
    assert code == 2
    text = f"the estimation was killed; teleop estimate {path} computes them"
    assert err.splitlines()[-1] == f"teleop: the estimates are not complete: {text}"
    table = tmp_path / "a.csv"
    assert main(["estimate", str(path), "--out", str(table)]) == 0
    paired = np.isfinite(load(path)["paired_dt"]).sum()
    assert len(table.read_text().splitlines()) > 0.9 * paired


def test_an_estimation_that_pauses_is_named_and_completes_the_estimates(at, tmp_path, monkeypatch):
    monkeypatch.setattr("teleop.trial.readers.LATE", 0.3)
    path = tmp_path / "a.mcap"
    at(0.3, pause("estimation", 0.8))
    trial = performed(path)
    assert notes(trial) == ["the estimates are more than 0.3 s late"]
    assert not trial.estimation_failure
    recording = load(path)
    assert_moved_until_the_end(recording)
    paired = np.isfinite(recording["paired_dt"])
    np.testing.assert_array_equal(np.isfinite(recording["rls_k"]), paired)


BROKEN = """
from estimation import RecursiveLeastSquares
from estimation.methods.recursive_least_squares import step as rls

def step(parameters, state, phi, f, dt):
    rls(parameters, state, phi, f, dt)
    if f > 2.0:
        raise ZeroDivisionError("by design")

class Broken(RecursiveLeastSquares):
    step = staticmethod(step)

def make(preset):
    return Broken.from_settings(preset)
"""


@pytest.fixture
def broken(tmp_path, monkeypatch, installed):
    """Install an estimator that fails above 2 N, for this process and for others."""
    folder = tmp_path / "site"
    info = folder / "Acme-1.5.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Name: Acme\nVersion: 1.5\n")
    (info / "entry_points.txt").write_text("[teleop.estimators]\nbroken = acme_broken:make\n")
    (folder / "acme_broken.py").write_text(BROKEN)
    known = os.environ.get("PYTHONPATH")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, (str(folder), known))))
    with installed(folder):
        assert "broken" in registry.named_estimators("all")
        yield


@pytest.mark.usefixtures("broken")
@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_an_estimator_that_fails_is_named_and_the_drives_go_on(clock, tmp_path, interpreted):
    path = tmp_path / "a.mcap"
    settings = replace(SETTINGS, clock=clock, estimators=("rls", "broken"))
    trial = performed(path, settings)
    assert trial.estimation_failure == "ZeroDivisionError: by design"
    assert 'raise ZeroDivisionError("by design")' in trial.estimation_traceback
    assert notes(trial) == ["no further estimates: ZeroDivisionError: by design"]
    recording = load(path)
    assert recording["contact_force"].max() > 2.0
    assert_moved_until_the_end(recording)
    assert np.isnan(recording["rls_k"][recording["time"] > 1.0]).all()


def assert_ramped(stream, reason):
    """Check that a trial of a stream ended with a ramp for a reason, and not with a fault."""
    events = [(event["mode"], event["text"]) for event in stream.events]
    assert events[-2:] == [("stopping", reason), ("idle", "at standstill")]
    columns = stream.reader().columns(1, stream.newest + 1)
    speed, dt = columns["commanded_slave_velocity"], columns["dt"]
    most = SETTINGS.limits.max_acceleration * dt[1:] * 1.001
    assert (np.abs(np.diff(speed)) <= most)[columns["mode"][1:] == Mode.STOPPING].all()
    assert speed[-1] == 0.0
    assert columns["time"][-1] < 10.0


LONG = replace(SETTINGS, duration=20.0)


def test_a_killed_recorder_ends_the_trial_with_a_ramp_and_loses_a_tenth_of_a_second(at, tmp_path):
    path = tmp_path / "a.mcap"
    killed = at(0.8, kill("recorder"))

    def is_kept():
        return load_intact(path)["time"][-1] > [*killed.values()][-1] - 0.1

    trial = performed(path, LONG, lambda one: not one.fault and is_kept())
    assert is_kept()
    assert trial.outcome.problem == "the recorder was killed"
    assert_ramped([*killed][-1], f"{path}: the recorder was killed")
    assert main(["recover", str(path)]) == 0


def test_a_signal_while_the_readers_start_ends_the_trial(monkeypatch, tmp_path):
    def interrupted(process, session):
        process.tell(session)  # the answer that it has started is not read
        process._serves = True
        raise KeyboardInterrupt

    monkeypatch.setattr(ChildProcess, "begin", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_trial(SETTINGS, tmp_path / "a.mcap")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_ends_the_trial_with_a_ramp(at):
    streams = at(0.0, lambda processes: None)
    trial = performed(Path("/dev/full"), LONG)
    assert trial.outcome.problem == "no space left on device"
    assert_ramped([*streams][-1], "/dev/full: no space left on device")
    assert len(trial.recording) == [*streams][-1].newest  # those in memory


def limit_files(processes):
    """Let the recorder write no more than 20 kB."""
    resource = pytest.importorskip("resource")
    if not hasattr(resource, "prlimit"):
        pytest.skip("needs prlimit")
    resource.prlimit(processes["recorder"].pid, resource.RLIMIT_FSIZE, (20_000, 20_000))


def test_a_command_whose_recording_fails_ends_with_2_and_names_the_cause(at, tmp_path, capsys):
    path = tmp_path / "a.mcap"
    at(0.3, limit_files)
    command = ["run", "--condition", "autonomous", "--rate", "100", "--duration", "20"]
    for _ in range(1 + REPEATS):
        code = main([*command, "--estimators", "rls", "--record", str(path), "--overwrite"])
        err = capsys.readouterr().err
        if not busy_cause(err):
            break
    assert code == 2
    text = f"teleop: {path}: the recording is not complete: file too large"
    assert err.splitlines()[-1] == text


def test_a_recorder_that_is_stopped_for_a_second_loses_nothing(at, tmp_path):
    path = tmp_path / "a.mcap"
    streams = at(0.2, pause("recorder", 1.0))
    trial = performed(path)
    assert trial.outcome == (path, 0, "", True)
    recording, stream = load(path), [*streams][-1]
    assert_moved_until_the_end(recording)
    assert len(recording) == stream.newest
    assert recording.gaps == ()
    assert [event["text"] for event in recording.events[1:]] == [
        event["text"] for event in stream.events
    ]
    columns = stream.reader().columns(1, stream.newest + 1)
    for name, column in columns.items():
        np.testing.assert_array_equal(recording[name], column, err_msg=name)
