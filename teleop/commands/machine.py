"""`teleop machine`: commands about this computer."""

from __future__ import annotations

import sys

from cyclopts import App

from teleop.commands.options import Json
from teleop.commands.quantities import Hertz, Seconds

machine = App(name="machine", help="Check whether this computer can run the control loop.")


@machine.command
def check(
    *,
    rate: Hertz = 1000.0,
    duration: Seconds = 60.0,
    json: Json = False,
) -> int:
    """Measure the control loop on this computer, and state whether it can run at a rate.

    The loop runs in real time on the simulated rig, with the real-time settings of teleop run. The
    command prints how late the ticks of the loop begin, how long they take, how many periods are
    missed, what other programs use, and what to change. The verdict is yes, with delays, or no: a
    tick does not fit into its period, or the safety supervisor would stop a rig. The exit code is 2
    if the verdict is no. Each trial makes the same measurement for a fraction of a second.

    Example: `teleop machine check --rate 2kHz --duration 60s`

    Parameters
    ----------
    rate
        Rate of the loop [Hz].
    duration
        Duration of the measurement [s].
    """
    from teleop.errors import InputError
    from teleop.output.console import print_json
    from teleop.output.machine_tables import print_machine_check
    from teleop.settings import ranges
    from teleop.trial.machine_check import machine_check

    low, high = ranges.RATES
    if not low <= rate <= high:
        raise InputError(f"rate {rate:g} Hz: expected {low:g} to {high:g} Hz")
    check_duration("duration", duration)
    if sys.stderr.isatty():
        print(f"the loop is measured for {duration:g} s", file=sys.stderr)
    found = machine_check(rate, duration)
    if json:
        print_json(found)
    else:
        print_machine_check(found)
    if found["verdict"] == "no":
        raise InputError(found["reasons"][0])
    return 0


def check_duration(name: str, seconds: float) -> None:
    """Check the duration of a measurement [s]; InputError if it is out of range."""
    from teleop.errors import InputError

    if not 0.1 <= seconds <= 3600.0:
        raise InputError(f"{name} {seconds:g} s: expected 0.1 to 3600 s")
