"""The command `teleop`, which runs a subcommand and converts errors to messages and exit codes."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, cast

from cyclopts import App, CycloptsError, Parameter, UnusedCliTokensError

from drivers import NotStoppedError, RigError
from teleop.commands.compare import compare
from teleop.commands.config import config
from teleop.commands.estimate import estimate
from teleop.commands.export import export
from teleop.commands.lag import lag
from teleop.commands.list_installed import list_installed
from teleop.commands.live import live
from teleop.commands.machine import machine
from teleop.commands.merge import merge
from teleop.commands.recover import recover
from teleop.commands.report import report
from teleop.commands.reproduce import reproduce
from teleop.commands.rig import rig
from teleop.commands.run import run
from teleop.commands.series import series
from teleop.commands.station import station
from teleop.commands.sweep import sweep
from teleop.errors import InputError, SafetyStop
from teleop.interruption import Interruption
from teleop.printable import discard_output, print_error
from teleop.trial.realtime import avoid_claimed_processors


def installed_version() -> str:
    """The version and the commit, found only when `--version` asks for them."""
    from teleop.software import software

    return software()


def shown_default(value: Any) -> str | None:
    """Return the default of an option for its help; None for an option that is off by default."""
    return None if value is None or value is False else str(value)


app = App(
    name="teleop",
    help=(
        "Run a 1-DOF telemanipulator and estimate the stiffness and damping of its "
        "environment.\n\nExample: teleop run --condition mimic --cube hard"
    ),
    version=installed_version,
    help_format="markdown",
    default_parameter=Parameter(
        negative="",  # no --no-json, no --empty-fault
        show_default=cast(Callable[[Any], str], shown_default),
    ),
)
for command in (
    run,
    estimate,
    compare,
    report,
    export,
    recover,
    lag,
    reproduce,
    config,
    series,
    station,
    merge,
    sweep,
    live,
    rig,
    machine,
):
    app.command(command)
app.command(list_installed, name="list")
app.register_install_completion_command(
    help="Install the completion of commands and options for this shell (bash, zsh or fish)."
)
START = """\
teleop palpates with a 1-DOF telemanipulator and estimates stiffness and
damping. To start:

  teleop run --record trial.mcap    palpate a simulated cube for ten seconds
  teleop run --live --open          palpate in a page of the browser
  teleop report trial.mcap          write its results and figures to trial.html
  teleop estimate FILE              evaluate your own recording (CSV, ...)

All commands: teleop --help. Options of a command: teleop COMMAND --help.
"""
"""Printed by `teleop` without arguments."""
NARROWEST = 20
"""Smallest width at which the tables of the help can be drawn [characters]."""


def prepare_streams() -> None:
    """Change the standard streams so that reading lines from them and printing does not fail.

    A closed stream is replaced by the null device. A character that the encoding of the stream does
    not contain is printed, or read, as an escape sequence.
    """
    columns = os.environ.get("COLUMNS", "")
    if columns.isdecimal() and int(columns[:9]) < NARROWEST:
        del os.environ["COLUMNS"]  # its value is 0 on some terminals of unknown size
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open(mode))  # noqa: SIM115
        elif hasattr(getattr(sys, name), "reconfigure"):
            getattr(sys, name).reconfigure(errors="backslashreplace")


def ignore_backend() -> None:
    """Remove the environment variable MPLBACKEND, which selects the part that draws windows.

    The commands open no window. With an unknown name, matplotlib could not be imported.
    """
    os.environ.pop("MPLBACKEND", None)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command with these arguments (default: those of the process); return its exit code.

    The exit code is 0 for success, 2 for bad input, a failure of the rig or a full disk, 3 for a
    safety stop, and 130 if the command itself handled Ctrl-C. It is 1 if the program that reads
    standard output through a pipe has closed the pipe. In these cases no traceback is printed.
    Other exceptions are errors in this program. They are not caught, except SystemExit, which code
    of another package can raise: one line names its place, and the exit code is 1.

    KeyboardInterrupt is raised by Ctrl-C, or another signal that ends a program, if the command did
    not handle it. The exit code of the program is then also 130.
    """
    prepare_streams()
    ignore_backend()
    try:
        with Interruption(), avoid_claimed_processors():
            if not (sys.argv[1:] if arguments is None else arguments):
                sys.stdout.write(START)
                return 0
            code = app(
                arguments, exit_on_error=False, print_error=False, result_action="return_value"
            )
        sys.stdout.flush()
    except UnusedCliTokensError as error:
        unused = " ".join(error.unused_tokens or [])
        print_error(f"unexpected argument {unused!r}: see --help")
        return 2
    except (SafetyStop, NotStoppedError) as error:
        print_error(str(error))
        return 3
    except (InputError, CycloptsError, RigError) as error:
        for line in str(error).splitlines() or [type(error).__name__]:
            print_error(line)
        return 2
    except BrokenPipeError as error:
        discard_output(error)
        return 1
    except SystemExit as error:  # raised by code of another package
        if isinstance(error.__context__, KeyboardInterrupt):  # cyclopts has converted it
            raise
        if isinstance(error.__context__, BrokenPipeError):  # rich has converted it
            discard_output(error.__context__)
            return 1
        frame = traceback.extract_tb(error.__traceback__)[-1]
        print_error(f"{frame.filename}, line {frame.lineno}: ended the program: {error!r}")
        return 1
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EIO) or error.filename:
            raise
        with contextlib.suppress(OSError):
            print_error(discard_output(error))
        return 2
    return code or 0
