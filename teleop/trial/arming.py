"""Check the required settings, and ask a person before the drives are armed."""

from __future__ import annotations

import contextlib
import sys

from drivers.posix import posix_module
from drivers.rig_file import RigFile
from teleop.errors import InputError
from teleop.output.console import terminal_width
from teleop.printable import print_error, wrapped
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.stop_switch import StopSwitch, is_foreground


def check_stated(settings: TrialSettings) -> None:
    """Check that the settings of a trial on a hardware rig contain a specimen and a depth."""
    missing: list[str] = []
    if not settings.has_slave:
        return
    if not settings.specimen:
        missing.append("a specimen (--specimen NAME, or specimen in the configuration)")
    if settings.depth is None:
        missing.append("a depth (--depth 3mm, or depth_m in the configuration)")
    custom = settings.custom_rig
    if missing and (settings.rig or (custom and custom.plug_in)):
        raise InputError(f"rig {settings.rig_name!r}: expected also {' and '.join(missing)}")


def check_person(rig: RigFile | str, action: str = "arm the drives") -> None:
    """Check that a person can answer a question at the terminal of this process.

    `rig`: the rig file, or the name of the rig.
    """
    if not is_foreground():
        name = rig if isinstance(rig, str) else rig.sections.name
        raise InputError(
            f"rig {name!r}: standard input is not a terminal, so that nobody can "
            f"{action}: expected --yes, with which nobody is asked"
        )


def answer(text: str) -> str | None:
    """Show a question on standard error, and return the line that a person types.

    The result is None if standard input has ended, for example because the terminal was closed.

    All keys that were typed before the question is shown are discarded: they are not an answer.
    """
    discard_typed_ahead()
    try:
        print(text, file=sys.stderr, flush=True)
        line = sys.stdin.readline()
    except OSError:  # the terminal was closed
        return None
    return line.removesuffix("\n") if line else None


def discard_typed_ahead() -> None:
    """Discard all keys that a person typed in the terminal and that were not read yet."""
    termios = posix_module("termios")
    if termios and is_foreground():
        with contextlib.suppress(termios.error):  # the terminal was closed
            termios.tcflush(sys.stdin, termios.TCIFLUSH)


def is_armed(rig: RigFile | str, text: str, yes: bool = False) -> bool:
    """Ask the person at the terminal whether to arm the drives, and return the answer.

    The result is True if the person presses only Enter. This function does not arm the drives.
    `rig`: the rig file, or the name of the rig.
    """
    if yes:
        return True
    check_person(rig)
    if answer(f"{text}\nEnter arms the drives, any other answer ends.") == "":
        return True
    print_error("not armed: nothing was moved")
    return False


def arming_text(settings: TrialSettings) -> str:
    """Return a text for the person who arms the drives: what the trial is, and how to stop it."""
    limits = settings.limits
    depth = "not stated" if settings.depth is None else f"{settings.depth * 1e3:g} mm"
    motion = (
        f"{settings.condition_name}, {settings.palpated}, {settings.duration:g} s, depth {depth}, "
        f"force limit {limits.soft_force:g} N, stop at {limits.hard_force:g} N"
    )
    return motion_text(settings.rig_name, motion)


def motion_text(rig: str, motion: str) -> str:
    """Return a text for the person who arms the drives: how the rig will move, and how to stop it.

    The lines of the text are not wider than the terminal.
    """
    text = f"{rig}: {motion}.\nWhile it runs: {StopSwitch(key=True).instructions}."
    return wrapped(text, terminal_width())
