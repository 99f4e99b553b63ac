"""Files of commands must be regular, and are overwritten on request only."""

from __future__ import annotations

import os
import signal
import socket
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from teleop.cli import main
from teleop.errors import InputError
from teleop.files import check_outputs, new_file, write_text
from teleop.rig.emulation import is_unchanged, with_checksum

RIG = Path(__file__).parents[2] / "rigs" / "serial-board.toml"


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    path = tmp_path_factory.mktemp("trial") / "trial.mcap"
    command = ["run", "--clock", "virtual", "--duration", "0.3", "--record", str(path), "--json"]
    assert main(command) == 0
    return path


@pytest.fixture(autouse=True)
def folder(tmp_path, trial, monkeypatch):
    """The working folder of the test, with a recording and a table."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "trial.mcap").write_bytes(trial.read_bytes())
    t = np.arange(0.0, 3.0, 0.01)
    rows = (f"{a:.3f},{np.sin(9 * a):.6f},{2 * np.sin(9 * a + 0.1):.6f}\n" for a in t)
    (tmp_path / "sine.csv").write_text("Time [s],Position [mm],Force [N]\n" + "".join(rows))
    return tmp_path


@pytest.fixture(autouse=True)
def never_hangs():
    """A command that waits for a FIFO is interrupted."""

    def interrupt(*_):
        raise TimeoutError("the command waits for a file")

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


OUTPUTS = {
    "export": ("trial.csv", ["export", "trial.mcap"]),
    "export --out": ("a.mat", ["export", "trial.mcap", "--out", "a.mat"]),
    "report": ("trial.html", ["report", "trial.mcap"]),
    "report --out": ("a.html", ["report", "sine.csv", "--out", "a.html"]),
    "estimate --out": ("a.csv", ["estimate", "sine.csv", "--out", "a.csv"]),
    "estimate --plot": ("a.svg", ["estimate", "sine.csv", "--plot", "a.svg"]),
    "rig tare": ("tare.json", ["rig", "tare"]),
    "rig tare --out": ("a.json", ["rig", "tare", "--out", "a.json"]),
    "run --plot": (
        "a.svg",
        ["run", "--clock", "virtual", "--duration", "0.3", "--no-record", "--plot", "a.svg"],
    ),
}
"""A file, and the command that writes it."""
REFUSED_OUTPUTS = OUTPUTS | {
    "rig emulate": ("run.toml", ["rig", "emulate", str(RIG)]),
    "rig emulate --out": ("a.toml", ["rig", "emulate", str(RIG), "--out", "a.toml"]),
    "reproduce": ("reproduction/table1.csv", ["reproduce"]),
    "reproduce, a figure": ("a/figure4.png", ["reproduce", "--out", "a"]),
    "run --record": (
        "a.mcap",
        ["run", "--clock", "virtual", "--duration", "0.3", "--record", "a.mcap"],
    ),
    "recover": ("trial-recovered.mcap", ["recover", "trial.mcap"]),
}
by_command = pytest.mark.parametrize("command", REFUSED_OUTPUTS)


def special_files(folder):
    """Return a file of each kind that is not regular."""
    os.mkfifo(folder / "fifo")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind("socket")
    (folder / "folder").mkdir()
    return {
        folder / "fifo": "a fifo",
        folder / "socket": "a socket",
        folder / "folder": "a folder",
        Path("/dev/zero"): "a device",
    }


@by_command
def test_a_file_that_exists_is_not_overwritten(refused, trial, folder, command):
    name, arguments = REFUSED_OUTPUTS[command]
    if command == "recover":
        (folder / "trial.mcap").write_bytes(trial.read_bytes()[:-2000])
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("precious")
    assert f"{name}: exists already" in refused(*arguments)
    assert path.read_text() == "precious"


@by_command
def test_a_link_without_a_target_is_not_overwritten(refused, trial, folder, command):
    name, arguments = REFUSED_OUTPUTS[command]
    if command == "recover":
        (folder / "trial.mcap").write_bytes(trial.read_bytes()[:-2000])
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.symlink_to(folder / "nothing")
    refused(*arguments)
    assert path.is_symlink()
    assert not (folder / "nothing").exists()


@pytest.mark.usefixtures("without_drawings")
@pytest.mark.parametrize("command", OUTPUTS)
def test_overwrite_replaces_a_file_as_a_whole(folder, capsys, command):
    name, arguments = OUTPUTS[command]
    (folder / name).write_text("old")
    assert main([*arguments, "--overwrite"]) == 0
    assert (folder / name).stat().st_size > 100
    assert not (folder / name).read_bytes().startswith(b"old")
    assert not [*folder.glob("**/.*")]


def test_a_recording_is_never_overwritten(refused, folder):
    before = (folder / "trial.mcap").read_bytes()
    for command in (
        ["run", "--clock", "virtual", "--duration", "0.1", "--record", "trial.mcap"],
        ["rig", "tare", "--out", "trial.mcap"],
    ):
        assert "a recording is never overwritten" in refused(*command, "--overwrite")
    assert (folder / "trial.mcap").read_bytes() == before


@by_command
def test_an_output_that_is_not_a_regular_file_is_refused_immediately(
    refused, trial, folder, command
):
    name, arguments = REFUSED_OUTPUTS[command]
    if command == "recover":
        (folder / "trial.mcap").write_bytes(trial.read_bytes()[:-2000])
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    os.mkfifo(path)
    error = refused(*arguments, *([] if command == "recover" else ["--overwrite"]))
    assert (
        "exists already" if command == "recover" else "expected a file, this is a FIFO"
    ) in error
    assert path.is_fifo()


@pytest.mark.parametrize(
    "arguments",
    [
        ["estimate", "{}"],
        ["report", "{}", "--out", "a.html"],
        ["export", "{}", "--out", "a.csv"],
        ["recover", "{}", "--out", "a.mcap"],
        ["lag", "{}"],
        ["rig", "check", "{}"],
        ["rig", "emulate", "{}"],
        ["rig", "tare", "--rig", "{}"],
        ["run", "--rig", "{}"],
        ["run", "--tare", "{}"],
    ],
    ids=" ".join,
)
def test_an_input_that_is_not_a_regular_file_is_refused_immediately(refused, folder, arguments):
    for path, kind in special_files(folder).items():
        error = refused(*(word.format(path) for word in arguments))
        assert f"{path}: expected a file, this is {kind}" in error.replace("FIFO", "fifo")


def test_a_recording_that_is_not_a_regular_file_is_refused_immediately(refused, folder):
    for path in special_files(folder):
        link = folder / "link.mcap"
        link.unlink(missing_ok=True)
        link.symlink_to(path)
        assert "expected a file, this is a" in refused("estimate", link)


def test_a_dbc_file_of_a_rig_that_is_not_a_regular_file_is_refused(refused, folder):
    text = (RIG.parent / "dbc-sensor.toml").read_text(encoding="utf-8")
    assert 'file = "dbc-sensor.dbc"' in text
    for path in special_files(folder):
        (folder / "rig.toml").write_text(text.replace("dbc-sensor.dbc", str(path)))
        assert "expected a file, this is a" in refused("rig", "check", "rig.toml")


def test_an_emulator_replaces_its_own_file_unless_it_was_edited(folder):
    path = folder / "run.toml"
    path.write_text(with_checksum("a = 1\n", "teleop rig emulate"))
    assert is_unchanged(path, "teleop rig emulate")
    assert not is_unchanged(path, "another")
    path.write_text(path.read_text() + "b = 2\n")
    assert not is_unchanged(path, "teleop rig emulate")
    assert not is_unchanged(folder / "nothing", "teleop rig emulate")


@pytest.mark.skipif(os.name != "posix", reason="removes the working folder")
def test_a_working_folder_that_was_removed_is_reported(refused, folder, monkeypatch):
    gone = folder / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    assert "the working folder: no such file or directory" in refused("estimate", "../sine.csv")


def test_two_outputs_of_one_name_are_refused(refused, folder):
    (folder / "b.svg").symlink_to(folder / "a.svg")
    error = refused("estimate", "sine.csv", "--out", "a.svg", "--plot", "a.svg", "--overwrite")
    assert "would overwrite" in error


def test_a_file_that_appears_during_the_work_is_kept(folder):
    path = folder / "a.txt"
    check_outputs(path)
    files = ExitStack()
    files.enter_context(new_file(path)).write(b"new")
    path.write_text("precious")
    with pytest.raises(InputError, match="exists already"):
        files.close()
    assert path.read_text() == "precious"
    assert not [*folder.glob(".*")]


def test_after_an_error_no_partial_file_remains_and_an_existing_one_is_kept(folder):
    for overwrite in (False, True):
        path = folder / f"{overwrite}.txt"
        if overwrite:
            path.write_text("precious")
        with pytest.raises(AttributeError), new_file(path, overwrite) as file:
            file.no_such_attribute("half")
        assert path.exists() is overwrite
        assert not [*folder.glob(".*")]
    assert path.read_text() == "precious"


def test_a_replaced_file_keeps_its_permissions_and_a_link_leads_to_the_new_one(folder):
    path, link = folder / "a.txt", folder / "link.txt"
    path.write_text("old")
    path.chmod(0o600)
    link.symlink_to(path)
    write_text(link, "new", overwrite=True)
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == 0o600
    assert link.is_symlink()


@pytest.mark.parametrize(
    ("command", "out"), [("report", "page.mcap"), ("recover", "whole.csv"), ("run", "run.csv")]
)
def test_an_output_with_the_ending_of_another_format_is_refused(refused, folder, command, out):
    arguments = ["--record", out] if command == "run" else ["run.mcap", "--out", out]
    assert "expected a file ending in" in refused(command, *arguments)
    assert not (folder / out).exists()


def test_reproduce_refuses_before_its_trials(refused, folder, monkeypatch):
    trials = "teleop.studies.paper.reproduction.reproduce"
    monkeypatch.setattr(trials, lambda *_: pytest.fail("trials ran"))
    (folder / "file").write_text("")
    assert "expected a folder" in refused("reproduce", "--out", "file")
    (folder / "study").mkdir()
    (folder / "study" / "index.html").write_text("precious")
    assert "exists already" in refused("reproduce", "--out", "study")
