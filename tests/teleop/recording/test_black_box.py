"""The black box and the report of a fault."""

from __future__ import annotations

import contextlib
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
from markupsafe import Markup

from sim_backend import SimulatedRig
from sim_backend.faults import FaultyRig, Replaced, Unplugged
from teleop.cli import main
from teleop.output.fault_report import fault_text
from teleop.recording.recording import load
from teleop.safety.events import Fault, describe
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial


@contextlib.contextmanager
def fault_injected(fault, at):
    """Inject a fault at a time of the rig's clock."""
    with pytest.MonkeyPatch.context() as patch:

        def make(cube, now, **options):
            rig = FaultyRig(SimulatedRig(cube, now, **options))
            if at == 0.0:
                rig.inject(fault)
            read = rig.rig.read

            def late():
                if now() >= at:
                    rig.inject(fault)
                return read()

            rig.rig.read = late
            return rig

        patch.setattr("teleop.trial.assembly.SimulatedRig", make)
        yield


def stopped(folder, fault, at, duration=9.0, condition="autonomous", **changes):
    """Run a trial with a fault, and return it and its recording."""
    path = folder / "run.mcap"
    settings = TrialSettings(condition, duration=duration, clock="virtual", **changes)
    with fault_injected(fault, at):
        return run_trial(settings, path), path


@pytest.fixture(scope="module")
def overloaded(tmp_path_factory):
    """A trial with a force beyond the hard limit and the range of the sensor at 7 s."""
    return stopped(tmp_path_factory.mktemp("force"), Replaced("contact_force", 5000.0), 7.0)


@pytest.fixture(scope="module")
def unmoved(tmp_path_factory):
    """A trial that is stopped before any motion."""
    return stopped(tmp_path_factory.mktemp("unmoved"), Replaced("master_force", 40.0), 0.0)


def test_the_box_holds_five_seconds_before_and_one_after_at_full_rate(overloaded):
    trial, path = overloaded
    box = load(trial.black_box / "ticks.mcap")
    fault = box.fault
    assert trial.black_box == path.with_suffix(".fault")
    assert fault == trial.fault
    assert box["time"][0] == pytest.approx(fault["time"] - 5.0, abs=2e-3)
    assert box["time"][-1] == pytest.approx(fault["time"] + 1.0, abs=2e-3)
    np.testing.assert_allclose(np.diff(box["time"]), 1e-3, atol=1e-9)
    whole = trial.recording
    part = whole["time"] >= box["time"][0]
    for name, column in box.columns.items():
        np.testing.assert_array_equal(column, whole[name][part])
    assert (trial.black_box / "ticks.mcap").stat().st_size < 2_000_000


def test_the_fault_report_names_cause_limit_value_time_and_timing(overloaded):
    trial, _ = overloaded
    text = (trial.black_box / "cause.txt").read_text()
    most = trial.settings.limits.hard_force
    for line in (
        f"what      force limit: contact force 5000 N, at most {most:.4g} N",
        "kind      force limit",
        "where     contact_force",
        "when      6.9500 s",
        "value     5000",
        f"limit     {trial.settings.limits.hard_force:.6g}",
        "since     6.95",
        "also      contact force is out of range: 5000 N, the sensor's range ends at 1000 N",
        "  contact_force             5000 N",
        "loop in the 5.0 s before",
        "  1000.0 Hz, 0 overruns, 0 periods skipped",
    ):
        assert f"{line}\n" in text
    out_of_range = "contact force is out of range: 5000 N, the sensor's range ends at 1000 N"
    assert out_of_range in trial.summary()["safety"]["further_faults"]
    assert "commanded speed zero after" in text
    drawing = ElementTree.parse(trial.black_box / "channels.svg")
    assert drawing.getroot().tag.endswith("svg")


