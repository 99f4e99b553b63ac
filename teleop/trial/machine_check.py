"""Measure the loop on this computer for some time, and state the result in plain words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from teleop.settings.trial_settings import TrialSettings
from teleop.trial.computer import changes, this_computer
from teleop.trial.loop_verdict import LoopVerdict, verdict_of
from teleop.trial.realtime import realtime
from teleop.trial.rehearsal import rehearse


def machine_check(rate: float, seconds: float) -> dict[str, Any]:
    """Measure the control loop on the simulated rig, and judge its timing.

    The real-time settings are those of `teleop run`. The recorder and the live page are other
    processes, and are not part of the measurement.

    Parameters
    ----------
    rate
        Rate of the loop [Hz].
    seconds
        Duration of the measurement [s].

    Returns
    -------
    dict
        The document that `teleop machine check --json` prints.
    """
    settings = TrialSettings(rate=rate)
    with realtime("try") as applied:
        applied.start()
        timing = rehearse(settings, seconds)
    return loop_document(verdict_of(timing, settings.limits), applied.report)


def loop_document(
    verdict: LoopVerdict,
    report: Mapping[str, str],
    timers: Mapping[str, int] | None = None,
    further: Sequence[str] = (),
) -> dict[str, Any]:
    """Return a verdict with its figures and with what to change, as a JSON document.

    Parameters
    ----------
    verdict
        Result of the measurement.
    report
        Result of each real-time setting.
    timers
        Latency timers of the serial ports of a rig [ms]. Default: none.
    further
        What else to change.
    """
    computer = this_computer()
    return {
        "verdict": verdict.level,
        "text": verdict.text,
        "reasons": verdict.reasons,
        "changes": [*changes(verdict, computer, report, timers), *further],
        "watchdog_s": verdict.watchdog,
        "margin_s": verdict.margin,
        **verdict.timing.document(),
        "realtime": dict(report),
        "computer": computer._asdict(),
    }
