"""Series: prompts, repetition, interruption and resumption."""

from __future__ import annotations

import csv
import json
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from drivers import RigError
from teleop.cli import main
from teleop.errors import InputError, SafetyStop
from teleop.recording.recording import load
from teleop.studies.json_lines import locked
from teleop.studies.recordings import sources
from teleop.studies.series.conduct import conduct as conduct_series
from teleop.studies.series.conduct import is_complete
from teleop.studies.series.journal import Journal
from teleop.studies.series.trials import read_series
from teleop.trial.recorded_trial import recorded_part
from teleop.trial.run import run_trial
from teleop.trial.stop_switch import StopSwitch

from ....forked_command import start_command

RIG = Path(__file__).parents[4] / "rigs" / "serial-board.toml"
PLAN = """
name = "short"
order = "listed"
[factors]
condition = ["autonomous"]
cube = ["soft", "medium", "hard"]
[settings]
clock = "virtual"
duration_s = 0.5
estimators = ["rls"]
"""


@pytest.fixture
def plan(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(PLAN)
    return read_series(path)


class Person:
    """Gives prepared answers."""

    def __init__(self, *answers):
        self.answers = [*answers]
        self.prompts = []
        self.can_repeat = []
        self.states = []

    def __call__(self, question):
        self.can_repeat.append(question.previous is not None)
        self.prompts.append(question.prompt)
        self.states.append(question.state)
        return self.answers.pop(0) if self.answers else "quit", "a note"


class RunOnce:
    """Runs each trial once, and gives its result and a copy of its recording from then on."""

    def __init__(self):
        self.done = []

    def __call__(self, settings, path, *_, **__):
        for trial, content in self.done:
            if trial.settings == settings:
                path.write_bytes(content)
                return trial
        with StopSwitch() as switch:  # without it, `run_trial` calls its replacement: this object
            trial = run_trial(settings, path, switch=switch)
        self.done.append((trial, path.read_bytes()))
        return trial


run_once = RunOnce()
conduct = partial(conduct_series, run=run_once)


class Spoiling:
    """Runs trials, some of which are interrupted."""

    def __init__(self, *spoilt):
        self.calls, self.spoilt = 0, spoilt

    def __call__(self, settings, path):
        self.calls += 1
        trial = run_once(settings, path)
        return replace(trial, interrupted=True) if self.calls in self.spoilt else trial


def rows(folder):
    with (folder / "trials.csv").open(newline="") as file:
        return [*csv.DictReader(file)]


def test_a_series_ends_in_a_row_for_each_trial_and_a_recording_of_each(plan, tmp_path):
    folder = tmp_path / "out"
    journal = conduct_series(folder, *plan)
    table = rows(folder)
    assert [row["cube"] for row in table] == ["soft", "medium", "hard"]
    for row in table:
        recording = load(folder / "recordings" / row["file"])
        assert recording.settings["cube"] == row["cube"]
        active = recording.estimated()
        rls = active.where(recorded_part(recording).contains(active["time"])).estimates()["rls"]
        assert float(row["k [N/m]"]) == rls.k[~np.logical_and.accumulate(rls.held)].mean()
    assert all(journal.is_finished(trial.number) for trial in plan[1])


def test_a_person_skips_repeats_and_quits(plan, tmp_path):
    folder = tmp_path / "out"
    person = Person("run", "repeat", "run", "skip", "quit")
    journal = conduct(folder, *plan, ask=person)
    assert journal.attempts(1) == 2
    assert journal.last(2)["entry"] == "skipped"
    assert journal.last(2)["note"] == "a note"
    assert journal.last(3) is None
    assert [row["attempt"] for row in rows(folder)] == ["2"]
    assert person.prompts[0].startswith("trial 1 of 3: Next: autonomous-soft-1")
    assert len([*(folder / "recordings").glob("*.mcap")]) == 2


def test_a_repeated_trial_is_asked_for_again_and_can_be_left_as_it_was(plan, tmp_path):
    folder = tmp_path / "out"
    conduct(folder, *plan, ask=Person("run", "quit"))
    person = Person("repeat", "skip", "repeat", "quit")
    journal = conduct(folder, *plan, ask=person)
    assert [prompt[:7] for prompt in person.prompts] == ["trial 2", "trial 1", "trial 2", "trial 1"]
    assert journal.last(1)["entry"] == "done"
    assert journal.attempts(1) == 1


def test_the_note_on_each_answer_is_in_the_journal(plan, tmp_path):
    folder = tmp_path / "out"
    person = Person("run", "repeat", "skip", "skip", "repeat", "quit")
    journal = conduct(folder, *plan, ask=person)
    noted = [entry.get("answer", entry["entry"]) for entry in journal.entries if entry.get("note")]
    assert noted == ["started", "repeat", "skip", "skipped", "repeat", "quit"]


def test_after_a_spoilt_attempt_r_returns_to_the_trial_before_and_s_skips(plan, tmp_path):
    folder = tmp_path / "out"
    person = Person("run", "run", "repeat", "skip", "skip", "quit")
    journal = conduct(folder, *plan, ask=person, run=Spoiling(2))
    assert [prompt[:7] for prompt in person.prompts] == [
        f"trial {number}" for number in (1, 2, 2, 1, 2, 3)
    ]
    spoilt = "Attempt 1 of trial 2 must be repeated: interrupted."
    assert person.states == ["", "", spoilt, "Trial 1 is done (attempt 1).", spoilt, ""]
    assert journal.last(1)["entry"] == "done"
    assert journal.last(2)["entry"] == "skipped"


def test_s_skips_the_first_trial_after_a_spoilt_attempt_and_r(plan, tmp_path):
    person = Person("run", "repeat", "skip", "quit")
    journal = conduct(tmp_path / "out", *plan, ask=person, run=Spoiling(1))
    assert journal.last(1)["entry"] == "skipped"
    assert [prompt[:7] for prompt in person.prompts] == ["trial 1"] * 3 + ["trial 2"]


def test_a_note_after_r_belongs_to_the_trial_that_is_returned_to(plan, tmp_path):
    folder = tmp_path / "out"
    conduct(folder, *plan, ask=Person("run", "repeat", "quit"))
    (entry,) = [e for e in Journal(folder).entries if e.get("answer") == "repeat"]
    assert (entry["trial"], entry["attempt"]) == (1, 1)
    assert rows(folder)[0]["note"].count("a note") >= 2


def test_the_message_of_a_resumed_series_names_the_trial_that_was_killed(plan, tmp_path):
    def killed(settings, path):
        raise SystemExit

    folder, reports = tmp_path / "out", []
    conduct(folder, *plan, ask=Person("run", "quit"))
    with pytest.raises(SystemExit):
        conduct(folder, *plan, ask=Person("run"), run=killed)
    conduct(folder, *plan, ask=Person(), report=reports.append)
    assert reports[0].endswith(
        "1 of 3 trials are done, 0 skipped. Attempt 1 of trial 2 must be repeated: interrupted."
    )


def test_a_trial_that_was_killed_during_a_safety_stop_names_the_report_of_the_stop(plan, tmp_path):
    def killed(settings, path):
        path.with_suffix(".fault").mkdir()
        raise SystemExit

    folder, reports = tmp_path / "out", []
    with pytest.raises(SystemExit):
        conduct(folder, *plan, ask=Person("run"), run=killed)
    conduct(folder, *plan, ask=Person(), report=reports.append)
    report = next((folder / "recordings").glob("*.fault")).name
    assert reports[0].endswith(f"interrupted after a safety stop, see {report}.")


def test_a_trial_that_was_skipped_can_be_run_after_all(plan, tmp_path):
    folder = tmp_path / "out"
    person = Person("run", "skip", "repeat", "run", "quit")
    journal = conduct(folder, *plan, ask=person)
    assert [prompt[:7] for prompt in person.prompts] == [
        f"trial {number}" for number in (1, 2, 3, 2, 3)
    ]
    assert [row["cube"] for row in rows(folder)] == ["soft", "medium"]
    assert journal.last(2)["entry"] == "done"


@pytest.mark.parametrize("error", [RigError("no such port"), InputError("the rate is too high")])
def test_a_trial_that_cannot_be_run_is_asked_for_again(plan, tmp_path, error):
    def failing(settings, path):
        raise error

    reports, person = [], Person("run", "quit")
    journal = conduct(tmp_path / "out", *plan, ask=person, run=failing, report=reports.append)
    assert [prompt[:7] for prompt in person.prompts] == ["trial 1", "trial 1"]
    assert reports[0].endswith(f"{error}; the same trial is next")
    assert journal.last(1)["problem"] == str(error)
    with pytest.raises(type(error)):
        conduct(tmp_path / "out", *plan, run=failing)


def test_before_the_first_trial_there_is_none_to_repeat(plan, tmp_path):
    reports, person = [], Person("repeat", "quit")
    journal = conduct(tmp_path / "out", *plan, ask=person, report=reports.append)
    assert reports == ["there is no trial before the first one: expected Enter, s or q"]
    assert journal.attempts(1) == 0
    assert [prompt[:7] for prompt in person.prompts] == ["trial 1", "trial 1"]


def test_a_repetition_is_offered_only_after_a_trial(plan, tmp_path):
    person = Person("run", "skip", "quit")
    conduct(tmp_path / "out", *plan, ask=person)
    assert person.can_repeat == [False, True, True]
    resumed = Person("quit")
    conduct(tmp_path / "out", *plan, ask=resumed)
    assert resumed.can_repeat == [True]


def test_a_spoilt_trial_is_repeated_and_its_recording_is_kept(plan, tmp_path):
    folder = tmp_path / "out"
    conduct(folder, *plan, ask=Person("run", "run", "run", "run"), run=Spoiling(2))
    assert [row["attempt"] for row in rows(folder)] == ["1", "2", "1"]
    assert len([*(folder / "recordings").glob("002-*.mcap")]) == 2


def test_without_a_person_a_trial_that_is_always_stopped_ends_the_series(
    plan, tmp_path, monkeypatch
):
    stop = SafetyStop("stopped at 1 s")
    monkeypatch.setattr("teleop.studies.series.conduct.spoilt", lambda trial: stop)
    with pytest.raises(SafetyStop, match="trial 1, autonomous-soft-1: stopped at 1 s"):
        conduct(tmp_path / "out", *plan)
    assert Journal(tmp_path / "out").attempts(1) == 3


def with_outcome(fault=None, problem=""):
    """Return a function that runs trials with this fault, and this problem of the recording."""

    def run(settings, path):
        trial = run_once(settings, path)
        return replace(trial, fault=fault, outcome=trial.outcome._replace(problem=problem))

    return run


def test_a_full_disk_ends_a_series_without_a_person_at_once_and_is_no_safety_stop(plan, tmp_path):
    with pytest.raises(InputError, match=r"001-autonomous-soft-1-1\.mcap: .* no space left"):
        conduct(tmp_path / "out", *plan, run=with_outcome(problem="no space left on device"))
    assert Journal(tmp_path / "out").attempts(1) == 1


def test_a_recording_with_gaps_is_repeated_and_is_no_safety_stop(plan, tmp_path, monkeypatch):
    gaps = InputError("3 ticks are missing")
    monkeypatch.setattr("teleop.studies.series.conduct.spoilt", lambda trial: gaps)
    with pytest.raises(InputError, match="trial 1, autonomous-soft-1: 3 ticks are missing"):
        conduct(tmp_path / "out", *plan)
    assert Journal(tmp_path / "out").attempts(1) == 3


def test_a_journal_that_cannot_be_written_does_not_hide_a_safety_stop(plan, tmp_path, monkeypatch):
    write = Journal.write

    def full(journal, entry, *given, **values):
        if entry == "spoilt":
            raise InputError("the disk is full")
        write(journal, entry, *given, **values)

    monkeypatch.setattr(Journal, "write", full)
    stopped = with_outcome({"time": 1.0, "text": "too deep"})
    with pytest.raises(SafetyStop, match="too deep; the disk is full"):
        conduct(tmp_path / "out", *plan, run=stopped)


def test_notes_before_and_after_a_trial_are_in_its_rows_and_do_not_change_its_state(plan, tmp_path):
    folder = tmp_path / "out"
    journal = conduct(folder, *plan, ask=Person("run"), ask_note=lambda trial: "moved late")
    assert [row["note"] for row in rows(folder)] == ["a note; moved late"]
    assert journal.last(1)["entry"] == "done"
    resumed = Journal(folder)
    assert resumed.note(1, 1) == "a note; moved late"
    assert resumed.is_finished(1)
    assert resumed.attempts(1) == 1


def test_ctrl_c_ends_an_unattended_series_which_goes_on_from_there(plan, tmp_path):
    folder = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        conduct(folder, *plan, run=Spoiling(2))
    conduct(folder, *plan)
    assert [row["attempt"] for row in rows(folder)] == ["1", "2", "1"]


def test_a_line_that_was_cut_off_by_a_kill_is_ignored(plan, tmp_path):
    folder = tmp_path / "out"
    conduct(folder, *plan, ask=Person("run"))
    journal = folder / "journal.jsonl"
    journal.write_bytes(journal.read_bytes() + b'{"entry": "done", "tri')
    conduct(folder, *plan)
    assert len(rows(folder)) == 3


def test_a_folder_with_other_files_or_another_plan_is_refused(plan, tmp_path):
    read, trials = plan
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "file").write_text("")
    with pytest.raises(InputError, match="expected an empty folder, or the folder of a series"):
        conduct(tmp_path / "other", read, trials)
    conduct(tmp_path / "out", read, trials, ask=Person())
    with pytest.raises(InputError, match="another plan"):
        conduct(tmp_path / "out", read.model_copy(update={"seed": 7}), trials)


