from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from teleop.cli import app, main
from telepalpation import __version__

from ..forked_command import run_command, start_command

RUN = ["run", "--clock", "virtual", "--duration", "0.5", "--no-record"]
SLOW = ("--rate", "100")
"""A low rate of a loop in real time, so that a busy machine can run it."""
GOOD = "Time [s],Position [mm],Force [N]\n" + "".join(
    f"{i * 0.01},{math.sin(i * 0.1)},{2 * math.sin(i * 0.1)}\n" for i in range(200)
)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The folder of the recordings."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "sine.csv"
    path.write_text(GOOD)
    return str(path)


def test_run_prints_estimates_and_timing_in_detail(capsys):
    assert main([*RUN, "--details"]) == 0
    out, err = capsys.readouterr()
    for word in (
        "rls",
        "ai",
        "me",
        "k [N/m]",
        "b [N s/m]",
        "e_f [N]",
        "rise time [s]",
        "ticks at 1000 Hz",
    ):
        assert word in out
    assert err == ""


def test_run_in_real_time_prints_lateness(capsys):
    assert main(["run", *SLOW, "--duration", "0.2", "--no-record", "--details"]) == 0
    out = capsys.readouterr().out
    for word in ("lateness [us]", "p50", "p99", "p99.9", "max", "overruns"):
        assert word in out


