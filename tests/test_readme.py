"""What the README shows is what happens."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import time
from pathlib import Path

import pytest

from teleop.cli import main

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
RECORDING = (ROOT / "docs" / "recording.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
LINES = [
    line.partition("#")[0].strip()
    for line in [*README.splitlines(), *RECORDING.splitlines()]
    if line.startswith("    teleop ")
]
COMMANDS = [shlex.split(line)[1:] for line in dict.fromkeys(LINES)]


QUICKLY = ("--clock", "virtual", "--duration", "3")


def without(command: list[str], *options: str) -> list[str]:
    """A command less some options and their values."""
    dropped = {i + j for i, word in enumerate(command) if word in options for j in (0, 1)}
    return [word for i, word in enumerate(command) if i not in dropped]


def test_the_notebook_example_prints_what_the_readme_says(capsys):
    exec(compile(BLOCKS[0], "README.md", "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == 3
    for line in printed:
        assert f"    {line}\n" in README


def test_the_other_example_runs():
    namespace: dict = {}
    exec(compile(BLOCKS[1], "README.md", "exec"), namespace)
    assert set(namespace["trial"].estimates) == {"rls", "ai", "me"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("readme")


@pytest.fixture(scope="module")
def emulate(folder):
    """Starts `teleop rig emulate` in the background, once."""
    running = []

    def start(arguments):
        pytest.importorskip("pty", reason="there are no pseudo-terminals on this system")
        process = subprocess.Popen(
            [sys.executable, "-m", "teleop", "rig", "emulate", *arguments],
            cwd=folder,
            stdout=subprocess.PIPE,
            text=True,
        )
        running.append(process)
        assert "emulated" in process.stdout.readline()

    yield start
    for process in running:
        process.terminate()
        process.communicate(timeout=10)
        assert process.returncode == 0


def on_the_emulated_rig(command):
    """Run a command of real time; once more where the machine was taken away meanwhile."""
    pytest.importorskip("pty", reason="there are no pseudo-terminals on this system")
    command = [*command, *(("--duration", "1.5") if command[0] == "run" else ("--seconds", "0.5"))]
    for _ in range(4):
        time.sleep(1.5 if command[0] == "run" else 0.0)  # until the plant is back at its start
        run = [sys.executable, "-m", "teleop", *command]
        done = subprocess.run(run, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            break
    return done.returncode


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_a_command_of_the_readme_works(command, folder, emulate, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    if command[:2] == ["rig", "emulate"]:
        emulate([ROOT / word if word.startswith("rigs/") else word for word in command[2:]])
        return
    if "run.toml" in command:
        assert on_the_emulated_rig(command) == 0
        return
    if command[0] == "reproduce":
        pytest.skip("run by tests/teleop/paper/test_reproduce.py")
    if command[0] == "run":
        command = [*without(command, "--clock", "--duration"), *QUICKLY]
    assert main(command) == 0
    assert capsys.readouterr().out


def test_the_example_of_the_docs_reads_that_recording(folder, monkeypatch):
    monkeypatch.chdir(folder)
    (block,) = re.findall(r"```python\n(.*?)```", RECORDING, re.DOTALL)
    namespace: dict = {}
    exec(compile(block, "recording.md", "exec"), namespace)
    assert namespace["recording"].units["contact_force"] == "N"
    assert len(namespace["force"]) > 3000
