"""Draw the force against the position, once at the hand of the operator and once at the slave."""

from __future__ import annotations

from matplotlib.figure import Figure

from estimation.figure_style import BLUE, ORANGE, draw, new_figure, tidy
from estimation.quantities import FORCE, POSITION
from teleop.evaluation.teleoperation.rendering import hand
from teleop.recording.recording import Recording
from teleop.safety.events import ACTIVE


def feedback_figure(recording: Recording) -> Figure:
    """Return a figure of force against position, with two panels.

    The left panel shows the force that the hand felt against the position of the master. The right
    panel shows the contact force against the position of the slave.

    Parameters
    ----------
    recording
        Recording of a trial with force feedback or with a communication channel (a simulated
        connection with delay). The recording must contain the settings of the trial.
    """
    settings = recording.settings
    admittance = settings["admittance"]
    virtual = (admittance["mass"], admittance["damping"], admittance["stiffness"])
    active = recording.where(recording["mode"] == ACTIVE)
    felt = hand(active, *virtual, settings["coupling"]["scale"])
    figure = new_figure(0.5)
    left, right = figure.subplots(1, 2, sharey=True)
    draw(left, felt.position * POSITION.factor, felt.force, color=ORANGE, linewidth=0.7)
    draw(
        right,
        active["slave_position"] * POSITION.factor,
        active["contact_force"],
        color=BLUE,
        linewidth=0.7,
    )
    left.set_title("the hand feels", loc="left")
    right.set_title("the slave touches", loc="left")
    left.set_ylabel(FORCE.heading)
    left.set_xlabel(f"position of the master [{POSITION.unit}]")
    right.set_xlabel(f"position of the slave [{POSITION.unit}]")
    for axes in (left, right):
        tidy(axes)
    return figure
