"""Results of a run: its recording, its plot and its exit code."""

from __future__ import annotations

import json

import pytest

from drivers import RigError
from sim_backend import SimulatedRig
from sim_backend.faults import FaultyRig, Replaced
from teleop.cli import main
from teleop.recording.recorder import Recorder
from teleop.recording.recording import load
from teleop.safety import Request
from teleop.streams.stream import Stream

RUN = ["run", "--clock", "virtual", "--duration", "1"]


@pytest.fixture
def at_tick(monkeypatch):
    """Calls a function before a tick is written."""

    def call(number, function):
        write = Stream.write

        def written(stream, record):
            if stream.newest == number:
                function()
            write(stream, record)

        monkeypatch.setattr(Stream, "write", written)

    return call


@pytest.fixture
def fault(monkeypatch, undrawn):
    """Makes the slave's position infinite after half a second; the report has no figure."""

    def make(cube, now, **options):
        rig = FaultyRig(SimulatedRig(cube, now, **options))
        read = rig.rig.read

        def late():
            if now() >= 0.5:
                rig.inject(Replaced("slave_position", float("inf")))
            return read()

        rig.rig.read = late
        return rig

    monkeypatch.setattr("teleop.trial.assembly.SimulatedRig", make)


def test_a_run_that_is_refused_leaves_no_recording(refused, tmp_path):
    path = tmp_path / "a.mcap"
    assert "a tick takes" in refused("run", "--rate", "100000", "--record", path)
    assert not path.exists()
    assert main([*RUN, "--record", str(path)]) == 0
    assert len(load(path)) > 1000


def test_a_rig_that_does_not_answer_leaves_no_recording(refused, tmp_path, monkeypatch):
    def silent(*arguments, **options):
        raise RigError("no answer")

    monkeypatch.setattr("teleop.trial.assembly.SimulatedRig", silent)
    assert "no answer" in refused(*RUN, "--record", tmp_path / "a.mcap")
    assert not (tmp_path / "a.mcap").exists()


def test_a_rig_that_cannot_be_closed_after_a_fault_does_not_hide_the_fault(
    fault, monkeypatch, tmp_path, capsys
):
    def closed(rig):
        raise RigError("the port is gone")

    monkeypatch.setattr(FaultyRig, "close", closed, raising=False)
    path = tmp_path / "a.mcap"
    assert main([*RUN, "--record", str(path)]) == 3
    assert "slave position" in capsys.readouterr().err
    assert load(path).fault


def test_the_folder_of_a_recording_is_created(tmp_path):
    path = tmp_path / "new" / "day" / "a.mcap"
    assert main([*RUN, "--record", str(path)]) == 0
    assert len(load(path)) > 1000


def test_a_recording_that_was_removed_is_not_reported_complete(tmp_path, capsys, at_tick):
    path = tmp_path / "a.mcap"
    at_tick(500, path.unlink)
    assert main([*RUN, "--record", str(path)]) == 2
    out, err = capsys.readouterr()
    problem = "the recording is not complete: the file was removed during the run"
    assert err.splitlines()[-1] == f"teleop: {path}: {problem}"
    assert problem in out
    assert "teleop recover" not in out


def test_a_file_that_replaced_the_recording_is_not_summarised(tmp_path, capsys, at_tick):
    path, other = tmp_path / "a.mcap", tmp_path / "b.mcap"
    assert main([*RUN[:-1], "2", "--cube", "hard", "--record", str(other)]) == 0
    capsys.readouterr()
    at_tick(500, lambda: other.replace(path))
    assert main([*RUN, "--record", str(path), "--json"]) == 2
    summary = json.loads(capsys.readouterr().out)
    assert summary["recording"]["complete"] is False
    assert summary["recording"]["recoverable"] is False
    assert 1000 <= summary["pairs"] < 1100
    assert len(load(path)) > 2000


def test_a_safety_stop_sets_the_exit_code_before_a_full_disk_and_both_are_reported(
    tmp_path, capsys, monkeypatch, fault
):
    path = tmp_path / "a.mcap"
    finish = Recorder.finish

    def full(self):
        return finish(self) | {"problem": "no space left on device"}

    monkeypatch.setattr(Recorder, "finish", full)
    assert main([*RUN, "--record", str(path)]) == 3
    out, err = capsys.readouterr()
    assert err.splitlines() == [
        f"teleop: {path}: the recording is not complete: no space left on device",
        "teleop: stopped at 0.450 s: slave position is inf: expected a number",
    ]
    assert f"teleop recover {path}" in out
    assert "STOPPED for safety" in out


def test_a_black_box_that_cannot_be_written_does_not_make_the_recording_incomplete(
    tmp_path, capsys, fault
):
    path = tmp_path / "a.mcap"
    path.with_suffix(".fault").write_text("in the way")
    assert main([*RUN, "--record", str(path)]) == 3
    out, err = capsys.readouterr()
    problem = f"black box: {path.with_suffix('.fault')}: cannot be written: file exists"
    assert err.splitlines()[0] == f"teleop: {problem}"
    assert problem in out
    assert "not complete" not in out + err
    assert "teleop recover" not in out
    assert len(load(path)) > 1000


def test_the_plot_is_saved_before_the_output_is_printed(tmp_path, monkeypatch):
    picture = tmp_path / "a.svg"

    def closed(summary, details):
        assert picture.exists()
        raise BrokenPipeError

    monkeypatch.setattr("teleop.output.trial_tables.print_trial", closed)
    assert main([*RUN, "--no-record", "--plot", str(picture)]) == 1
    assert "<svg" in picture.read_text()


def test_a_link_as_an_output_remains_whether_it_is_written_or_refused(tmp_path):
    for option, name in (("--plot", "a.svg"), ("--record", "a.mcap")):
        link, target = tmp_path / name, tmp_path / f"target-{name}"
        link.symlink_to(target)
        record = [] if option == "--record" else ["--no-record"]
        code = main([*RUN, *record, option, str(link)])
        assert link.is_symlink()
        assert code == (0 if target.exists() else 2)


def test_a_trial_that_ended_before_its_first_sample_prints_no_results(
    monkeypatch, tmp_path, capsys
):
    def request(self, arm, skipped, end=""):
        self.count = 1
        return Request(stop="Ctrl-C")

    monkeypatch.setattr("teleop.trial.stop_switch.StopSwitch.request", request)
    main([*RUN, "--record", str(tmp_path / "a.mcap")])
    text = capsys.readouterr().out
    assert "k and b cannot be used, because the trial ended before its first sample" in text
    assert "nan" not in text
    assert "teleop estimate" not in text
