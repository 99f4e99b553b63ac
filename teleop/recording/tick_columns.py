"""Define the columns of a recording, with name, unit and meaning of each recorded quantity."""

from __future__ import annotations

from typing import NamedTuple

from drivers import CHANNELS, UNITS
from estimation.estimate_columns import Column
from teleop.safety import Mode
from teleop.safety.soft_limits import ACCELERATION, FORCE, POSITION, VELOCITY


class TickColumn(NamedTuple):
    """A quantity that is recorded at each tick."""

    name: str
    """Name of the column."""
    unit: str
    """SI unit; `-` for a column without a unit."""
    source: str
    """Name of the attribute of `teleop.control.tick_record.Record` that contains the value."""
    meaning: str
    """Description of the quantity."""


MODES = ", ".join(f"{mode.value} {mode.name.lower()}" for mode in Mode)
LIMITED = (
    f"sum of the soft limits that reduced the command: {VELOCITY} velocity, "
    f"{ACCELERATION} acceleration, {POSITION} position, {FORCE} force"
)
WANTED = "requested by the control condition"
LIMITED_TO = "after the safety supervisor"
APPLIED = "as the drive applied it"

CHANNEL_MEANINGS = {
    "master_force": "of the hand on the handle",
    "master_position": "of the handle",
    "slave_position": "displacement from the contact datum",
    "contact_force": "between slave and environment, positive in compression",
    "slave_velocity": "as the drive reports it",
}

MEASURED = (
    ("time", "s", "t", "since the trial began; negative before the drives are armed"),
    ("dt", "s", "dt", "since the previous tick"),
    *(
        (channel, unit, f"measurement.{channel}", CHANNEL_MEANINGS[channel])
        for channel, unit in UNITS.items()
    ),
    *(
        (f"{channel}_age", "s", f"measurement.age.{channel}", "since the sample was taken")
        for channel in CHANNELS
    ),
)
COMMANDED = (
    ("drive_force", "N", "drive_force", "on the admittance: of the operator or the PE injector"),
    ("target", "m", "target", "target position of the slave; NaN in conditions without a target"),
    ("desired_master_velocity", "m/s", "desired.master_velocity", WANTED),
    ("desired_slave_velocity", "m/s", "desired.slave_velocity", WANTED),
    ("commanded_master_velocity", "m/s", "commanded.master_velocity", LIMITED_TO),
    ("commanded_slave_velocity", "m/s", "commanded.slave_velocity", LIMITED_TO),
    ("applied_master_velocity", "m/s", "applied.master_velocity", APPLIED),
    ("applied_slave_velocity", "m/s", "applied.slave_velocity", APPLIED),
)
ESTIMATED_FROM = (
    ("paired_position", "m", "pair.position", "of the slave, at the time of the force sample"),
    ("paired_force", "N", "pair.force", "contact force; NaN where there is no new sample"),
    ("paired_dt", "s", "pair.dt", "since the previous pair of position and force"),
    ("x", "m", "x", "displacement given to the estimators; NaN if they are not updated"),
    ("v", "m/s", "v", "velocity given to the estimators"),
    ("f", "N", "f", "force given to the estimators"),
    ("excitation", "-", "excitation", "measure of excitation: 0 at rest, 1 for a sine about zero"),
    ("contact", "-", "contact", "1 in contact, 0 out of contact; NaN if contact is not detected"),
)
STATE_OF_LOOP = (
    ("mode", "-", "mode", MODES),
    ("limited", "-", "limited", LIMITED),
    ("lateness", "s", "tick.lateness", "of the start of the tick after its deadline"),
    ("overrun", "-", "tick.overrun", "1 if the previous tick had not ended at the deadline"),
    ("skipped", "-", "tick.skipped", "whole periods skipped before this tick"),
    ("read_time", "s", "timing.read", "time to read the rig"),
    ("compute_time", "s", "timing.compute", "time of condition, supervisor and estimators"),
    ("write_time", "s", "timing.write", "time to command the drives"),
    ("busy_time", "s", "tick.busy", "time of the whole previous tick"),
)
COLUMNS = tuple(
    TickColumn(*column) for column in (*MEASURED, *COMMANDED, *ESTIMATED_FROM, *STATE_OF_LOOP)
)
"""Columns that the recordings of all trials have, in the order of the message of a tick."""
MODEL = "of the body that is rendered at the master; NaN if no body is rendered"
FEEDBACK_COLUMNS = tuple(
    Column(*column)
    for column in (
        ("displayed_force", "N", "of the environment, as the hand feels it"),
        ("model_stiffness", "N/m", f"stiffness {MODEL}"),
        ("model_stiffening", "N/m^3", f"stiffening {MODEL}"),
        ("model_damping", "N s/m", f"damping {MODEL}"),
        ("tank", "J", "energy in the tank; NaN if the law has no tank"),
        ("port_energy", "J", "put in by the hand, limited to what can be stored"),
        ("master_energy", "J", "that the hand has given to the channel, for passivity control"),
        ("slave_energy", "J", "that the environment has given to it, as the master knows it"),
        ("report_age", "s", "of the packet from the slave that the master uses"),
        ("motion_age", "s", "of the packet from the master that the slave uses"),
    )
)
"""Additional columns of a trial with force feedback or a communication channel.

They have the order of the fields of `teleop.control.bilateral.LinkValues`.
"""