@pytest.mark.skipif(sys.platform == "win32", reason="no file locks")
def test_two_series_in_one_folder_are_refused(plan, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    with (
        locked(folder),
        pytest.raises(InputError, match="another series or sweep is running in this folder"),
    ):
        conduct(folder, *plan)


@pytest.mark.skipif(sys.platform == "win32", reason="no file locks")
def test_a_lock_file_that_is_a_link_is_refused_and_its_target_is_kept(plan, tmp_path):
    folder, target = tmp_path / "out", tmp_path / "thesis.txt"
    folder.mkdir()
    target.write_text("a thesis")
    (folder / ".lock").symlink_to(target)
    with pytest.raises(InputError, match=r"\.lock: is a symbolic link"):
        conduct(folder, *plan)
    assert target.read_text() == "a thesis"


@pytest.mark.skipif(sys.platform == "win32", reason="no file locks")
def test_the_content_of_a_file_with_the_name_of_the_lock_is_kept(plan, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / ".lock").write_text("a thesis")
    conduct(folder, *plan)
    assert (folder / ".lock").read_text() == "a thesis"


def test_a_trial_whose_recording_was_deleted_is_named_and_run_again(plan, tmp_path, command):
    folder, reports = tmp_path / "out", []
    conduct(folder, *plan)
    deleted = folder / "recordings" / "002-autonomous-medium-1-1.mcap"
    deleted.rename(tmp_path / "elsewhere")
    _, out, err = command(["q\n"], "--out", "out")
    assert f"of trial 2 must be repeated: its recording {deleted.name} is missing." in err
    assert "2 of 3 trials done, 0 skipped, 1 pending" in out
    assert [row["attempt"] for row in rows(folder)] == ["1", "1", "1"]
    (tmp_path / "elsewhere").rename(deleted)
    conduct(folder, *plan, report=reports.append)
    assert reports == [f"{folder}: the series is complete, no trial is run"]
    deleted.unlink()
    conduct(folder, *plan)
    assert [row["attempt"] for row in rows(folder)] == ["1", "2", "1"]
    assert is_complete(folder, *plan)


def test_recordings_that_were_swapped_are_named_and_not_compared(plan, tmp_path):
    folder = tmp_path / "series"
    conduct_series(folder, *plan)
    first, second, _ = sorted((folder / "recordings").glob("*.mcap"))
    first.rename(folder / "kept")
    second.rename(first)
    (folder / "kept").rename(second)
    with pytest.raises(InputError, match=f"{first.name} was replaced or changed: it has"):
        sources([folder])
    assert not is_complete(folder, *plan)
    assert "was replaced or changed" in Journal(folder).problem(1)


@pytest.mark.parametrize("name", ["journal.jsonl", "trials.csv"])
@pytest.mark.parametrize("put", [Path.mkdir, os.mkfifo])
def test_a_file_of_a_series_that_is_no_regular_file_is_refused(plan, tmp_path, name, put):
    folder = tmp_path / "series"
    folder.mkdir()
    put(folder / name)
    if name == "trials.csv":
        Journal(folder).write("plan", plan=plan[0].model_dump(mode="json"))
    with pytest.raises(InputError, match=f"{name}: expected a file, this is a"):
        conduct_series(folder, *plan)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda entry: entry.clear(), "line 3: time: is missing"),
        (lambda entry: entry.update(trial=9), "contains trial 9: expected at most 3"),
        (lambda entry: entry.update(trial=[1]), "line 3: trial: expected a whole number"),
        (lambda entry: entry.pop("summary"), "line 3: .*expected attempt, file and summary"),
        (lambda entry: entry.update(summary={"estimates": [1]}), "line 3: summary.estimates"),
        (lambda entry: entry.update(file="../x.mcap"), "line 3: file: "),
        (lambda entry: entry.update(entry="future"), "line 3: entry: expected one of plan"),
    ],
)
def test_a_journal_with_a_damaged_entry_is_refused_in_one_line(plan, tmp_path, change, problem):
    folder = tmp_path / "series"
    journal = Journal(made(folder))
    journal.write("plan", plan=plan[0].model_dump(mode="json"))
    journal.write("started", 1, attempt=1, file="a.mcap")
    journal.write("done", 1, attempt=1, file="a.mcap", summary={"estimates": {}})
    lines = (folder / "journal.jsonl").read_text().splitlines()
    entry = json.loads(lines[2])
    change(entry)
    (folder / "journal.jsonl").write_text("\n".join([*lines[:2], json.dumps(entry), ""]))
    with pytest.raises(InputError, match=problem) as caught:
        conduct_series(folder, *plan)
    assert "\n" not in str(caught.value)


