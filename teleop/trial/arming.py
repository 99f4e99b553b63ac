"""Arming: the settings that a person must give, and the confirmation, before devices move."""

from __future__ import annotations

import sys

from teleop.errors import InputError
from teleop.trial.settings import TrialSettings
from teleop.trial.stop_key import is_foreground
from teleop.trial.stop_switch import StopSwitch


def check_stated(settings: TrialSettings) -> None:
    """Check that a trial on a rig of devices states its specimen and its depth.

    Raises
    ------
    InputError
        The settings have a rig of devices, and no specimen or no depth.
    """
    missing = []
    if not settings.specimen:
        missing.append("a specimen (--specimen NAME, or specimen in the configuration)")
    if settings.depth is None:
        missing.append("a depth (--depth 3mm, or depth_m in the configuration)")
    if settings.rig and missing:
        raise InputError(f"rig {settings.rig_name!r}: expected also {' and '.join(missing)}")


def discard_typed_ahead() -> None:
    """Discard keys that were typed before a prompt, so that they are not taken as its answer."""
    try:
        import termios
    except ImportError:  # a system without these terminals
        return
    if is_foreground():
        termios.tcflush(sys.stdin, termios.TCIFLUSH)


def ask_to_arm(settings: TrialSettings) -> bool:
    """Ask the person at the terminal to arm the drives, and return whether the answer was Enter.

    Raises
    ------
    InputError
        Standard input is not a terminal of this process.
    """
    if not is_foreground():
        raise InputError(
            f"rig {settings.rig_name!r}: standard input is not a terminal, so that nobody can arm "
            "the drives: expected --yes, which arms them without asking"
        )
    discard_typed_ahead()
    print(arming_text(settings), file=sys.stderr)
    print("Enter arms the drives, any other answer ends.", file=sys.stderr)
    return sys.stdin.readline() == "\n"


def arming_text(settings: TrialSettings) -> str:
    """Return a text that describes a trial, for the person who arms the drives."""
    limits = settings.limits
    depth = "not stated" if settings.depth is None else f"{settings.depth * 1e3:g} mm"
    return (
        f"{settings.rig_name}: {settings.condition}, {settings.palpated}, depth {depth}, "
        f"force limit {limits.soft_force:g} N, stop at {limits.hard_force:g} N, "
        f"{settings.duration:g} s.\n"
        f"While it runs: {StopSwitch(key=True).instructions}."
    )
