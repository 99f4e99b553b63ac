"""Define the columns of a recording, with name, unit and meaning of each recorded quantity."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers import CHANNELS, UNITS
from estimation.estimate_columns import Column
from teleop.safety import Mode
from teleop.safety.soft_limits import ACCELERATION, FORCE, POSITION, VELOCITY

if TYPE_CHECKING:
    from teleop.control.tick_record import Record


MODES = ", ".join(f"{mode.value} {mode.name.lower()}" for mode in Mode)
LIMITED = (
    f"sum of the soft limits that reduced the command: {VELOCITY} velocity, "
    f"{ACCELERATION} acceleration, {POSITION} position, {FORCE} force"
)
WANTED = "velocity that the control condition requests"
LIMITED_TO = "velocity that the safety supervisor commands, after its limits"
APPLIED = "velocity command that the drive applied"

CHANNEL_MEANINGS = {
    "master_force": "force of the hand on the handle",
    "master_position": "position of the handle",
    "slave_position": "displacement of the slave from the contact datum",
    "contact_force": "force between slave and environment, positive in compression",
    "slave_velocity": "velocity of the slave, as its drive reports it",
}

MEASURED = (
    ("time", "s", "time since the trial began; negative before the drives are armed"),
    ("dt", "s", "time since the previous tick"),
    *((channel, unit, CHANNEL_MEANINGS[channel]) for channel, unit in UNITS.items()),
    *((f"{channel}_age", "s", "time since the sample was taken") for channel in CHANNELS),
)
COMMANDED = (
    ("drive_force", "N", "input of the admittance: force of the operator or of the PE injector"),
    ("target", "m", "target position of the slave; NaN in conditions without a target"),
    ("desired_master_velocity", "m/s", WANTED),
    ("desired_slave_velocity", "m/s", WANTED),
    ("commanded_master_velocity", "m/s", LIMITED_TO),
    ("commanded_slave_velocity", "m/s", LIMITED_TO),
    ("applied_master_velocity", "m/s", APPLIED),
    ("applied_slave_velocity", "m/s", APPLIED),
)
ESTIMATED_FROM = (
    ("paired_position", "m", "slave position, interpolated to the time of the force sample"),
    ("paired_force", "N", "contact force; NaN at a tick without a new sample"),
    ("paired_dt", "s", "time since the previous pair of position and force"),
    ("x", "m", "displacement given to the estimators; NaN if they are not updated"),
    ("v", "m/s", "velocity given to the estimators"),
    ("f", "N", "force given to the estimators"),
    ("excitation", "-", "measure of excitation: 0 at rest, 1 for a sine about zero"),
    ("contact", "-", "1 in contact, 0 out of contact; NaN if contact is not detected"),
)
STATE_OF_LOOP = (
    ("mode", "-", MODES),
    ("limited", "-", LIMITED),
    ("lateness", "s", "delay of the start of the tick after its deadline"),
    ("overrun", "-", "1 if the previous tick had not ended at the deadline"),
    ("skipped", "-", "number of whole periods skipped before this tick"),
    ("read_time", "s", "time to read the rig"),
    ("compute_time", "s", "computing time of condition, supervisor and estimators"),
    ("write_time", "s", "time to command the drives"),
    ("busy_time", "s", "duration of the whole previous tick"),
)
COLUMNS = tuple(
    Column(*column) for column in (*MEASURED, *COMMANDED, *ESTIMATED_FROM, *STATE_OF_LOOP)
)
"""Columns that the recordings of all trials have, in the order of the message of a tick."""


def values_of(record: Record) -> tuple[float, ...]:
    """Return the values of one tick in the order of `COLUMNS`."""
    (
        t,
        dt,
        measurement,
        drive_force,
        target,
        desired,
        commanded,
        applied,
        pair,
        estimated,
        mode,
        limited,
        tick,
        timing,
        *_,
    ) = record
    lateness, overrun, skipped, busy = tick
    return (
        t,
        dt,
        *measurement[1:6],
        *measurement[6],
        drive_force,
        target,
        *desired,
        *commanded,
        *applied,
        *pair,
        *estimated[:5],
        mode,
        limited,
        lateness,
        overrun,
        skipped,
        *timing,
        busy,
    )


MODEL = "of the body that is rendered at the master; NaN if no body is rendered"
FEEDBACK_COLUMNS = tuple(
    Column(*column)
    for column in (
        ("displayed_force", "N", "of the environment, as the hand feels it"),
        ("model_stiffness", "N/m", f"stiffness {MODEL}"),
        ("model_stiffening", "N/m^3", f"stiffening {MODEL}"),
        ("model_damping", "N s/m", f"damping {MODEL}"),
        ("tank", "J", "energy in the tank; NaN if the law has no tank"),
        ("port_energy", "J", "from the hand, at most what the displayed dynamics can store"),
        ("master_energy", "J", "from the hand to the channel, for passivity control"),
        (
            "slave_energy",
            "J",
            "from the environment to the channel, as in the packet at the master",
        ),
        ("report_age", "s", "of the packet from the slave that the master uses"),
        ("motion_age", "s", "of the packet from the master that the slave uses"),
    )
)
"""Additional columns of a trial with force feedback or a communication channel.

The columns have the order of the fields of `teleop.control.bilateral.LinkValues`.
"""