def made(folder):
    folder.mkdir()
    return folder


def done_trials(folder):
    return [str(result["trial"]) for result in Journal(folder).results()]


def interrupted(*_):
    raise KeyboardInterrupt


def test_a_trial_is_in_the_table_before_the_person_is_asked_for_a_note(plan, tmp_path):
    folder = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        conduct(folder, *plan, ask=Person("run"), ask_note=interrupted)
    assert [row["trial"] for row in rows(folder)] == done_trials(folder) == ["1"]


@pytest.mark.parametrize("answers", [(), ("quit",), ("skip", "skip"), ("run", "run")])
@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_text("trial\n")])
def test_a_table_that_does_not_agree_with_the_journal_is_rebuilt_at_the_start(
    plan, tmp_path, answers, damage
):
    folder = tmp_path / "out"
    conduct(folder, *plan, ask=Person("run"))
    damage(folder / "trials.csv")
    conduct(folder, *plan, ask=Person(*answers))
    assert [row["trial"] for row in rows(folder)] == done_trials(folder)
    conduct(folder, *plan)
    damage(folder / "trials.csv")
    conduct(folder, *plan)  # the series is complete
    assert [row["trial"] for row in rows(folder)] == done_trials(folder)


def test_the_table_of_an_older_journal_has_empty_cells_for_unknown_values(plan, tmp_path):
    folder = tmp_path / "out"
    conduct(folder, *plan)
    entries = [json.loads(line) for line in (folder / "journal.jsonl").read_text().splitlines()]
    for entry in entries:
        if entry["entry"] == "done":
            del entry["summary"]["tracking"], entry["summary"]["estimates"]["rls"]["rise_time_s"]
    text = "".join(f"{json.dumps(entry)}\n" for entry in entries)
    (folder / "journal.jsonl").write_text(text)
    conduct(folder, *plan)
    assert [row["rise time [s]"] for row in rows(folder)] == [""] * 3


