"""One trial: palpate a cube under a control condition, and estimate while doing so."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from estimation import Bank, Estimates
from estimation.compiled import Floats
from teleop.controller import Record
from teleop.errors import InputError
from teleop.log import Log
from teleop.settings import TrialSettings
from teleop.summary import loop_timing, summarise

REHEARSAL = 600
"""Ticks by which a rate is tried before a trial; the second half of them counts."""


@dataclass(frozen=True)
class Trial:
    """A trial that has been run."""

    settings: TrialSettings
    columns: dict[str, Floats]
    """What was logged, by column; arrays of shape (ticks,) in SI units."""
    units: dict[str, str]
    """Unit of each column."""
    bank: Bank
    """The estimators in their final state."""
    interrupted: bool
    """Whether it ended before its time."""

    @property
    def estimates(self) -> dict[str, Estimates]:
        """Each estimator's estimates."""
        return {
            name: Estimates(self.columns[f"{name.upper()} b"], self.columns[f"{name.upper()} k"])
            for name in self.bank
        }

    def summary(self) -> dict[str, Any]:
        """What the trial comes to, as `teleop run --json` prints it."""
        settings, columns = self.settings, self.columns
        t = columns["Time"]
        x, v, f = (columns[f"Filtered {name}"] for name in ("displacement", "velocity", "force"))
        cube = settings.setup.cube
        return {
            "condition": settings.condition,
            "cube": settings.cube,
            "duration_s": settings.duration,
            "clock": settings.clock,
            "seed": settings.seed,
            "ticks": len(t),
            "interrupted": self.interrupted,
            "estimates": {
                name: summarise(t, x, v, f, estimates, self.bank[name])._asdict()
                for name, estimates in self.estimates.items()
            },
            "truth": {
                "b": cube.b,
                "k_surface": cube.k1,
                "k_deepest": cube.k1
                + cube.k3 * float(np.max(np.abs(columns["Displacement"]))) ** 2,
                "force_lag_s": settings.setup.force_lag,
            },
            "excitation": {
                "mean": float(np.mean(columns["Excitation"])),
                "last": float(columns["Excitation"][-1]),
            },
            "loop": loop_timing(settings.rate, t, columns["Lateness"], columns["Overrun"]),
        }


def tick_cost(settings: TrialSettings) -> float:
    """Time [s] that nine of ten ticks keep to on this machine, rehearsed in virtual time.

    The rehearsal runs at 1 kHz at the most, so that it gets to the motion.
    """
    rehearsal = replace(settings, clock="virtual", rate=min(settings.rate, 1000.0))
    clock = rehearsal.make_clock()
    costs = []
    with rehearsal.make_rig(clock.now) as rig:
        bank = rehearsal.make_bank()
        controller = rehearsal.make_controller(rig, bank)
        log = Log(bank)
        for _ in range(REHEARSAL):
            start = time.perf_counter()
            log.append(clock.wait(), controller.tick())
            costs.append(time.perf_counter() - start)
    return float(np.percentile(costs[REHEARSAL // 2 :], 90.0))


def check_rate(settings: TrialSettings) -> None:
    """Make sure that this machine can hold the rate, in the best of three rehearsals.

    Raises
    ------
    InputError
        It cannot.
    """
    cost = math.inf
    for _ in range(3):
        cost = min(cost, tick_cost(settings))
        if cost <= 0.9 / settings.rate:
            return
    raise InputError(
        f"rate {settings.rate:g} Hz: a tick takes {cost * 1e6:.0f} us on this machine, "
        f"expected a rate of at most {0.9 / cost:.0f} Hz, or --clock virtual"
    )


def run_trial(
    settings: TrialSettings, on_tick: Callable[[int, Record], None] | None = None
) -> Trial:
    """Run a trial to its end, or to Ctrl-C; the rig is stopped on every way out.

    Parameters
    ----------
    settings
        What to run.
    on_tick
        Called with the tick's number and record after each tick; must be quick.

    Raises
    ------
    InputError
        The machine cannot hold the rate.
    """
    if settings.clock == "real":
        check_rate(settings)
    bank = settings.make_bank()
    log = Log(bank)
    clock = settings.make_clock()
    interrupted = False
    with settings.make_rig(clock.now) as rig:
        controller = settings.make_controller(rig, bank)
        number = 0
        try:
            while True:
                tick = clock.wait()
                number += tick.skipped
                if number >= settings.duration * settings.rate:
                    break
                record = controller.tick()
                log.append(tick, record)
                if on_tick:
                    on_tick(number, record)
                number += 1
        except KeyboardInterrupt:
            if not log:
                raise
            interrupted = True
    return Trial(settings, log.columns(), log.units, bank, interrupted)
