"""The columns of a recording: the schema of the records in the rings, with names.

The tables of this file define the columns. The control loop writes a record of those columns that
have a source, and the estimation a record of the others. All readers find each column by its name.
To add a column of the loop, add a line here and the value to `Record`
(`teleop.control.tick_record`), which the controller fills.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from mmap import mmap
from operator import attrgetter
from struct import Struct
from typing import TYPE_CHECKING, Any, NamedTuple

from drivers import AXES, CHANNELS, UNITS
from estimation.estimate_columns import Column, estimate_columns, misfit_columns
from teleop.safety import Mode
from teleop.safety.soft_limits import FLAGS

if TYPE_CHECKING:
    from estimation import Estimator
    from sim_backend import PointerOperator
    from teleop.control.tick_record import Record


MODES = ", ".join(f"{mode.value} {mode.name.lower()}" for mode in Mode)
LIMITED = "sum of the soft limits that reduced the command: " + ", ".join(
    f"{flag} {name}" for name, flag in FLAGS.items()
)
CHANNEL_MEANINGS = {
    "master_force": "force of the hand on the handle",
    "master_position": "position of the handle",
    "slave_position": "displacement of the slave from the contact datum",
    "contact_force": "force between slave and environment, positive in compression",
    "slave_velocity": "velocity of the slave, as its drive reports it",
}
VELOCITIES = {
    "desired": "velocity that the control condition requests",
    "commanded": "velocity that the safety supervisor commands, after its limits",
    "applied": "velocity command that the drive applied",
}

# Name of the column, attribute of the tick's `Record` (empty: by the estimation), unit, meaning.
TABLE: tuple[tuple[str, str, str, str], ...] = (
    ("time", "t", "s", "time since the drives were permitted to be armed; negative before"),
    ("dt", "dt", "s", "time since the previous tick"),
    *((c, f"measurement.{c}", UNITS[c], CHANNEL_MEANINGS[c]) for c in CHANNELS),
    *(
        (f"{c}_age", f"measurement.age.{c}", "s", "time since the sample was taken")
        for c in CHANNELS
    ),
    (
        "drive_force",
        "drive_force",
        "N",
        "input of the admittance: force of the operator or of the PE injector",
    ),
    ("target", "target", "m", "target position of the slave; NaN in conditions without a target"),
    ("phase", "phase", "-", "number of the step of a protocol, from 0; NaN without a protocol"),
    *(
        (f"{stage}_{axis}_velocity", f"{stage}.{axis}_velocity", "m/s", meaning)
        for stage, meaning in VELOCITIES.items()
        for axis in AXES
    ),
    (
        "paired_position",
        "pair.position",
        "m",
        "slave position, interpolated to the time of the force sample",
    ),
    ("paired_force", "pair.force", "N", "contact force; NaN at a tick without a new sample"),
    ("paired_dt", "pair.dt", "s", "time since the previous pair of position and force"),
    ("x", "", "m", "displacement given to the estimators; NaN if they are not updated"),
    ("v", "", "m/s", "velocity given to the estimators"),
    ("f", "", "N", "force given to the estimators"),
    (
        "k_bound",
        "",
        "-",
        "half width of the 95 % interval of k that motion and noise permit, as a fraction of k",
    ),
    ("b_bound", "", "-", "the same of b"),
    ("contact", "", "-", "1 in contact, 0 out of contact; NaN if contact is not detected"),
    ("mode", "mode", "-", MODES),
    ("limited", "limited", "-", LIMITED),
    ("lateness", "tick.lateness", "s", "delay of the start of the tick after its deadline"),
    ("overrun", "tick.overrun", "-", "1 if the previous tick had not ended at the deadline"),
    ("skipped", "tick.skipped", "-", "number of whole periods skipped before this tick"),
    ("read_time", "timing.read", "s", "time to read the rig"),
    ("compute_time", "timing.compute", "s", "computing time of condition, link and supervisor"),
    ("write_time", "timing.write", "s", "time to command the drives"),
    ("busy_time", "tick.busy", "s", "duration of the whole previous tick"),
)
COLUMNS = tuple(Column(name, unit, meaning) for name, _, unit, meaning in TABLE)
"""Columns that the recordings of all trials have, in the order of the message of a tick."""
# By name, all values of a tick take 0.94 us; unpacked by position, they took 0.88 us.
values_of: Callable[[Record], tuple[float, ...]] = attrgetter(
    *(source for _, source, _, _ in TABLE if source)
)
"""Return the values of one tick in the order of the columns that have a source."""
OF_LOOP = tuple(name for name, source, _, _ in TABLE if source)
OF_ESTIMATION = tuple(name for name, source, _, _ in TABLE if not source)
"""Columns that the estimation computes for all estimators together (see `Estimated`)."""

DROPPED = Column("dropped", "-", "ticks that the recorder has missed so far")
REGRESSOR = "regressor_"
"""Prefix of the names of columns that contain regressors other than v and x."""
MODEL = "of the body that is rendered at the master; NaN if no body is rendered"
FEEDBACK_COLUMNS = (
    Column("displayed_force", "N", "force of the environment, as the hand feels it"),
    Column("model_stiffness", "N/m", f"stiffness {MODEL}"),
    Column("model_stiffening", "N/m^3", f"stiffening {MODEL}"),
    Column("model_damping", "N s/m", f"damping {MODEL}"),
    Column("tank", "J", "energy in the tank; NaN if the law has no tank"),
    Column("port_energy", "J", "energy from the hand, at most what the dynamics can store"),
    Column("master_energy", "J", "energy from the hand to the channel; 0, not used by a law"),
    Column("slave_energy", "J", "energy from the environment to the channel; 0, not used by a law"),
    Column("report_age", "s", "age of the packet from the slave that the master uses"),
    Column("motion_age", "s", "age of the packet from the master that the slave uses"),
)
"""Additional columns of a trial with force feedback or a communication channel: the fields of
`teleop.control.bilateral.LinkValues`."""
STATION_COLUMNS = (
    Column("station_clock", "s", "time of the tick on the clock of this station"),
    Column("sent_datagrams", "-", "datagrams that were sent to the other station so far"),
    Column("received_datagram", "-", "number of the newest datagram of the other station, from 0"),
    Column("other_mode", "-", f"mode of the other station: {MODES}"),
    Column("offset_low", "s", "time here minus time at the other station, lower bound"),
    Column("offset_high", "s", "the same, upper bound"),
    Column(
        "round_trip",
        "s",
        "time since the data were sent with which the other station computed those used here",
    ),
    Column("lost_datagrams", "-", "datagrams of the other station that did not arrive so far"),
    Column(
        "overtaken_datagrams", "-", "datagrams that arrived after a newer one, and were not used"
    ),
    Column("rejected_datagrams", "-", "datagrams that were not accepted"),
)
"""Additional columns of a station, one of two computers: the fields of
`teleop.station.station.ConnectionValues`. At a station, `report_age` and `motion_age` are upper
bounds, because they are differences of the clocks of two computers."""
OBSERVED = "observed_hand_force"
OBSERVER = Column(
    OBSERVED,
    "N",
    "force of the hand by an observer, from the motion of the handle; not in the loop",
)
"""Additional column of a trial with a force-commanded master whose moving mass is known."""
POINTER = (
    Column(
        "pointer_depth",
        "m",
        "where the pointer wants the hand, with limited speed; NaN before the drives are armed",
    ),
    Column("pointer_grip", "-", "1 while the pointer holds the handle"),
    Column("pointer_clock", "s", "time of the measurement on the clock of the loop"),
)
"""Additional columns if the pointer of the live page is the operator. With these columns, the trial
can be repeated exactly."""


class Schema(NamedTuple):
    """Names of the values in the records of a trial, from which processes read them."""

    columns: tuple[Column, ...]
    """Name, unit and meaning of each column of the recording."""
    loop: tuple[str, ...]
    """Columns in the record of a tick, after the time at which it was written."""
    estimation: tuple[str, ...]
    """Columns in the record of the estimates of a tick."""
    estimators: tuple[str, ...]
    """Names of the estimators."""

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Schema:
        """Return the schema in a JSON document, that is, `_asdict` of a schema."""
        columns = tuple(Column(*column) for column in document["columns"])
        others = (tuple(document[name]) for name in ("loop", "estimation", "estimators"))
        return cls(columns, *others)


class Layout:
    """The columns of a trial, and how the loop writes the values of a tick.

    Parameters
    ----------
    bank
        The estimators by name.
    link
        `FEEDBACK_COLUMNS` in a trial with a communication channel or with force feedback.
    pointer
        Simulated operator whose hand follows the pointer of the live page.
    observer
        Whether an observer estimates the force of the hand.

    Attributes
    ----------
    schema
        Names of the columns.
    """

    def __init__(
        self,
        bank: Mapping[str, Estimator],
        link: Sequence[Column] = (),
        pointer: PointerOperator | None = None,
        observer: bool = False,
    ) -> None:
        self._pointer, self._observer = pointer, observer
        regressors_of = (e.model.further_regressors for e in bank.values())
        model = max(regressors_of, key=len, default=())
        regressors = (
            Column(f"{REGRESSOR}{name}", unit, f"regressor of {name}, as given to the estimators")
            for name, unit in model
        )
        of_estimators = (*regressors, *estimate_columns(bank), *misfit_columns(bank))
        extra = (*link, *(POINTER if pointer else ()), *((OBSERVER,) if observer else ()))
        self.schema = Schema(
            (*COLUMNS, DROPPED, *of_estimators, *extra),
            (*OF_LOOP, DROPPED.name, *(column.name for column in extra)),
            (*OF_ESTIMATION, *(column.name for column in of_estimators)),
            tuple(bank),
        )
        self._of_link = len(link)
        self._pack_into = Struct(f"@{1 + len(self.schema.loop)}d").pack_into

    def write(self, memory: mmap, place: int, now: float, record: Record, dropped: float) -> None:
        """Write the record of a tick to a place in the memory.

        `now` is the time of writing [s], and `dropped` the number of ticks that were not recorded.
        """
        further: tuple[float, ...] = ()
        if pointer := self._pointer:
            further = pointer.depth, pointer.grip, record.measurement.time
        if self._observer:
            further = (*further, record.observed_hand_force)
        link = record.link[: self._of_link]  # in the order of the columns
        self._pack_into(memory, place, now, *values_of(record), dropped, *link, *further)
