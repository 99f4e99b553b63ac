"""What the README shows is what happens."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from teleop.cli import main

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
(BLOCK,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
COMMANDS = [
    shlex.split(line)[1:]
    for line in re.findall(r"^ +(teleop .*)$", re.sub(r" \\\n *", " ", README), re.MULTILINE)
]
(RESULT,) = re.findall(r"```\n(free, soft cube.*?)```", README, re.DOTALL)
VIRTUAL = ("--clock", "virtual")


def test_it_is_short_and_has_the_two_set_up_lines_within_the_first_screen():
    lines = README.splitlines()
    assert len(lines) <= 150
    assert sum("python3 -m venv .venv" in line for line in lines[:20]) == 2


def test_the_notebook_example_prints_what_the_readme_says(capsys):
    exec(compile(BLOCK, "README.md", "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == 3
    for line in printed:
        assert f"    {line}\n" in README


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with what a clone has."""
    folder = tmp_path_factory.mktemp("readme")
    (folder / "examples").symlink_to(ROOT / "examples")
    return folder


def test_the_first_minute_prints_what_the_readme_says(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["run", *VIRTUAL, "--no-record"]) == 0
    assert capsys.readouterr().out.startswith(RESULT)


def test_the_commands_of_the_readme_work_in_their_order(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    # To compile all estimators takes longer than to interpret them here.
    monkeypatch.setattr("estimation.compiled.choice.is_compiled", lambda samples: False)
    for command in COMMANDS:
        if command[0] == "reproduce":
            continue  # run by tests/teleop/studies/paper/test_reproduction.py
        options = VIRTUAL if command[0] == "run" else ()
        if options and "trial.mcap" not in command:  # its result is not shown
            options = (*options, "--rate", "250")  # for a shorter test
        assert main([*command, *options]) == 0, command
        printed = capsys.readouterr().out
        assert printed, command
        if command == ["estimate", "trial.mcap"]:
            assert printed.startswith("trial.mcap: k and b can be used\n  stiffness k = 2490.4 N/m")
    assert ["estimate", "trial.mcap"] in COMMANDS


def test_links_lead_to_files():
    for target in re.findall(r"\]\((?!http)([^)#]+)", README):
        assert (ROOT / target).exists(), target