def test_run_json_is_one_document_with_the_documented_keys(capsys):
    assert main([*RUN, "--condition", "mimic", "--cube", "medium", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["condition"] == "mimic"
    assert document["cube"] == "medium"
    assert document["duration_s"] == 0.5
    assert document["ticks"] == pytest.approx(500, abs=20)
    for name in ("rls", "ai", "me"):
        assert {"b", "k", "e_f", "rise_time_s"} <= document["estimates"][name].keys()
    assert {"rate_hz", "mean_rate_hz", "lateness_us", "overruns"} <= document["loop"].keys()
    assert {"p50", "p99", "max"} <= document["loop"]["lateness_us"].keys()
    assert document["expected_intervals"].keys() == {"k", "b"}


def test_a_missing_number_is_null_in_json(capsys):
    assert main(["run", "--clock", "virtual", "--duration", "0.001", "--no-record", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["estimates"]["rls"]["rise_time_s"] is None


@pytest.mark.parametrize(
    ("clock", "conditioning"),
    [("virtual", name) for name in ("matched", "svf", "foaw", "difference")] + [("real", "foaw")],
)
def test_estimates_from_the_recording_are_exactly_those_of_the_run(
    capsys, tmp_path, conditioning, clock
):
    path = tmp_path / "run.mcap"
    chosen = ["--conditioning", conditioning, "--cube", "medium", "--bandwidth", "30"]
    lengths = ["--clock", clock, "--rate", "500", "--duration", "1", "--json"]
    assert main(["run", *chosen, *lengths, "--record", str(path)]) == 0
    online = json.loads(capsys.readouterr().out)
    assert online["recording"]["path"] == str(path)
    assert main(["estimate", str(path), "--json"]) == 0
    offline = json.loads(capsys.readouterr().out)
    assert offline["as_online"]
    assert offline["estimates"] == online["estimates"]


def test_other_settings_than_those_of_the_run_are_reported(capsys, tmp_path):
    path, picture = tmp_path / "run.mcap", tmp_path / "run.png"
    options = ["--record", str(path), "--plot", str(picture)]
    assert main(["run", "--clock", "virtual", "--duration", "0.5", *options]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    capsys.readouterr()
    assert main(["estimate", str(path), "--preset", "scaled", "--json"]) == 0
    assert not json.loads(capsys.readouterr().out)["as_online"]
    assert main(["estimate", str(path), "--preset", "scaled"]) == 0
    assert "the settings are not those of the run" in " ".join(capsys.readouterr().out.split())


def test_a_run_is_recorded_in_a_dated_folder_and_prints_the_path(capsys, tmp_path):
    for _ in range(2):
        assert main(["run", "--clock", "virtual", "--duration", "0.2", "--json"]) == 0
        document = json.loads(capsys.readouterr().out)
    files = sorted(tmp_path.glob("recordings/????-??-??/*-free-soft*.mcap"))
    assert len(files) == 2
    assert (tmp_path / document["recording"]["path"]) in files
    assert document["recording"]["complete"]


def test_a_recording_is_never_overwritten_by_a_run(refused, tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(b"precious")
    for overwrite in ([], ["--overwrite"]):
        error = refused(*RUN[:-1], "--record", str(path), *overwrite)
        assert "exists already: a recording is never overwritten" in error
    assert path.read_bytes() == b"precious"


def test_estimate_prints_the_estimators_beside_batch_least_squares(capsys, recording, tmp_path):
    picture, table = tmp_path / "sine.svg", tmp_path / "out.csv"
    files = ["--plot", str(picture), "--out", str(table)]
    assert main(["estimate", recording, *files, "--details"]) == 0
    out = capsys.readouterr().out
    for word in ("sine.csv", "rls", "ai", "me", "least squares", "one-step rms [N]", "datum"):
        assert word in out
    assert "<svg" in picture.read_text()
    assert table.read_text().startswith(
        "Time [s],Displacement [m],Velocity [m/s],Force [N],Expected_k [-],Expected_b [-],rls_b"
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "--condition", "telepathy"], ["telepathy", "condition", "autonomous"]),
        (["run", "--cube", "wood"], ["wood", "--cube", "soft"]),
        (["run", "--duration", "0"], ["duration 0 s"]),
        (["run", "--duration=-3"], ["duration -3 s"]),
        (["run", "--duration", "nan"], ["--duration 'nan': expected a time"]),
        (["run", "--duration", "soon"], ["soon", "--duration"]),
        (["run", "--rate", "1e9"], ["rate 1e+09 Hz", "100000"]),
        (["run", "--rate", "0"], ["rate 0 Hz"]),
        (["run", "--seed", "x"], ["--seed"]),
        (["run", "--frequency", "0", "--condition", "autonomous"], ["frequency 0 Hz"]),
        (["run", "--bandwidth", "-1"], ["bandwidth"]),
        (
            ["run", "--record", f"{__file__}/run.mcap"],
            [__file__, "is a file: expected a folder"],
        ),
        (["run", "--record", "run.csv"], ["run.csv", "ending in .mcap"]),
        (["run", "--record", "a.mcap", "--no-record"], ["expected at most one of them"]),
        (["run", "--tare", "nothing.json"], ["nothing.json: no such file"]),
        (["run", "--realtime", "maybe"], ["maybe", "require"]),
        (["run", "--plot", "run.xyz"], ["run.xyz", ".png"]),
        (["run", "--speed", "3"], ["--speed"]),
        (["fly"], ["fly"]),
        (["estimate"], ["FILE"]),
        (["estimate", "nothing.csv"], ["nothing.csv", "no such file"]),
    ],
)
def test_invalid_arguments_are_reported_in_one_line(refused, arguments, words):
    error = refused(*arguments)
    for word in words:
        assert word in error


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (["--force", "Load"], ["Load", "'Force'"]),
        (["--datum", "here"], ["here", "1.5mm,20N"]),
        (["--preset", "mine"], ["mine", "paper"]),
        (["--bandwidth", "0"], ["bandwidth"]),
        (["--plot", "/nowhere/a.png"], ["/nowhere/a.png"]),
    ],
)
def test_invalid_arguments_of_estimate_are_reported_in_one_line(refused, recording, extra, words):
    error = refused("estimate", recording, *extra)
    for word in words:
        assert word in error


def test_a_rate_that_the_loop_cannot_run_at_is_reported(refused):
    error = refused("run", "--rate", "100000")
    assert "a tick takes" in error
    assert "at most" in error


def test_a_defect_shows_its_traceback(monkeypatch):
    def broken(self, tick, request):
        raise ZeroDivisionError

    monkeypatch.setattr("teleop.control.controller.Controller.tick", broken)
    with pytest.raises(ZeroDivisionError):
        main(RUN)


@pytest.mark.parametrize("command", [[], ["run"], ["estimate"]])
def test_help_has_an_example(capsys, command):
    assert main([*command, "--help"]) == 0
    assert "Example: teleop" in capsys.readouterr().out


def test_the_help_states_defaults_except_that_a_flag_is_off(capsys):
    assert main(["run", "--help"]) == 0
    out = capsys.readouterr().out
    assert "[default: 127.0.0.1]" in out
    assert "False" not in out


def test_the_command_alone_shows_commands_to_start_with_in_80_columns(capsys):
    assert main([]) == 0
    out = capsys.readouterr().out.splitlines()
    lines = [line for line in out if line.startswith("  teleop ")]
    assert [line.split()[1] for line in lines] == ["run", "run", "report", "estimate"]
    assert "--live" in lines[1]
    assert max(map(len, out)) < 80


@pytest.mark.parametrize("command", ["run", "estimate", "compare", "report"])
def test_the_help_has_groups_names_and_a_text_for_each_option(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    assert main([command, "--help"]) == 0
    out = capsys.readouterr().out
    for word in ("Estimation", "Output", "rls_sift", "kelvin-voigt"):
        assert word in out
    assert "Parameters" not in out
    lines = [line.strip(" │") for line in out.splitlines() if line.startswith("│ --")]
    assert len(lines) > 10
    for line in lines:
        option, _, text = line.partition("  ")
        assert text.strip()[:1] not in ("", "["), option


def test_commands_that_evaluate_a_file_have_the_same_options_of_estimation():
    def options(command):
        arguments = app.resolved_commands()[command].assemble_argument_collection()
        return {
            one.name for one in arguments if "Estimation" in [g.name for g in one.parameter.group]
        }

    shared = {"*", "--estimators", "--model", "--conditioning", "--bandwidth"}
    shared |= {"--force-lag", "--lost-motion"}
    assert options("run") == shared
    shared |= {"--preset", "--cube", "--whole"}
    shared |= {"--transmission", "--lost-motion", "--compliance"}
    assert options("compare") == options("report") == shared
    assert options("estimate") == shared | {"--cost"}


def test_a_script_completes_commands_and_options_in_a_shell():
    script = app.generate_completion(shell="bash")
    for word in ("compare", "--estimators", "autonomous"):
        assert word in script


def test_version_is_the_packages(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith(__version__)


def test_help_imports_nothing_heavy():
    code = (
        "import sys; from teleop.cli import app, main; main(['--help'])\n"
        "heavy = {'numpy', 'scipy', 'matplotlib', 'numba', 'can', 'serial'} & set(sys.modules)\n"
        "sys.exit(', '.join(heavy) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_estimation_of_a_table_imports_nothing_of_a_trial(tmp_path):
    t = np.arange(400) / 100.0
    x = 5e-3 - 4e-3 * np.cos(2.0 * np.pi * t)
    table = np.column_stack([t, 1e3 * x, 2000.0 * x])
    header = "time [s],position [mm],force [N]"
    file = tmp_path / "table.csv"
    np.savetxt(file, table, delimiter=",", header=header, comments="")
    code = (
        f"import sys; from teleop.cli import main; main(['estimate', {str(file)!r}])\n"
        "of_trials = {'sim_backend', 'pydantic', 'teleop.settings', 'teleop.control'}\n"
        "sys.exit(', '.join(of_trials & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_run_imports_scipy_which_takes_long_only_after_the_trial():
    arguments = ["run", "--clock", "virtual", "--duration", "0.2", "--no-record"]
    code = (
        "import sys; from teleop.cli import main; import teleop.trial.run as run\n"
        "found, run_trial = set(), run.run_trial\n"
        "def noted(*arguments, **options):\n"
        "    trial = run_trial(*arguments, **options)\n"
        "    found.update({'scipy', 'matplotlib', 'pandas'} & set(sys.modules), {'trial'})\n"
        "    return trial\n"
        f"run.run_trial = noted; main({arguments})\n"
        "found |= {'matplotlib', 'pandas'} & set(sys.modules)\n"
        "sys.exit(', '.join(found - {'trial'}) or 'trial' not in found)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


class Terminal:
    """A pseudo-terminal as standard error of a run."""

    def __init__(self, *arguments: str) -> None:
        pty = pytest.importorskip("pty", reason="needs a pseudo-terminal")
        self.leader, follower = pty.openpty()
        self.process = start_command(*arguments, stdout=subprocess.PIPE, stderr=follower)
        os.close(follower)
        self.text = b""

    def read(self) -> bytes:
        try:
            chunk = os.read(self.leader, 4096)
        except OSError:
            chunk = b""
        self.text += chunk
        return chunk


def test_the_progress_line_shows_live_estimates_and_is_cleared_at_the_end():
    terminal = Terminal("run", *SLOW, "--duration", "0.5", "--no-record")
    while terminal.read():
        pass
    terminal.process.communicate(timeout=20)
    assert terminal.process.returncode == 0
    assert re.search(rb"of 0.5 s  \w+ +k +\d+\xc2\xb1[1-9>]\d* N/m", terminal.text)
    assert terminal.text.endswith(b"\r\x1b[K\r")


def test_in_mimic_the_progress_line_has_the_mode_and_the_cue_to_follow():
    terminal = Terminal("run", *SLOW, "--condition", "mimic", "--duration", "0.5", "--no-record")
    while terminal.read():
        pass
    terminal.process.communicate(timeout=20)
    assert b"follow O with x" in terminal.text
    assert re.search(rb"\[Ctrl-C stops\]  active +0\.\d of 0\.5 s  \|[ xO@]+\|", terminal.text)


def test_a_termination_signal_ends_a_run_and_prints_its_results():
    """`test_faults.py` tests Ctrl-C."""
    terminal = Terminal("run", *SLOW, "--duration", "600", "--no-record", "--json")
    while not re.search(rb"0\.[1-9] of 600 s", terminal.text):
        assert terminal.read()
    terminal.process.terminate()
    out, _ = terminal.process.communicate(timeout=20)
    assert terminal.process.returncode == 130
    document = json.loads(out)
    assert document["interrupted"]
    assert 1 <= document["ticks"] < 10_000


def test_the_help_names_every_word_that_the_datum_accepts(capsys):
    assert main(["estimate", "--help"]) == 0
    text = " ".join(capsys.readouterr().out.replace("\u2502", " ").split())
    for word in ("auto", "contact", "file", "start", "mean"):
        assert f"({word})" in text
    assert "1.5mm,20N" in text


def test_an_unknown_backend_of_matplotlib_does_not_cost_the_figures(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "teleop", *RUN, "--plot", "a.png"],
        env=os.environ | {"MPLBACKEND": "nowhere"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "a.png").stat().st_size


def test_a_run_is_reproducible_through_the_command_line(capsys):
    documents = []
    for _ in range(2):
        assert main([*RUN, "--seed", "5", "--json"]) == 0
        documents.append(capsys.readouterr().out)
    assert documents[0] == documents[1]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "--duration", "1e308"], ["duration 1e+308 s", "at most 4294967 s"]),
        (["run", "--duration", "8h", "--no-record"], ["28800 s without a recording", "3600 s"]),
        (["run", "--bandwidth", "1e308"], ["bandwidth must be positive"]),
        (["run", "--conditioning", "foaw", "--bandwidth", "nan"], ["bandwidth"]),
        (["run", "--frequency", "990", "--condition", "autonomous"], ["990 Hz", "50 Hz"]),
        (["run", "--frequency", "1e308", "--condition", "autonomous"], ["at most a twentieth"]),
        (["run", "--force-lag", "-1"], ["force_lag -1 s: expected at least 0 s"]),
        (["run", "--force-lag", "1e9"], ["force lag 1e+09 s", "at most 0.5 s"]),
        (["run", "--force-lag", "0.01", "--conditioning", "foaw"], ["matched"]),
        (["run", "--record", f"{'x' * 300}.mcap"], ["cannot be written", "too long"]),
        (["estimate", "nothing.mcap"], ["nothing.mcap: no such file"]),
        (["estimate", "/"], ["/: expected a file"]),
        (["run", "stray"], ["unexpected argument 'stray'"]),
        (["estimate", "/dev/zero"], ["/dev/zero: expected a file"]),
    ],
)
def test_hostile_arguments_are_reported_in_one_line(
    refused, tmp_path, monkeypatch, arguments, words
):
    monkeypatch.chdir(tmp_path)
    error = refused(*arguments)
    for word in words:
        assert word in error


@pytest.mark.parametrize("option", ["--out", "--plot"])
def test_a_recording_is_never_overwritten_by_its_estimates(refused, tmp_path, option):
    path = tmp_path / "data.svg"
    path.write_text(GOOD)
    link = tmp_path / "link.svg"
    link.symlink_to(path)
    for output in (path, link):
        assert "would overwrite" in refused("estimate", str(path), option, str(output))
    assert path.read_text() == GOOD


def test_a_file_name_with_any_characters_is_drawn(tmp_path, capsys):
    path = tmp_path / "$x^$.csv"
    path.write_text(GOOD)
    assert main(["estimate", str(path), "--plot", str(tmp_path / "a.png"), "--json"]) == 0


def test_closed_streams_cause_no_traceback():
    command = f"{sys.executable} -m teleop run --clock virtual --duration 0.1 --no-record >&- 2>&-"
    assert subprocess.run(["sh", "-c", command], capture_output=True).returncode == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_for_standard_output_is_reported():
    command = ("run", "--clock", "virtual", "--duration", "0.1", "--no-record")
    with Path("/dev/full").open("w") as full:
        done = run_command(*command, stdout=full)
    assert done.returncode == 2
    assert done.stderr == "teleop: standard output: no space left on device\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize(
    ("options", "output", "reason"),
    [(["--json"], "/dev/full", "no space left on device"), ([], "", "broken pipe")],
)
def test_a_safety_stop_is_reported_also_without_standard_output(options, output, reason):
    # the limits of such a small depth are below the noise of the force sensor
    command = ("run", "--clock", "virtual", "--depth", "1e-3um", "--no-record", *options)
    read, write = os.pipe()
    os.close(read)
    with Path(output).open("w") if output else os.fdopen(write, "w") as lost_output:
        done = run_command(*command, stdout=lost_output)
    lost, stopped = done.stderr.splitlines()
    assert lost == f"teleop: standard output: {reason}"
    assert stopped.startswith("teleop: stopped before the drives were armed: force limit: ")
    assert done.returncode == 3


@pytest.mark.parametrize("columns", ["0", "1", "10", "79", "x", "-5"])
def test_help_is_printed_for_any_width(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)
    assert main(["run", "--help"]) == 0
    assert "--duration" in capsys.readouterr().out


def test_an_empty_depth_is_refused(refused):
    assert "expected a length with its unit" in refused("run", "--clock", "virtual", "--depth", "")


def test_a_file_of_random_bytes_is_reported_without_a_traceback(refused, tmp_path):
    rng = np.random.default_rng(0)
    path = tmp_path / "noise.csv"
    for _ in range(25):
        path.write_bytes(rng.integers(0, 256, int(rng.integers(1, 400)), dtype=np.uint8).tobytes())
        refused("estimate", str(path))


def test_a_reader_that_cannot_be_started_is_reported_in_one_line(tmp_path):
    """At most eight files may be open."""
    resource = pytest.importorskip("resource")
    done = subprocess.run(
        [sys.executable, "-m", "teleop", "run", "--rate", "50", "--record", "a.mcap"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (8, 8)),
    )
    assert done.returncode == 2
    assert done.stderr == "teleop: estimation: cannot be started: too many open files\n"
    assert [*tmp_path.iterdir()] == []