def test_a_table_that_agrees_with_the_journal_is_not_written_again(plan, tmp_path):
    folder = tmp_path / "out"
    conduct(folder, *plan)
    before = (folder / "trials.csv").stat()
    conduct(folder, *plan)
    assert (folder / "trials.csv").stat() == before


def test_a_trial_whose_repetition_is_spoilt_is_no_longer_in_the_table(plan, tmp_path):
    folder = tmp_path / "out"
    conduct(folder, *plan, ask=Person("run", "repeat", "run"), run=Spoiling(2))
    assert rows(folder) == []


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_a_series_that_is_killed_again_and_again_completes_and_loses_nothing(plan, tmp_path):
    command = ("series", "plan.toml", "--out", "out")
    chance = random.Random(1)
    kept: dict[Path, bytes] = {}
    journal = tmp_path / "out" / "journal.jsonl"
    for _ in range(3):
        known = journal.stat().st_size if journal.exists() else 0
        process = start_command(*command, cwd=tmp_path, stderr=subprocess.DEVNULL)
        while process.poll() is None and not (journal.exists() and journal.stat().st_size > known):
            time.sleep(0.01)
        time.sleep(chance.uniform(0.0, 0.3))  # of about 0.15 s, which a trial takes
        process.send_signal(signal.SIGKILL)
        process.wait()
        time.sleep(0.3)  # the recorder writes what it was sent
        for path, content in kept.items():
            assert path.read_bytes() == content
        kept = {
            path: path.read_bytes() for path in (tmp_path / "out" / "recordings").glob("*.mcap")
        }
    environment = os.environ | {"PYTHONWARNINGS": "error"}
    command = (sys.executable, "-m", "teleop", *command)
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert [row["cube"] for row in rows(tmp_path / "out")] == ["soft", "medium", "hard"]


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_after_a_kill_at_a_prompt_a_trial_or_a_note_the_table_has_every_done_trial(plan, tmp_path):
    command = ("series", "plan.toml", "--out", "out", "--ask")
    chance = random.Random(4)
    folder = tmp_path / "out"

    at_note = 0
    for attempt in range(4):
        process = start_command(
            *command, cwd=tmp_path, stdin=subprocess.PIPE, stderr=subprocess.PIPE
        )
        process.stdin.write("\n")  # runs one trial; the question for a note has no answer
        process.stdin.flush()
        for line in process.stderr:
            if line.startswith("Note on trial"):
                at_note += 1
                break
            if attempt % 2 and line.startswith("Enter runs it"):
                time.sleep(chance.uniform(0.0, 0.5))
                break
        process.kill()
        process.communicate()
        time.sleep(0.3)  # the recorder writes what it was sent
        done = done_trials(folder)
        conduct(folder, *plan, ask=Person("quit"))
        assert [row["trial"] for row in rows(folder)] == done_trials(folder) == done
    assert at_note >= 2
    assert done[:2] == ["1", "2"]


