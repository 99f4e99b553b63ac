"""What is kept of every tick: columns with units, and the message that they make.

A tick is a ROS 2 message of doubles in CDR, so that PlotJuggler, Lichtblick and Foxglove show
it without a plug-in, and so that numpy reads a whole recording in one step.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from teleop.safety import Mode
from teleop.safety.soft_limits import ACCELERATION, FORCE, POSITION, VELOCITY

if TYPE_CHECKING:
    from estimation import Estimates, Estimator
    from estimation.compiled import Floats
    from teleop.control.tick_record import Record

CDR = b"\0\1\0\0"
"""Head of a little-endian CDR message."""
TIME = struct.Struct("<4xd")
"""Where a message has its tick's time."""
TICK = "teleop/msg/Tick"
"""Name of the message."""


class Column(NamedTuple):
    """A quantity that is kept of each tick."""

    name: str
    unit: str
    meaning: str


COLUMNS = (
    Column("time", "s", "since the trial began; negative before the drives are armed"),
    Column("dt", "s", "since the tick before"),
    Column("master_force", "N", "of the hand on the handle"),
    Column("master_position", "m", "of the handle"),
    Column("slave_position", "m", "displacement from the contact datum"),
    Column("contact_force", "N", "between slave and environment, positive in compression"),
    Column("slave_velocity", "m/s", "as the drive reports it"),
    Column("master_force_age", "s", "since the sample was taken"),
    Column("master_position_age", "s", "since the sample was taken"),
    Column("slave_position_age", "s", "since the sample was taken"),
    Column("contact_force_age", "s", "since the sample was taken"),
    Column("slave_velocity_age", "s", "since the sample was taken"),
    Column("drive_force", "N", "on the admittance: the operator's, or the PE injector's"),
    Column("desired_master_velocity", "m/s", "what the control condition wanted"),
    Column("desired_slave_velocity", "m/s", "what the control condition wanted"),
    Column("commanded_master_velocity", "m/s", "what the safety supervisor made of it"),
    Column("commanded_slave_velocity", "m/s", "what the safety supervisor made of it"),
    Column("applied_master_velocity", "m/s", "what the drive made of that"),
    Column("applied_slave_velocity", "m/s", "what the drive made of that"),
    Column("paired_position", "m", "of the slave, at the moment of the force sample"),
    Column("paired_force", "N", "contact force, where position and force made a pair"),
    Column("paired_dt", "s", "since the pair before"),
    Column("x", "m", "displacement that the estimators were given; NaN for none"),
    Column("v", "m/s", "velocity that the estimators were given"),
    Column("f", "N", "force that the estimators were given"),
    Column("excitation", "-", "0 none, 1 a sine about zero"),
    Column("mode", "-", ", ".join(f"{mode.value} {mode.name.lower()}" for mode in Mode)),
    Column(
        "limited",
        "-",
        f"sum of the soft limits that held the command back: {VELOCITY} velocity, "
        f"{ACCELERATION} acceleration, {POSITION} position, {FORCE} force",
    ),
    Column("lateness", "s", "of the tick's start after its deadline"),
    Column("overrun", "-", "1 if the tick before was still at work at the deadline"),
    Column("skipped", "-", "whole periods left out before this tick"),
    Column("read_time", "s", "taken to read the rig"),
    Column("compute_time", "s", "taken by condition, supervisor and estimators"),
    Column("write_time", "s", "taken to command the drives"),
    Column("busy_time", "s", "taken by all of the tick before"),
    Column("dropped", "-", "ticks that the recorder has missed so far"),
)


def estimate_columns(bank: Mapping[str, Estimator]) -> list[Column]:
    """The columns of each estimator's answer: b, k, deviations, held, and what it has more."""
    columns = []
    for name, estimator in bank.items():
        parameters = list(zip(estimator.names, estimator.units, strict=True))
        values = [Column(f"{name}_{p}", unit, f"{p}, by {name}") for p, unit in parameters]
        deviations = [
            Column(f"{name}_{p}_std", unit, f"standard deviation of {p}, NaN for none")
            for p, unit in parameters
        ]
        held = Column(f"{name}_held", "-", "1 while the estimate is held")
        columns += [*values[:2], *deviations[:2], held, *values[2:], *deviations[2:]]
    return columns


def answers(estimates: Mapping[str, Estimates]) -> Iterator[Floats]:
    """What stands in the columns of `estimate_columns`, arrays of shape (n,)."""
    for e in estimates.values():
        yield from (e.b, e.k, e.b_std, e.k_std, e.held.astype(float))
        yield from (series.value for series in e.further.values())
        yield from (series.std for series in e.further.values())


class Layout:
    """The message of a bank's ticks.

    Parameters
    ----------
    bank
        The estimators by name.
    """

    def __init__(self, bank: Mapping[str, Estimator]) -> None:
        self.estimators = tuple(bank)
        regressors_of = (e.model.further_regressors for e in bank.values())
        model = max(regressors_of, key=len, default=())
        regressors = tuple(
            Column(f"regressor_{name}", unit, f"regressor of {name}, as the estimators were given")
            for name, unit in model
        )
        self.columns = (*COLUMNS, *regressors, *estimate_columns(bank))
        self._struct = struct.Struct(f"<4s{len(self.columns)}d")
        self.size = self._struct.size

    @property
    def definition(self) -> str:
        """The message's definition, in the language of ROS 2."""
        lines = [f"float64 {c.name}  # [{c.unit}] {c.meaning}" for c in self.columns]
        return "\n".join(["# One tick of the control loop", *lines]) + "\n"

    def pack(self, r: Record, dropped: int = 0) -> bytes:
        """The message of one tick, its values in the order of `columns`."""
        row = [
            r.t,
            r.dt,
            *r.measurement[1:6],
            *r.measurement.age,
            r.drive_force,
            *r.desired,
            *r.commanded,
            *r.applied,
            *r.pair,
            r.x,
            r.v,
            r.f,
            r.excitation,
            r.mode,
            r.limited,
            *r.tick[:3],
            *r.timing,
            r.tick.busy,
            dropped,
            *r.further,
        ]
        for estimate in r.estimates.values():
            row += estimate[:5]
            row += estimate.further
        return self._struct.pack(CDR, *row)
