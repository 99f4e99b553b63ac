"""Trials from Python: in this process, and in another one with live samples and a stop."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import numpy as np
import pytest

import teleop
from teleop import rig_session
from teleop.control.conditions import Condition

RIG = "rigs/serial-board.toml"
SLOW = {"rate": 250.0, "estimators": ("rls",), "realtime": "off"}


class Push(Condition):
    """A condition that is defined in a notebook."""

    moved_by = "injector"

    def drive_force(self, t, measurement):
        return 1.0


def test_the_names_that_users_need_come_from_the_package():
    assert set(teleop.NAMES) <= set(dir(teleop))
    for name in teleop.NAMES:
        assert getattr(teleop, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'Rigg'"):
        teleop.Rigg  # noqa: B018


def test_a_trial_runs_with_a_name_an_object_and_a_protocol():
    rig = teleop.Rig()
    by_name = rig.run("autonomous", clock="virtual", duration=0.5, estimators=("rls",))
    assert by_name.settings.condition == "autonomous"
    own = rig.run(Push(), clock="virtual", duration=0.5, estimators=("rls",))
    assert own.summary()["condition"] == "Push"
    assert own.recording["drive_force"].max() == 1.0
    settings = rig.settings(protocol="creep")
    assert settings.duration == settings.protocol.longest


def test_a_hardware_rig_takes_its_rate_from_the_file_and_is_armed_by_a_person_only(tmp_path):
    rig = teleop.Rig.load(RIG)
    named = {"specimen": "liver", "depth": 3e-3}
    assert rig.settings("autonomous", **named).loop_rate == 1000.0
    with pytest.raises(teleop.InputError, match="nobody has armed the drives"):
        rig.run("autonomous", **named)
    asked = []
    with pytest.raises(teleop.InputError, match="not armed: nothing was moved"):
        rig.start("autonomous", arm=lambda text: asked.append(text), **named)
    assert "depth 3 mm" in asked[0]
    with pytest.raises(teleop.InputError, match="nobody has armed the drives"):
        rig.start("autonomous", arm=True, **named)


def test_an_object_is_not_sent_to_another_process():
    with pytest.raises(teleop.InputError, match="condition Push: an object is not sent"):
        teleop.Rig().start(Push())


@pytest.mark.parametrize(("typed", "armed"), [("arm", True), ("", False), ("yes", False)])
def test_only_the_word_arm_arms(monkeypatch, typed, armed):
    monkeypatch.setattr("builtins.input", lambda text: typed)
    assert teleop.ask("depth 3 mm") is armed


@pytest.mark.real_time
def test_a_slow_function_misses_samples_and_does_not_delay_the_loop(tmp_path):
    trial = teleop.Rig().start("autonomous", record=tmp_path / "a.mcap", duration=1.5, **SLOW)
    seen = []

    def slow(samples):
        seen.append(samples["time"][-1])
        time.sleep(0.4)

    trial.on_samples(slow, 0.05)
    finished = trial.wait(60.0)
    assert len(finished.recording) > 300
    assert finished.recording["skipped"].sum() < 0.2 * len(finished.recording)
    assert 1 <= len(seen) <= 6
    assert finished.result["k"] == pytest.approx(2160.0, rel=0.05)
    assert np.diff(finished.recording["time"]).min() > 0.0


@pytest.mark.real_time
def test_stop_ends_the_trial_with_a_commanded_stop(tmp_path):
    trial = teleop.Rig().start("autonomous", record=tmp_path / "b.mcap", duration=60.0, **SLOW)
    deadline = time.monotonic() + 30.0
    while not len(trial.samples(0.2)["time"]) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert trial.is_running
    assert "running" in repr(trial)
    trial.stop()
    finished = trial.wait(30.0)
    assert finished.summary["interrupted"]
    velocity = finished.recording["slave_velocity"]
    assert abs(velocity[-1]) < 2e-3
    assert not trial.is_running


SCRIPT = """
import signal, sys, time
import teleop

if __name__ == "__main__":
    if "--ignore" in sys.argv:  # as in the background of a shell
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    trial = teleop.Rig().start(
        "autonomous", record="a.mcap", duration=60.0, rate=100.0, estimators=("rls",),
        realtime="off",
    )
    while not len(trial.samples(0.2)["time"]):
        time.sleep(0.05)
    print(trial._process.pid, flush=True)
    if "--stay" in sys.argv:
        time.sleep(60.0)
"""
"""A script that starts a trial, and ends or is killed while the trial runs."""


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    """Two scripts that run, by their option, with their folders."""
    running = {}
    for option in ("--stay", "--ignore"):
        folder = tmp_path_factory.mktemp("script")
        (folder / "script.py").write_text(SCRIPT)
        command = [sys.executable, "script.py", option]
        process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
        running[option] = process, folder
    yield running
    for process, _ in running.values():
        process.kill()
        process.stdout.close()
        process.wait()


@pytest.mark.real_time
@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills a process by a signal")
def test_the_drives_stop_if_the_kernel_is_killed(scripts):
    kernel, folder = scripts["--stay"]
    child = int(kernel.stdout.readline())
    kernel.kill()
    kernel.communicate()
    deadline = time.monotonic() + 30.0
    while time.monotonic() < deadline:
        try:
            os.kill(child, 0)
        except ProcessLookupError:
            break
        time.sleep(0.02)
    else:
        pytest.fail("the process of the trial runs on")
    recording = teleop.load(folder / "a.mcap")
    assert recording["time"][-1] < 50.0
    assert abs(recording["slave_velocity"][-1]) < 2e-3


@pytest.mark.real_time
def test_the_drives_stop_at_the_end_of_a_script_that_ignores_interrupts(scripts):
    script, folder = scripts["--ignore"]
    script.communicate(timeout=40.0)
    assert script.returncode == 0
    assert teleop.load(folder / "a.mcap")["time"][-1] < 30.0


def test_an_error_in_the_process_of_the_trial_is_raised_by_wait(tmp_path, monkeypatch):
    (tmp_path / "there.mcap").write_text("exists")
    trial = teleop.Rig().start(
        "autonomous", record=tmp_path / "there.mcap", clock="virtual", duration=0.2
    )
    with pytest.raises(teleop.InputError, match="there.mcap: recording failed: file exists"):
        trial.wait(60.0)


def test_a_notebook_shows_a_text_without_ipywidgets(monkeypatch, capsys):
    class Display:
        display = staticmethod(print)

    def imported(name):
        if name == "ipywidgets":
            raise ImportError(name)
        return Display

    monkeypatch.setattr(rig_session, "import_module", imported)
    rig_session.show_with_button("<trial>")
    assert "stop() stops the drives" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("condition", "options", "expected"),
    [
        (Push, {}, "expected the name of a condition"),
        (3, {}, "expected the name of a condition"),
        ("free", {"parameters": {"limit": 1.0}}, "expected the name of a condition of another"),
    ],
)
def test_what_is_no_condition_is_refused(condition, options, expected):
    with pytest.raises(teleop.InputError, match=expected):
        teleop.Rig().run(condition, clock="virtual", duration=0.2, **options)


def test_a_method_in_place_of_an_attribute_is_refused():
    class Ends(Push):
        def finished(self):
            return False

    with pytest.raises(teleop.InputError, match="finished is a method"):
        teleop.Rig().run(Ends(), clock="virtual", duration=0.2)