def test_the_command_asks_before_each_trial_if_the_options_say_so(tmp_path, monkeypatch, capsys):
    (tmp_path / "plan.toml").write_text(PLAN)
    monkeypatch.chdir(tmp_path)
    answers = iter(["x\n", "\n", "slipped once\n", "s too soft\n", ""])
    monkeypatch.setattr("sys.stdin.readline", lambda: next(answers), raising=False)
    assert main(["series", "plan.toml", "--ask", "--json"]) == 0
    captured = capsys.readouterr()
    assert '"done": 1' in captured.out
    assert "Expected Enter, s, r or q." in captured.err
    assert Journal(tmp_path / "series-short").last(2)["note"] == "too soft"
    assert [row["note"] for row in rows(tmp_path / "series-short")] == ["slipped once"]


INTERRUPT = object()
"""Answer of a person who presses Ctrl-C."""


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """Run the command with typed lines, and return its exit code, output and messages."""
    (tmp_path / "plan.toml").write_text(PLAN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("teleop.trial.run.run_trial", run_once)

    def command(lines, *options):
        typed = iter(lines)

        def readline():
            line = next(typed)
            return interrupted() if line is INTERRUPT else line

        monkeypatch.setattr("sys.stdin.readline", readline, raising=False)
        capsys.readouterr()
        try:
            code = main(["series", "plan.toml", "--ask", *options])
        except SystemExit as end:
            code = end.code
        return code, *capsys.readouterr()

    return command


@pytest.mark.parametrize(
    ("lines", "code", "done"),
    [
        (["q\n"], 0, 0),
        ([INTERRUPT], 130, 0),
        (["\n", INTERRUPT], 130, 1),  # at the question for a note
        (["\n", "\n", INTERRUPT], 130, 1),
        (["\n", "\n", "q\n"], 0, 1),
    ],
)
def test_after_q_or_ctrl_c_the_counts_and_the_command_that_resumes_are_shown(
    command, lines, code, done
):
    found, out, _ = command(lines, "--out", "my series")
    assert found == code
    assert f"my series: {done} of 3 trials done, 0 skipped, {3 - done} pending" in out
    assert "resume with: teleop series plan.toml --out 'my series' --ask" in out
    found, out, _ = command(["\n"] * 2 * (3 - done), "--out", "my series")
    assert "3 of 3 trials done" in out
    assert "resume" not in out


@pytest.mark.parametrize("typed", ["printf '\\377\\nq\\n' | ", "<&- "])
def test_an_answer_that_is_not_text_is_refused_and_a_closed_input_quits(tmp_path, typed):
    if os.name != "posix":
        pytest.skip("needs a POSIX shell")
    (tmp_path / "plan.toml").write_text(PLAN)
    command = [sys.executable, "-m", "teleop", "series", "plan.toml", "--ask"]
    done = subprocess.run(
        ["sh", "-c", f'{typed}"$@"', "sh", *command],
        cwd=tmp_path,
        env=os.environ | {"PYTHONIOENCODING": "utf-8:strict"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    assert ("Expected Enter, s, r or q." in done.stderr) == ("377" in typed)


def test_after_ctrl_c_the_document_has_the_counts(command):
    code, out, _ = command([INTERRUPT], "--json")
    assert code == 130
    assert json.loads(out) == {"folder": "series-short", "done": 0, "skipped": 0, "pending": 3}


def test_the_prompt_offers_a_repetition_only_if_there_is_a_trial_to_repeat(command):
    _, _, err = command(["r\n", "s\n", "q\n"])
    lines = [line for line in err.splitlines() if not line.startswith("trial")]
    assert lines == [
        "Enter runs it, s skips it, q quits.",
        "teleop: there is no trial before the first one: expected Enter, s or q",
        "Enter runs it, s skips it, q quits.",
        "Enter runs it, s skips it, r returns to trial 1, q quits.",
    ]


def test_the_prompt_of_an_earlier_trial_states_its_attempt_and_that_s_keeps_its_result(command):
    _, _, err = command(["\n", "\n", "s\n", "r\n", "r\n", "s\n", "q\n"])
    lines = [line for line in err.splitlines() if line.startswith(("trial", "Trial", "Enter"))]
    assert lines[4:] == [
        "trial 3 of 3: Next: autonomous-hard-1.",
        "Enter runs it, s skips it, r returns to trial 2, q quits.",
        "trial 2 of 3: Next: autonomous-medium-1.",
        "Trial 2 was skipped.",
        "Enter runs it, s leaves it skipped, r returns to trial 1, q quits.",
        "trial 1 of 3: Next: autonomous-soft-1.",
        "Trial 1 is done (attempt 1).",
        "Enter runs it again, s keeps its result, q quits.",
        "trial 3 of 3: Next: autonomous-hard-1.",
        "Enter runs it, s skips it, r returns to trial 2, q quits.",
    ]


def test_the_order_is_shown_without_running_anything(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["series", "paper", "--dry-run"]) == 0
    assert "autonomous" in capsys.readouterr().out
    assert not any(tmp_path.iterdir())


def wired_plan(folder):
    text = PLAN.replace('cube = ["soft", "medium", "hard"]', 'specimen = ["liver", "cyst"]')
    text = text.replace('clock = "virtual"', f'rig = "{RIG}"\ndepth_m = 0.003')
    path = folder / "plan.toml"
    path.write_text(text)
    return path


def test_the_factor_specimen_names_the_specimen_of_each_trial(tmp_path):
    path = wired_plan(tmp_path)
    _, trials = read_series(path)
    assert [trial.settings.specimen for trial in trials] == ["liver", "cyst"]
    path.write_text(path.read_text().replace("depth_m = 0.003", ""))
    with pytest.raises(InputError, match=r"depth_m: is missing: .* in \[settings\] or"):
        read_series(path)


def test_a_series_on_a_rig_of_devices_needs_a_person_or_yes(tmp_path, refused):
    path = wired_plan(tmp_path)
    for options in ((), ("--no-ask",)):
        assert "expected --yes" in refused("series", path, "--out", tmp_path / "out", *options)
    assert not (tmp_path / "out").exists()


IN_BACKGROUND = """
import os, pty, sys
pid, terminal = pty.fork()
if pid == 0:
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)
        os.execvp(sys.argv[1], sys.argv[1:])
    code = os.waitstatus_to_exitcode(os.waitpid(child, os.WUNTRACED)[1])
    os._exit(code)
os.write(terminal, b"\\n" * 20)
try:
    while text := os.read(terminal, 4096):
        os.write(2, text)
except OSError:
    pass
sys.exit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
"""
"""Program that runs a command in the background of a terminal, in which Enter is typed."""


@pytest.mark.skipif(os.name != "posix", reason="needs job control")
def test_lines_that_nobody_types_at_the_terminal_do_not_arm_a_series(tmp_path):
    command = [sys.executable, "-m", "teleop", "series", wired_plan(tmp_path), "--ask"]
    lines = tmp_path / "lines"
    lines.write_text("\n" * 20)
    ways = {
        "pipe": ["sh", "-c", 'yes "" | "$@"', "sh"],
        "file": ["sh", "-c", f'"$@" < "{lines}"', "sh"],
        "nohup": ["sh", "-c", 'yes "" | nohup "$@"', "sh"],
        "background": [sys.executable, "-c", IN_BACKGROUND],
    }
    started = {
        name: subprocess.Popen(
            [*way, *command, "--out", tmp_path / name],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for name, way in ways.items()
    }
    for name, process in started.items():
        with process:
            out, err = process.communicate(timeout=60)
        assert (process.returncode, out) == (2, ""), (name, err)
        assert err.count("teleop:") == 1, (name, err)
        line = " ".join(err.split())  # a terminal breaks the message at spaces
        assert "nobody can arm the drives: expected --yes" in line
        assert not (tmp_path / name).exists()


def test_the_prompt_of_a_series_arms_the_drives_and_is_the_only_one(tmp_path, monkeypatch, capsys):
    run = []
    monkeypatch.setattr(
        "teleop.commands.series.SeriesRunner.run", lambda self, *_: run.append(self) or 1 / 0
    )
    answers = iter(["\n"])
    monkeypatch.setattr("sys.stdin.readline", lambda: next(answers), raising=False)
    monkeypatch.setattr("teleop.trial.arming.is_foreground", lambda: True)
    monkeypatch.setattr("teleop.trial.arming.discard_typed_ahead", lambda: None)
    with pytest.raises(ZeroDivisionError):
        main(["series", str(wired_plan(tmp_path)), "--out", str(tmp_path / "out"), "--ask"])
    assert [runner.explained for runner in run] == [True]
    prompt = " ".join(capsys.readouterr().err.split())
    assert prompt.count("Ctrl-C ramps the drives down and ends the trial") == 1
    for part in ("serial board: autonomous, liver, 0.5 s, depth 3 mm, force limit 200 N", "Ctrl-C"):
        assert part in prompt


def test_a_series_that_is_resumed_says_so(plan, tmp_path):
    lines: list[str] = []
    conduct(tmp_path / "out", *plan, ask=Person("run", "skip", "quit"), report=lines.append)
    assert not any("resumed" in line for line in lines)
    lines.clear()
    conduct(tmp_path / "out", *plan, report=lines.append)
    assert lines[0].endswith("the series is resumed: 1 of 3 trials are done, 1 skipped")
    lines.clear()
    conduct(tmp_path / "out", *plan, report=lines.append)
    (line,) = lines
    assert line.endswith("the series is complete, no trial is run")


def test_a_complete_series_on_a_rig_of_devices_needs_neither_person_nor_yes(tmp_path, capsys):
    path, out = wired_plan(tmp_path), tmp_path / "out"
    skip = Person("skip", "skip")
    conduct(out, *read_series(path), ask=skip)
    assert main(["series", str(path), "--out", str(out)]) == 0
    captured = capsys.readouterr()
    assert "complete, no trial is run" in captured.err
    assert "0 of 2 trials done, 2 skipped" in captured.out


def test_the_table_has_the_tracking_of_mimic_and_empty_cells_for_other_conditions(tmp_path):
    text = PLAN.replace('cube = ["soft", "medium", "hard"]', "")
    text = text.replace('condition = ["autonomous"]', 'condition = ["free", "mimic"]')
    text = text.replace("duration_s = 0.5", "duration_s = 4.0\nrate_hz = 250")
    (tmp_path / "plan.toml").write_text(text)
    conduct(tmp_path / "out", *read_series(tmp_path / "plan.toml"))
    names = [
        "tracking gain",
        "tracking phase [deg]",
        "tracking error rms [m]",
        "achieved frequency [Hz]",
        "target frequency [Hz]",
    ]
    free, mimic = rows(tmp_path / "out")
    assert [free[name] for name in names] == [""] * 5
    gain, phase, rms, achieved, target = (float(mimic[name]) for name in names)
    assert 0.3 < gain < 1.5
    assert -180.0 < phase < 90.0
    assert 0.0 < rms < 0.02
    assert achieved == pytest.approx(target, rel=0.2)
    assert target == 1.0
