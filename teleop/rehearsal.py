"""A rehearsal before a trial: warms every kernel, and tells whether this machine holds the rate."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from teleop.black_box import BlackBox
from teleop.errors import InputError
from teleop.recorder.schema import Layout
from teleop.recorder.sinks import Memory
from teleop.session import Session
from teleop.settings import TrialSettings
from teleop.stop_switch import StopSwitch

TICKS = 600
"""Ticks by which a rate is tried; the second half of them counts."""


def tick_cost(settings: TrialSettings) -> float:
    """Time [s] that nine of ten ticks keep to on this machine, rehearsed in virtual time.

    The rehearsal runs at 1 kHz at the most, so that it gets to the motion.
    """
    rate = min(settings.rate, 1000.0)
    rehearsal = replace(settings, rig=None, clock="virtual", rate=rate, duration=2.0 * TICKS / rate)
    clock, bank = rehearsal.make_clock(), rehearsal.make_bank()
    layout = Layout(bank)
    costs = []
    with rehearsal.make_rig(clock.now) as rig:
        box = BlackBox(layout, rehearsal.rate)
        session = Session(rehearsal, clock, rig, bank, layout, [Memory()], box, StopSwitch())
        for _ in range(TICKS):
            start = time.perf_counter()
            session.step()
            costs.append(time.perf_counter() - start)
    return float(np.percentile(costs[TICKS // 2 :], 90.0))


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
