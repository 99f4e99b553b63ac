"""Define when a fault of the campaign can be detected: functions of the type `Evidence`."""

from __future__ import annotations

from fault_case import Case

from teleop.safety.checks import LONGEST_HALT
from teleop.settings.simulated_rig_limits import FROZEN, FROZEN_SPEED


def at_once(case: Case, travel: float, change: float) -> bool:
    return True


def moved(case: Case, travel: float, change: float) -> bool:
    """Return whether the drive has moved far enough to detect a frozen encoder."""
    return travel > FROZEN * case.settings.setup.depth


def handle_moved(case: Case, travel: float, change: float) -> bool:
    """Return whether the master has moved far enough to detect a frozen encoder.

    With force feedback or a channel, the velocity of the master differs from that of the slave.
    """
    return case.master_travel > FROZEN * case.settings.setup.depth


def accelerated(case: Case, travel: float, change: float) -> bool:
    """Return whether the commanded velocity has changed enough to detect a frozen velocity."""
    return change > FROZEN_SPEED * case.limits.max_velocity


def after_stall(case: Case, travel: float, change: float) -> bool:
    """Return True: the loop detects a stall at the first tick after the stall.

    During the stall, the watchdogs of the drives act.
    """
    return True


def moves_on(case: Case, travel: float, change: float) -> bool:
    """Return whether the slave has moved for so long after the stop that it cannot be coasting."""
    halting = case.controller._supervision.halting
    return halting is not None and case.clock.now() - halting.since > LONGEST_HALT


def over_force(case: Case, travel: float, change: float) -> bool:
    return abs(case.measured.contact_force) > case.limits.hard_force
