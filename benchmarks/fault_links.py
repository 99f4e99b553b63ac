"""Inject faults into the link of master and slave: a silent channel, a law that gives energy."""

from __future__ import annotations

from fault_case import Case

from teleop.control.channel import ChannelSettings
from teleop.control.feedback.law import PASSIVE, MasterHalf, Report

CHANNEL = ChannelSettings(delay=0.025, jitter=5e-3, loss=0.05)
"""Channel of the trials with force feedback."""


def silence(case: Case) -> None:
    """Interrupt the channel in a random direction, or in both."""
    link = case.controller._link
    for direction in case.random.choice(
        ((link.reports,), (link.motions,), (link.reports, link.motions))
    ):
        direction.cut = True


class ActiveMaster(MasterHalf):
    """A faulty law. It displays a negative damping, and therefore gives energy to the hand."""

    def display(self, report: Report, dt: float) -> float:
        return -100.0 * self.admittance.velocity


def activate(case: Case) -> None:
    master = case.controller._link._master
    master.law = ActiveMaster(master.admittance)


def gave_energy(case: Case, travel: float, change: float) -> bool:
    return case.controller._link.values.port_energy < -PASSIVE
