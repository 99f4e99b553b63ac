"""What the site shows exists: commands, options, files, and the code that the build does not run.

The build of the site runs all other commands and code blocks, see `docs/_ext/blocks.py`.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from cyclopts import App

from teleop.cli import app, main

from .busy_machine import REPEATS, busy_cause
from .forked_command import ForkedCommand, start_command

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs").glob("*.md"))
GUIDES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "benchmarks/README.md")]
TESTED = (
    *("writing-a-driver", "writing-an-estimator", "writing-a-condition", "writing-a-signal"),
    *("writing-a-link", "writing-a-rig", "howto-notebook", "stations"),
)
"""Pages whose Python blocks have a test of their own."""
RETURN = 1.3
"""Time in which the emulated plant returns to its start [s]."""
KINDS = ("hardware", "emulator", "setup", "long")
FENCE = re.compile(r"^( *)(`{3,}|:{3,})(\S*) *([^\n]*)\n(.*?)^\1\2 *$", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A fenced block of a page."""

    kind: str
    argument: str
    text: str

    @property
    def commands(self) -> list[str]:
        """Its commands, each in one line without the prompt."""
        joined = re.sub(r" \\\n *", " ", self.text)
        lines = (line.strip() for line in joined.splitlines())
        return [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]

    @property
    def typed_lines(self) -> list[str]:
        """The lines of its commands as they are written, with the prompt."""
        typed = re.findall(r"^ *\$ (?:.* \\\n)*.*$", self.text, re.MULTILINE)
        return [line for command in typed for line in command.splitlines()]


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page, those within others as well."""
    found = []
    for _, _, kind, argument, text in FENCE.findall(page.read_text(encoding="utf-8")):
        found.append(Block(kind, argument, text))
        found += [Block(*inner[2:]) for inner in FENCE.findall(text)]
    return found


def not_run(page: Path) -> list[str]:
    """The commands of a page that the build does not run."""
    return [c for b in blocks(page) if b.kind in ("{commands}", "console") for c in b.commands]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_code_is_run_or_says_why_not(page):
    for block in blocks(page):
        if block.kind == "{commands}":
            assert block.argument in KINDS
        plain = ("console", "sh", "bash", "shell")
        assert block.kind not in plain, "use {run}, or {commands} with the reason"
        if page.stem not in TESTED:
            assert block.kind != "python", "use {run-python}"
    assert not re.search(r"^    (\$ )?teleop ", page.read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.parametrize("page", [*PAGES, *GUIDES], ids=lambda page: page.stem)
def test_the_lines_of_commands_have_at_most_80_columns(page):
    indented = re.findall(
        r"^ {4,}(?:teleop|\.venv|python3) (?:.* \\\n)*.*$",
        FENCE.sub("", page.read_text(encoding="utf-8")),
        re.MULTILINE,
    )
    typed = [line for block in blocks(page) for line in block.typed_lines]
    for line in [*typed, *(line for command in indented for line in command.splitlines())]:
        assert len(line) <= 80, line


@pytest.mark.parametrize("page", [*PAGES, *GUIDES], ids=lambda page: page.stem)
def test_commands_that_are_not_run_exist_with_their_options(page):
    for line in not_run(page):
        for command in re.split(r" (?:&&|\|) ", line):
            program, *arguments = shlex.split(command)
            if Path(program).name == "teleop":
                app.parse_args(arguments, exit_on_error=False, print_error=False)
            elif Path(program).name == "python" and arguments[0].endswith(".py"):
                script = (ROOT / arguments[0]).read_text(encoding="utf-8")
                assert all(f'"{word}"' in script for word in arguments if word.startswith("--"))


def functions(parent: App) -> list[Callable[..., object]]:
    """Return the functions of all commands."""
    found = []
    for name, command in parent.resolved_commands().items():
        if not name.startswith("-"):
            found += [command.default_command] if command.default_command else []
            found += functions(command)
    return found


def test_the_example_in_the_help_of_a_command_is_on_one_line_of_80_columns():
    examples = [
        example
        for function in functions(app)
        for example in re.findall(r"Example: `[^`]*`", function.__doc__ or "")
    ]
    assert len(examples) > 15
    for example in examples:
        assert "\n" not in example
        assert len(example.replace("`", "")) <= 80, example


def commands(parent: App, path: tuple[str, ...] = ()) -> dict[tuple[str, ...], set[str]]:
    """Options of every command, by the words that call it."""
    found = {}
    for name, command in parent.resolved_commands().items():
        if name.startswith("-"):
            continue
        if command.default_command:
            arguments = command.assemble_argument_collection()
            found[(*path, name)] = {n for argument in arguments for n in argument.names}
        found |= commands(command, (*path, name))
    return found


COMMANDS = commands(app)
SCRIPTS = "".join(path.read_text(encoding="utf-8") for path in ROOT.glob("benchmarks/*.py"))
OPTIONS = {"--help", "--install-completion", "--version"}.union(
    *COMMANDS.values(), re.findall(r'"(--[a-z-]+)"', SCRIPTS)
)
"""Every option of every command, and of every benchmark."""


def test_usage_lines_do_not_depend_on_how_the_site_is_built(tmp_path):
    conf = ROOT / "docs" / "conf.py"
    (tmp_path / "builder.py").write_text(
        f"exec(open({str(conf)!r}).read(), {{'__file__': {str(conf)!r}}})\n"
        "from cyclopts.docs.rst import generate_rst_docs\n"
        "from teleop.cli import app\n"
        "print(generate_rst_docs(app))\n"
    )
    command = [sys.executable, "-m", "builder"]
    text = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert "\n    teleop run [OPTIONS]\n" in text
    assert "-m builder" not in text


@pytest.mark.parametrize("page", [*PAGES, *GUIDES], ids=lambda page: page.stem)
def test_options_in_the_text_exist(page):
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    for code in re.findall(r"`([^`]+)`", text):
        named = set(re.findall(r"--[a-z-]+", code))
        assert named <= OPTIONS, code
        words = tuple(code.removeprefix("teleop ").split())
        for path, known in COMMANDS.items():
            if words[: len(path)] == path:
                assert named <= known | {"--help"}, code


@pytest.mark.parametrize("page", [*PAGES, *GUIDES], ids=lambda page: page.stem)
def test_files_in_the_text_exist(page):
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    folders = "estimation|drivers|sim_backend|teleop|tests|docs|examples|rigs|benchmarks"
    for path in re.findall(rf"`((?:{folders})/(?:[\w.-]+/)*(?:[\w-]+\.\w+)?)`", text):
        assert path.startswith("docs/_build") or (ROOT / path).exists(), path


def test_every_benchmark_and_every_result_is_listed():
    listed = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    for path in [*(ROOT / "benchmarks").glob("*.py"), *(ROOT / "benchmarks/results").iterdir()]:
        assert f"`{path.name}`" in listed


def test_every_estimator_has_a_section_with_a_figure():
    from estimation.registry import BUILT_IN

    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for name in BUILT_IN:
        assert f"({name})=\n## `{name}`" in text
        assert f"```{{estimator-figure}} {name}\n" in text


def emulator_commands() -> list[str]:
    """The commands of the page on the emulated board, each emulator with those that follow it."""
    return [
        command
        for block in blocks(ROOT / "docs" / "first-hour-board.md")
        if (block.kind, block.argument) == ("{commands}", "emulator")
        for command in block.commands
    ]


@pytest.mark.real_time
def test_the_first_hour_with_a_board_works(tmp_path, undemanding_rig, monkeypatch, capsys):
    """Rate and time limits are those of `undemanding`; `test_agreement.py` tests the file's own.

    The count-in and the strokes of the check are shorter than usual.
    """
    pytest.importorskip("pty", reason="there are no pseudo-terminals on this system")
    monkeypatch.setattr("teleop.rig.drive_check.STROKE_TIMES", (0.4,) * 4)
    monkeypatch.setattr("teleop.settings.ranges.COUNT_IN", 0.5)
    (tmp_path / "rigs").mkdir()
    undemanding_rig("serial-board", tmp_path / "rigs" / "serial-board.toml")
    monkeypatch.chdir(tmp_path)
    emulator, has_moved = None, False
    try:
        for line in emulator_commands():
            program, *command = shlex.split(line)
            assert program == "teleop"
            if "emulate" in command:
                end(emulator)
                emulator = start_command(*command, stdout=subprocess.PIPE)
                assert "emulated" in emulator.stdout.readline()
                has_moved = False
            else:
                moves = "run" in command or "--move" in command
                if moves and has_moved:
                    time.sleep(RETURN)
                works(command, capsys)
                has_moved = moves
    finally:
        end(emulator)


def end(emulator: ForkedCommand | subprocess.Popen[str] | None) -> None:
    """Stop an emulator, if there is one."""
    if emulator:
        emulator.terminate()
        emulator.communicate(timeout=10)
        assert emulator.returncode == 0


def works(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Run a command of real time, briefly; again if the machine was too slow for the rig."""
    if "run" in command:
        command = [*command, "--duration", "2.5" if "mimic" in command else "0.5", "--yes"]
    elif "check" in command:
        command = [word for word in command if word not in ("--duration", "5s")]
        command += ["--seconds", "0.3", "--duration", "0.3"]
        command += ["--yes"] if "--move" in command else []
    for _ in range(1 + REPEATS):
        code, error = main(command), capsys.readouterr().err
        if not busy_cause(error, on_devices=True):
            break
        time.sleep(RETURN)
    assert code == 0, (command, error)
