"""The `teleop` command: reads its arguments, and tells bad input from a defect."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from cyclopts import App, CycloptsError, UnusedCliTokensError

from drivers import RigError
from teleop.commands.config import config
from teleop.commands.estimate import estimate
from teleop.commands.export import export
from teleop.commands.lag import lag
from teleop.commands.recover import recover
from teleop.commands.report import report
from teleop.commands.reproduce import reproduce
from teleop.commands.rig import rig
from teleop.commands.run import run
from teleop.commands.series import series
from teleop.errors import InputError, SafetyStop
from teleop.interruption import Interruption
from teleop.printable import complain, give_up_output
from teleop.trial.realtime import clear_of_claimed_processors


def installed_version() -> str:
    """Version of the installed package."""
    from importlib.metadata import version

    return version("teleop")


app = App(
    name="teleop",
    help=(
        "Run a 1-DOF telemanipulator and estimate the stiffness and damping of what it "
        "touches.\n\nExample: teleop run --condition mimic --cube hard"
    ),
    version=installed_version,
    help_format="plaintext",
)
for command in (run, estimate, report, export, recover, lag, reproduce):
    app.command(command, help_format="markdown")
app.command(config)
app.command(series, help_format="markdown")
app.command(rig)


NARROWEST = 20
"""Fewest columns for which help is laid out; its tables have no room in fewer."""


def prepare_streams() -> None:
    """Make closed streams harmless, and let no narrow encoding or width stop an output."""
    columns = os.environ.get("COLUMNS", "")
    if columns.isdecimal() and int(columns[:9]) < NARROWEST:
        del os.environ["COLUMNS"]  # 0 is what a terminal of unknown size may set
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115
        elif hasattr(getattr(sys, name), "reconfigure"):
            getattr(sys, name).reconfigure(errors="backslashreplace")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    The exit code is 0; 2 for bad input and 3 for a stop for safety, each with one line; 130 after
    Ctrl-C. A defect raises, which ends in a traceback and 1.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C or another signal asked to end, and the command does not handle it.
    """
    prepare_streams()
    try:
        with Interruption(), clear_of_claimed_processors():
            code = app(
                arguments, exit_on_error=False, print_error=False, result_action="return_value"
            )
        sys.stdout.flush()
    except UnusedCliTokensError as error:
        unused = " ".join(error.unused_tokens or [])
        complain(f"unexpected argument {unused!r}: see --help")
        return 2
    except SafetyStop as error:
        complain(str(error))
        return 3
    except (InputError, CycloptsError, RigError) as error:
        for line in str(error).splitlines() or [type(error).__name__]:
            complain(line)
        return 2
    except BrokenPipeError as error:
        give_up_output(error)
        return 1
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EIO) or error.filename:
            raise
        with contextlib.suppress(OSError):
            complain(give_up_output(error))
        return 2
    return code or 0
