"""`teleop run`: one palpation on a rig."""

from __future__ import annotations

from datetime import datetime
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from teleop.commands.overwriting import Overwrite
from teleop.names import (
    ClockName,
    ConditioningName,
    ConditionName,
    CouplingName,
    CubeName,
    ModelName,
    RealtimeName,
    SignalName,
)

if TYPE_CHECKING:
    from teleop.trial.run import Trial


def run(
    *,
    condition: ConditionName = "free",
    rig: Path | None = None,
    cube: CubeName = "soft",
    duration: float = 10.0,
    clock: ClockName = "real",
    rate: float | None = None,
    depth: str | None = None,
    seed: int = 0,
    signal: SignalName = "sine",
    frequency: float = 2.0,
    coupling: CouplingName = "velocity",
    conditioning: ConditioningName = "matched",
    bandwidth: float = 20.0,
    force_lag: float = 0.0,
    estimators: str = "rls,ai,me",
    model: ModelName = "kelvin-voigt",
    realtime: RealtimeName = "try",
    tare: Path | None = None,
    record: Path | None = None,
    no_record: Annotated[bool, Parameter(negative="")] = False,
    plot: Path | None = None,
    overwrite: Overwrite = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Palpate, and estimate stiffness and damping of what is touched meanwhile.

    Ctrl-C ramps the slave to a stop, twice stops it at once. In a terminal Enter and Space are an
    emergency stop.

    Example: `teleop run --condition autonomous --cube hard --plot hard.png`

    Parameters
    ----------
    condition
        An operator palpates as they like (free), tries to track a sine (mimic), or the PE
        injector moves the slave and nobody holds the handle (autonomous).
    rig
        Rig file, TOML, that says which devices the rig is made of; by default the rig is
        simulated.
    cube
        The cube on the simulated rig. On another rig: the paper's cube that comes closest, from
        which depth of palpation and adaptation gain are taken.
    duration
        Length of the trial [s].
    clock
        The machine's clock, or virtual time: as fast as it goes, and the same to the bit for
        the same seed.
    rate
        Rate of the loop [Hz]; by default that of the rig file, or 1000.
    depth
        How deep the palpation goes, such as 5mm; by default as deep as the paper's.
    seed
        Seed of the simulated operator and of the sensor noise.
    signal
        Excitation of the autonomous condition.
    frequency
        Its frequency [Hz]: of a multisine the lowest of five harmonics, of a chirp the
        lowest of two octaves.
    coupling
        What of the master the slave follows: its velocity, as in the paper, or its position.
    conditioning
        How velocity is had from the encoder: one state-variable filter on position and force
        alike (matched) or on position alone (svf), first-order adaptive windowing (foaw), or
        a filtered difference.
    bandwidth
        Bandwidth of that filter [Hz]; foaw has none.
    force_lag
        Lag of the force channel [s] that matched conditioning makes up for, as `teleop lag`
        measures it.
    estimators
        Names of estimators, such as rls,kalman,rls_sift, or all.
    model
        What the environment is taken for, by the estimators that take any model.
    realtime
        With the machine's clock: insist on real-time scheduling, locked memory and a processor
        of its own, take what the system permits, or leave all as it is.
    tare
        Zeros of the channels, as `teleop rig tare` writes them.
    record
        Record every tick to this MCAP file, whose folder is created if needed; by default to a
        new one in a dated folder, recordings/DATE/TIME-CONDITION-CUBE.mcap.
    no_record
        Record nothing.
    plot
        Draw the estimates to this .png, .svg or .pdf file.
    json
        Print one JSON document instead of tables.
    """
    import sys

    from teleop.control.tare import NO_TARE, read_tare
    from teleop.errors import InputError, SafetyStop
    from teleop.files import check_outputs, make_folder
    from teleop.output import tables as console
    from teleop.printable import complain, give_up_output
    from teleop.recording.black_box import moment
    from teleop.rig.loading import load_rig_file
    from teleop.trial.choices import choose_estimators, choose_model, make_coupling, make_signal
    from teleop.trial.run import run_trial
    from teleop.trial.settings import TrialSettings
    from teleop.trial.stop_switch import StopSwitch

    rig_file = load_rig_file(rig) if rig else None
    usual_rate = rig_file.sections.rate_hz if rig_file else 1000.0
    settings = TrialSettings(
        condition=condition,
        rig=rig_file,
        depth=read_depth(depth),
        cube=cube,
        duration=duration,
        clock=clock,
        rate=usual_rate if rate is None else rate,
        seed=seed,
        signal=make_signal(signal, frequency),
        coupling=make_coupling(coupling),
        conditioning=conditioning,
        bandwidth=bandwidth,
        force_lag=force_lag,
        estimators=choose_estimators(estimators),
        model=choose_model(model),
        tare=read_tare(tare) if tare else NO_TARE,
    )
    if record and no_record:
        raise InputError("--record and --no-record: expected one of them")
    if record and record.suffix.lower() != ".mcap":
        raise InputError(f"{record}: expected a file ending in .mcap")
    if record:
        make_folder(record)
    check_outputs(record, picture=plot, sources=(rig, tare), overwrite=overwrite)
    reserved = None
    if not (record or no_record):
        record = reserved = new_recording(f"{condition}-{rig.stem if rig else cube}")
    with StopSwitch(key=True) as switch:
        try:
            trial = run_trial(
                settings,
                record,
                sys.stderr.isatty(),
                switch,
                realtime if clock == "real" else "off",
                overwrite=bool(reserved),
            )
        finally:
            if reserved and reserved.exists() and not reserved.stat().st_size:
                reserved.unlink()
        problems = [trial.incomplete] if trial.incomplete else []
        if plot and len(trial.columns["time"]):
            try:
                draw(trial, plot, overwrite)
            except InputError as error:
                problems.append(str(error))
        elif plot:
            complain(f"{plot}: not drawn: nothing was estimated")
        try:
            if json:
                console.print_json(trial.summary())
            else:
                console.print_trial(trial.summary())
        except OSError as error:
            if not (trial.fault or problems):
                raise
            problems.append(give_up_output(error))
    if trial.fault:
        for problem in problems:
            complain(problem)
        raise SafetyStop(f"stopped {moment(trial.fault)}: {trial.fault['text']}")
    if problems:
        raise InputError("; ".join(problems))
    return 130 if trial.interrupted else 0


def draw(trial: Trial, plot: Path, overwrite: bool) -> None:
    """Draw the estimates of a trial; InputError if the file cannot be written."""
    from teleop.output.figures import estimates_figure, save

    settings, columns = trial.settings, trial.columns
    palpated = settings.rig.sections.name if settings.rig else f"{settings.cube} cube"
    figure = estimates_figure(
        f"{settings.condition}, {palpated}",
        columns["time"],
        columns["x"],
        columns["v"],
        trial.estimates,
    )
    save(figure, plot, overwrite)


def read_depth(text: str | None) -> float | None:
    """A depth with its unit [m]; InputError if it has none."""
    from teleop.errors import InputError
    from teleop.evaluation.units import quantity

    depth = None if text is None else quantity(text, "position")
    if text is not None and depth is None:
        raise InputError(f"depth {text!r}: expected a length with its unit, such as 5mm")
    return depth


def new_recording(name: str) -> Path:
    """Create an empty file of a new name in the folder of the day.

    The file is created exclusively: no two runs get the same one.

    Raises
    ------
    InputError
        The folder or the file cannot be made.
    """
    from teleop.files import unwritable

    now = datetime.now()
    folder = Path("recordings") / f"{now:%Y-%m-%d}"
    for number in count(1):
        suffix = f"-{number}" if number > 1 else ""
        path = folder / f"{now:%H%M%S}-{name}{suffix}.mcap"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path.open("x").close()
        except FileExistsError as error:
            if not path.exists():
                raise unwritable(folder, error) from error
        except OSError as error:
            raise unwritable(path, error) from error
        else:
            return path
    raise AssertionError