def test_the_fault_report_names_the_longest_time_between_two_ticks(overloaded):
    recording = overloaded[0].recording
    fault = recording.fault
    late = (recording["time"] <= fault["time"]).nonzero()[0][-1]
    dt = recording["dt"].copy()
    dt[late] = 0.082
    text = fault_text(replace(recording, columns={**recording.columns, "dt": dt}), fault)
    assert "  longest time between two ticks: 82.0 ms\n" in text
    assert "lateness: from the deadline of a tick to its start" in text


def test_the_fault_report_of_an_older_recording_lists_the_channels_that_it_has(overloaded):
    recording = overloaded[0].recording
    units = {name: unit for name, unit in recording.units.items() if name != "slave_velocity"}
    text = fault_text(replace(recording, units=units), recording.fault)
    assert "\n  contact_force " in text
    assert "\n  slave_velocity " not in text


@pytest.mark.parametrize("fault", [Fault.STALE, Fault.OVERRUN])
def test_a_fault_that_a_busy_machine_causes_mentions_other_programs(fault):
    assert "other programs" in describe(fault, "contact_force", 0.082, 0.02)


def test_a_fault_before_any_motion_leaves_a_report_too(unmoved):
    trial, _ = unmoved
    assert trial.fault["fault"] == "not at rest at the start"
    assert trial.summary()["ticks"] == 0
    assert "master force 40 N, at most 5 N" in (trial.black_box / "cause.txt").read_text()


def test_the_report_of_a_run_without_motion_shows_only_the_stop(unmoved, capsys):
    _, path = unmoved
    assert main(["report", str(path)]) == 0
    page = path.with_suffix(".html").read_text()
    assert "not at rest at the start" in page
    assert page.count("<svg") == 1
    assert main(["estimate", str(path)]) == 2
    assert "the estimators received only 0 samples" in capsys.readouterr().err


@pytest.mark.usefixtures("undrawn")
def test_the_report_of_a_run_that_was_stopped_in_the_count_in_shows_only_the_stop(tmp_path):
    _, path = stopped(tmp_path, Unplugged(), at=2.0, condition="mimic", count_in=3.0)
    assert main(["report", str(path)]) == 0
    page = path.with_suffix(".html").read_text()
    assert "rig failure: RigError: master board: no answer" in page
    assert "Result" not in page


@pytest.mark.usefixtures("undrawn")
def test_the_report_shows_what_stopped_the_run(tmp_path):
    _, path = stopped(tmp_path, Unplugged(), at=2.0, duration=3.0, estimators=("rls",))
    assert main(["report", str(path)]) == 0
    page = path.with_suffix(".html").read_text()
    assert "Stopped for safety" in page
    assert "rig failure: RigError: master board: no answer" in page
    assert page.count("<svg") == 6


def test_the_report_of_a_run_in_real_time_shows_the_timing_of_the_loop(tmp_path, monkeypatch):
    monkeypatch.setattr("teleop.output.report_page.svg", lambda figure: Markup("<svg></svg>"))
    path = tmp_path / "run.mcap"
    options = ["--duration", "0.5", "--rate", "250", "--estimators", "rls"]
    assert main(["run", *options, "--record", str(path)]) == 0
    assert main(["report", str(path)]) == 0
    page = path.with_suffix(".html").read_text()
    assert "periods were skipped" in page
    assert page.count("<svg") == 6


def test_a_run_stopped_by_a_fault_reports_it_and_exits_with_3(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with fault_injected(Replaced("slave_position", float("inf")), at=0.5):
        assert main(["run", "--clock", "virtual", "--duration", "1"]) == 3
    out, err = capsys.readouterr()
    assert err == "teleop: stopped at 0.450 s: slave position is inf: expected a number\n"
    stopped, _, title, *_ = out.splitlines()
    assert stopped == "STOPPED for safety at 0.450 s: slave position is inf: expected a number"
    assert title.startswith("free, soft cube, 0.45 of 1 s")
    assert "black box: recordings/" in out
