"""`teleop station`: run one side of a telemanipulator whose other side is on another computer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from teleop.commands.estimation_options import NEW_TRIAL, Estimation
from teleop.commands.live_options import NOT_LIVE, Live
from teleop.commands.one_trial import TABLES, Output
from teleop.commands.options import CONTROL, TRIAL
from teleop.commands.quantities import Length, Seconds
from teleop.commands.trial_options import DEFAULTS, Trial
from teleop.names import RealtimeName

if TYPE_CHECKING:
    from teleop.control.station_settings import StationSettings

station = App(
    name="station",
    help="Run the master or the slave of a telemanipulator on two computers; make their key.",
)
KeyFile = Annotated[Path, Parameter(group=TRIAL)]
Yes = Annotated[bool, Parameter(group=TRIAL)]
Silence = Annotated[Seconds, Parameter(group=CONTROL)]
Realtime = Annotated[RealtimeName, Parameter(group=CONTROL)]


@station.command
def key(file: Path, /) -> int:
    """Write a new random key, which both stations need, to a file.

    Copy the file to the other computer over a connection that is encrypted, such as scp. Whoever
    has the key can control the drives.

    Example: `teleop station key station.key`

    Parameters
    ----------
    file
        File to write. It must not exist.
    """
    from teleop.station.keys import write_key

    write_key(file)
    print(f"{file}: copy it to the other computer, for example with scp")
    return 0


@station.command
def slave(
    rig: Path | None = None,
    /,
    *,
    listen: Annotated[str, Parameter(group=TRIAL)],
    key: KeyFile,
    yes: Yes = False,
    max_silence: Silence = 0.1,
    retreat: Annotated[Length, Parameter(group=CONTROL)] = 0.0,
    realtime: Realtime = "try",
    live: Live = NOT_LIVE,
    trial: Trial = DEFAULTS,
    estimation: Estimation = NEW_TRIAL,
    output: Output = TABLES,
) -> int:
    """Wait for the master station, and then move the slave as the master moves.

    The slave is armed first, and holds its position until the master is armed. It follows only a
    master whose drives are armed.

    Example: `teleop station slave --listen 127.0.0.1 --key station.key`

    Parameters
    ----------
    rig
        Rig file (TOML) with the drive and the channels of the slave only. Default: the slave of the
        simulated rig.
    listen
        Address of this computer, such as 192.168.1.2 or 192.168.1.2:47100.
    key
        Key file that both stations have, from `teleop station key`.
    yes
        Arm the drives of a hardware rig without asking, for scripts.
    max_silence
        Longest time without data of the master [s]. After this time, the drives are stopped.
    retreat
        Distance by which the slave moves out of the specimen after a silence, before it stops, such
        as 5mm. Default: 0, it stops where it is.
    realtime
        Real-time settings, as for `teleop run`.
    """
    from teleop.commands.station_runs import run_station
    from teleop.control.station_settings import StationSettings
    from teleop.errors import as_input_error

    with as_input_error():
        given: StationSettings = StationSettings("slave", max_silence, retreat)
    return run_station(rig, given, listen, key, yes, realtime, live, trial, estimation, output)


@station.command
def master(
    rig: Path | None = None,
    /,
    *,
    connect: Annotated[str, Parameter(group=TRIAL)],
    key: KeyFile,
    yes: Yes = False,
    max_silence: Silence = 0.1,
    realtime: Realtime = "try",
    live: Live = NOT_LIVE,
    trial: Trial = DEFAULTS,
    estimation: Estimation = NEW_TRIAL,
    output: Output = TABLES,
) -> int:
    """Connect to the waiting slave station, and move its slave.

    The drives are armed when the person at each station has permitted it, and the round trip is
    short enough for the force feedback.

    Example: `teleop station master --connect 127.0.0.1 --key station.key`

    Parameters
    ----------
    rig
        Rig file (TOML) with the drive and the channels of the master only. Default: the master of
        the simulated rig.
    connect
        Address of the slave station, such as 192.168.1.2 or 192.168.1.2:47100.
    key
        Key file that both stations have, from `teleop station key`.
    yes
        Arm the drives of a hardware rig without asking, for scripts.
    max_silence
        Longest time without data of the slave [s]. After this time, the drives are stopped.
    realtime
        Real-time settings, as for `teleop run`.
    """
    from teleop.commands.station_runs import run_station
    from teleop.control.station_settings import StationSettings
    from teleop.errors import as_input_error

    with as_input_error():
        given = StationSettings("master", max_silence)
    return run_station(rig, given, connect, key, yes, realtime, live, trial, estimation, output)
