"""Checks for authors of conditions, signals and links. A test of such a class calls them.

Each check raises an AssertionError with the rule that is broken. The checks of estimators are in
`estimation.testing`, and those of devices in `drivers.testing`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import is_dataclass

from drivers import Ages, Command, Measurement
from teleop.control.admittance import AdmittanceParameters
from teleop.control.conditions import Condition, IntendedMotion
from teleop.control.coupling import Coupling
from teleop.control.excitation_signals import Signal, Sine
from teleop.control.link import Link, LinkSettings
from teleop.safety import Mode, Verdict
from teleop.safety.state import Supervision
from teleop.settings.custom_class import described
from teleop.settings.trial_settings import TrialSettings

PERIOD = 1e-3
"""Period of the control loop in the checks [s]."""
MOTION = IntendedMotion(Sine(2.0), 10e-3, 0.0, 2.0, AdmittanceParameters(), 1.0)
"""Settings of a trial in the checks."""


def require(kept: object, rule: str) -> None:
    """Raise an AssertionError with a rule, unless the rule is kept."""
    if not kept:
        raise AssertionError(rule)


def check_condition(condition: Condition, motion: IntendedMotion = MOTION) -> None:
    """Check that a control condition follows the rules of all conditions.

    Parameters
    ----------
    condition
        Object that has taken part in no trial.
    motion
        Settings of the trial for which the condition is prepared.

    Raises
    ------
    AssertionError
        A rule is broken. The message states which one.
    """
    check_parameters(condition)
    first, second = deepcopy(condition), deepcopy(condition)
    for one in (first, second):
        one.prepare(motion)
    require(
        isinstance(first.instruction, str) and "\n" not in first.instruction,
        "instruction is one line of text",
    )
    require(first.moved_by in ("hand", "injector"), "moved_by is hand or injector")
    start, end, left_out = first.averaged_times(motion)
    require(
        start < end and isinstance(left_out, str),
        "averaged_times returns a start, a later end and a text",
    )
    for name, text in first.motion_texts(motion).items():
        require(
            isinstance(name, str) and isinstance(text, str), "motion_texts returns texts by name"
        )
    for n, measurement in enumerate(measurements(motion)):
        t = n * PERIOD
        forces = [one.drive_force(t, measurement) for one in (first, second)]
        require(all(map(is_number, forces)), f"drive_force is a finite number, got {forces[0]!r}")
        require(forces[0] == forces[1], "a condition that is prepared again gives the same forces")
        target = first.target(t)
        require(
            isinstance(target, float | int) and not math.isinf(target),
            f"target is a finite number or NaN, got {target!r}",
        )
        require(isinstance(first.finished, bool), "finished is true or false")
    check_trial(condition)


def check_trial(condition: Condition) -> None:
    """Check that a trial with a condition on the simulated rig runs.

    An exception in a tick is raised after the drives have stopped.
    """
    from teleop.trial.run import run_trial  # imports the simulated rig

    settings = TrialSettings(
        condition="free" if condition.moved_by == "hand" else "autonomous",
        clock="virtual",
        rate=500.0,
        duration=1.0,
        estimators=("rls",),
    )
    trial = run_trial(settings, condition=deepcopy(condition))
    require(trial.armed, "the drives can be armed")


def check_signal(signal: Signal) -> None:
    """Check that an excitation signal follows the rules of all signals.

    Raises
    ------
    AssertionError
        A rule is broken. The message states which one.
    """
    check_parameters(signal)
    require(
        is_number(signal.highest) and signal.highest > 0.0,
        f"highest is a positive frequency [Hz], got {signal.highest!r}",
    )
    require(
        isinstance(signal.text, str) and signal.text and "\n" not in signal.text, "text is one line"
    )
    step = min(1e-4, 1e-3 / signal.highest)
    omega = 2.0 * math.pi * signal.highest
    for n in range(2000):
        t = 7.3e-3 * n
        before, now, after = (signal.at(t + shift) for shift in (-step, 0.0, step))
        require(all(map(is_number, now)), f"at({t:g}) contains finite numbers, got {now}")
        require(
            abs(now.value) <= 1.0 + 1e-9, f"the value is in [-1, 1], got {now.value} at {t:g} s"
        )
        require(now == signal.at(t), f"at({t:g}) depends on the time only")
        if t < step:
            continue
        for name, low, high, found, tolerance in (
            ("rate", before.value, after.value, now.rate, 0.02 * omega),
            ("acceleration", before.rate, after.rate, now.acceleration, 0.2 * omega**2),
        ):
            slope = (high - low) / (2.0 * step)
            require(
                abs(slope - found) <= tolerance,
                f"the {name} is the derivative: {found:g}, expected {slope:g}, at {t:g} s",
            )


def check_link(link: Link, settings: LinkSettings | None = None) -> None:
    """Check that a link follows the rules of all links.

    Parameters
    ----------
    link
        Object that has taken part in no trial.
    settings
        Settings of the trial for which the link is prepared. Default: those of the paper.

    Raises
    ------
    AssertionError
        A rule is broken. The message states which one.
    """
    check_parameters(link)
    given = settings or LinkSettings(AdmittanceParameters(), Coupling(), PERIOD)
    first, second = deepcopy(link), deepcopy(link)
    at_rest = measurement_at(3e-3, 0.0, 0.0)
    for one in (first, second):
        one.prepare(given)
        one.align(at_rest)
    still = first.step(0.0, at_rest, PERIOD)
    require(
        isinstance(still, Command) and all(map(is_number, still)),
        f"step returns a Command with finite velocities, got {still!r}",
    )
    require(
        max(map(abs, still)) < 1e-9,
        f"after arming, no force gives no velocity, wherever the slave is, got {still}",
    )
    second.step(0.0, at_rest, PERIOD)
    for n in range(500):
        force = 10.0 * math.sin(2.0 * math.pi * 2.0 * n * PERIOD) if n < 400 else 1e3
        measured = measurement_at(3e-3, 0.0, force)
        found = [one.step(force, measured, PERIOD) for one in (first, second)]
        require(all(map(is_number, found[0])), f"velocities are finite, got {found[0]}")
        require(found[0] == found[1], "a link that is prepared again gives the same velocities")
        for one in (first, second):
            one.follow(verdict(found[0], False), found[0], found[0], PERIOD)
    limited = Command(1e-3, 1e-3)
    first.follow(verdict(limited, True), found[0], limited, PERIOD)
    slower = first.step(0.0, at_rest, PERIOD)
    require(
        abs(slower.master_velocity) <= 2e-3,
        "after the supervisor limited the velocity of the handle, the virtual mass has that "
        f"velocity: expected about 0.001 m/s, got {slower.master_velocity:g}",
    )
    first.align(at_rest)
    again = first.step(0.0, at_rest, PERIOD)
    require(max(map(abs, again)) < 1e-9, f"align puts the master at rest, got {again}")


def check_parameters(part: Condition | Signal | Link) -> None:
    """Check that the parameters of a part are recorded, and create the same object again."""
    kind = type(part)
    require(is_dataclass(part), f"{kind.__name__} is a dataclass, whose fields are its parameters")
    stated = described(part)
    require(stated.complete, "the parameters are numbers, texts, truth values or None")
    again = described(kind(**stated.parameters))
    require(
        (again.parameters, again.state) == (stated.parameters, stated.state),
        "an object with the recorded parameters is the same",
    )


def is_number(value: object) -> bool:
    """Return whether a value is a finite number, and not a truth value."""
    return isinstance(value, float | int) and type(value) is not bool and math.isfinite(value)


def measurement_at(position: float, velocity: float, force: float) -> Measurement:
    """Return a measurement of a rig whose master and slave are at the same position."""
    ages = Ages._make([0.0] * len(Ages._fields))
    contact = 2000.0 * max(position, 0.0)
    return Measurement(0.0, force, position, position, contact, velocity, ages)


def measurements(motion: IntendedMotion) -> Iterator[Measurement]:
    """Yield measurements of two seconds: a palpation, rest, and positions far outside."""
    for n in range(2000):
        t = n * PERIOD
        x = 0.5 * motion.depth * (1.0 - math.cos(2.0 * math.pi * 2.0 * t))
        if 1500 <= n < 1800:
            x = 0.0
        if n >= 1800:
            x = 0.1 * (-1.0) ** n
        yield measurement_at(x, 0.0, 5.0 * math.sin(2.0 * math.pi * t))._replace(time=t)


def verdict(command: Command, limited: bool) -> Verdict:
    """Return the output of a supervisor that permits a command."""
    return Verdict(Supervision(Mode.ACTIVE), command, int(limited))
