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
    from teleop.trial.result import Trial


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
    """Palpate, and estimate stiffness and damping of the environment at the same time.

    Ctrl-C ramps the slave to a stop; a second Ctrl-C stops it at once. In a terminal, Enter and
    Space are an emergency stop.

    Example: `teleop run --condition autonomous --cube hard --plot hard.png`

    Parameters
    ----------
    condition
        Control condition: the operator palpates freely (free), tries to track a sine (mimic), or
        the PE injector moves the slave and the handle is free (autonomous).
    rig
        Rig file (TOML) that lists the devices of the rig. Default: the simulated rig.
    cube
        Cube on the simulated rig. With a rig file: the paper's cube that is most similar to the
        specimen; it sets depth of palpation and adaptation gain.
    duration
        Duration of the trial [s].
    clock
        real: the machine's clock. virtual: as fast as possible, with exactly the same result for
        the same seed.
    rate
        Rate of the loop [Hz]. Default: the rate in the rig file, or 1000.
    depth
        Depth of the palpation with its unit, such as 5mm. Default: the paper's depth.
    seed
        Seed of the simulated operator and of the sensor noise.
    signal
        Excitation signal of the autonomous condition.
    frequency
        Frequency of the excitation signal [Hz]. For a multisine, the lowest of five harmonics;
        for a chirp over two octaves, the lowest frequency.
    coupling
        The slave follows the velocity of the master, as in the paper, or also its position.
    conditioning
        How velocity is computed from the encoder: by one state-variable filter on position and
        force (matched), or on position only (svf); by first-order adaptive windowing (foaw); or
        by a filtered difference (difference).
    bandwidth
        Bandwidth of the conditioning filter [Hz]; not used by foaw.
    force_lag
        Lag of the force channel [s], as measured by `teleop lag`; matched conditioning
        compensates it.
    estimators
        Names of estimators, such as rls,kalman,rls_sift, or all.
    model
        Model of the environment, for the estimators that support any model.
    realtime
        Real-time scheduling, locked memory and a processor of its own, with the machine's clock.
        require: fail if a setting is refused. try: apply the settings that the system allows.
        off: apply none.
    tare
        File with the zeros of the channels, from `teleop rig tare`.
    record
        Record every tick to this MCAP file; its folder is created if needed. Default: a new file
        recordings/DATE/TIME-CONDITION-CUBE.mcap.
    no_record
        Do not record.
    plot
        Plot the estimates to this .png, .svg or .pdf file.
    json
        Print one JSON document instead of tables.
    """
    import sys

    from teleop.commands.choices import choose_estimators, choose_model, make_coupling, make_signal
    from teleop.control.tare import NO_TARE, read_tare
    from teleop.errors import InputError, SafetyStop
    from teleop.files import check_outputs, make_folder
    from teleop.output import console
    from teleop.output.trial_tables import print_trial
    from teleop.printable import discard_output, print_error
    from teleop.rig.loading import load_rig_file
    from teleop.safety.events import time_text
    from teleop.trial.run import run_trial
    from teleop.trial.settings import TrialSettings
    from teleop.trial.stop_switch import StopSwitch

    rig_file = load_rig_file(rig) if rig else None
    default_rate = rig_file.sections.rate_hz if rig_file else 1000.0
    settings = TrialSettings(
        condition=condition,
        rig=rig_file,
        depth=read_depth(depth),
        cube=cube,
        duration=duration,
        clock=clock,
        rate=default_rate if rate is None else rate,
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
        raise InputError("--record and --no-record: expected at most one of them")
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
            print_error(f"{plot}: not drawn: there are no estimates")
        try:
            if json:
                console.print_json(trial.summary())
            else:
                print_trial(trial.summary())
        except OSError as error:
            if not (trial.fault or problems):
                raise
            problems.append(discard_output(error))
    if trial.fault:
        for problem in problems:
            print_error(problem)
        raise SafetyStop(f"stopped {time_text(trial.fault['time'])}: {trial.fault['text']}")
    if problems:
        raise InputError("; ".join(problems))
    return 130 if trial.interrupted else 0


def draw(trial: Trial, plot: Path, overwrite: bool) -> None:
    """Plot the estimates of a trial to a file.

    Raises
    ------
    InputError
        The file cannot be written.
    """
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
    """Return a depth in m from a text with its unit; None stays None.

    Raises
    ------
    InputError
        The text is not a length with a unit.
    """
    from teleop.errors import InputError
    from teleop.evaluation.formats.delimited import quantity

    depth = None if text is None else quantity(text, "position")
    if text is not None and depth is None:
        raise InputError(f"depth {text!r}: expected a length with its unit, such as 5mm")
    return depth


def new_recording(name: str) -> Path:
    """Create an empty file with a new name in the folder `recordings/DATE`.

    The file is created exclusively, so that two runs never get the same file.

    Parameters
    ----------
    name
        Part of the file name after the time.

    Raises
    ------
    InputError
        The folder or the file cannot be created.
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
