"""`teleop run`: run one trial on the simulated rig or a hardware rig."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from teleop.commands.live_options import NOT_LIVE, Live
from teleop.commands.overwriting import Overwrite
from teleop.commands.quantities import Hertz, Length, Seconds
from teleop.names import (
    ClockName,
    ConditioningName,
    ConditionName,
    CouplingName,
    CubeName,
    FeedbackName,
    ModelName,
    RealtimeName,
    SignalName,
    WidthName,
)


def run(
    *,
    config: Path | None = None,
    condition: ConditionName | None = None,
    rig: Path | None = None,
    cube: CubeName | None = None,
    specimen: str | None = None,
    operator: str | None = None,
    notes: str | None = None,
    duration: Seconds | None = None,
    clock: ClockName | None = None,
    rate: Hertz | None = None,
    depth: Length | None = None,
    seed: int | None = None,
    signal: SignalName | None = None,
    frequency: Hertz | None = None,
    coupling: CouplingName | None = None,
    feedback: FeedbackName | None = None,
    channel: str | None = None,
    conditioning: ConditioningName | None = None,
    bandwidth: Hertz | None = None,
    force_lag: Seconds | None = None,
    estimators: str | None = None,
    model: ModelName | None = None,
    realtime: RealtimeName = "try",
    tare: Path | None = None,
    record: Path | None = None,
    no_record: Annotated[bool, Parameter(negative="")] = False,
    plot: Path | None = None,
    yes: Annotated[bool, Parameter(negative="")] = False,
    plot_force: Path | None = None,
    plot_tracking: Path | None = None,
    width: WidthName = "screen",
    overwrite: Overwrite = False,
    json: Annotated[bool, Parameter(negative="")] = False,
    live: Live = NOT_LIVE,
) -> int:
    """Palpate, and estimate stiffness and damping of the environment at the same time.

    Ctrl-C decelerates the slave to rest. A second Ctrl-C stops the slave at once. In a terminal,
    Enter or Space is an emergency stop.

    Example: `teleop run --condition autonomous --cube hard --plot hard.png`

    Parameters
    ----------
    config
        Configuration file (TOML), as written by `teleop config init`, or a recording, whose trial
        is run again. The other options override the settings of this file. The defaults below
        apply without such a file.
    condition
        Control condition: the operator palpates freely (free); the operator moves the slave along
        a sine (mimic); or an excitation signal moves the slave, and nobody holds the handle
        (autonomous). Default: free.
    rig
        Rig file (TOML) that lists the devices of the rig. Default: the simulated rig.
    cube
        Cube on the simulated rig. Not with a rig file. Default: soft.
    specimen
        Name of the specimen. Needed with a rig file. Default: the cube of the simulated rig.
    operator
        Name of the operator, for the recording. With the name pointer and --live, the mouse or a
        finger in the live page moves the handle of the simulated rig.
    notes
        Notes, for the recording.
    duration
        Duration of the trial [s]. Default: 10.
    clock
        real: the trial runs in real time. virtual: the trial runs as fast as possible, with exactly
        the same result for the same seed. Default: real.
    rate
        Sampling rate of the control loop [Hz]. Default: the rate in the rig file, or 1000.
    depth
        Depth of the palpation with its unit, such as 5mm. Needed with a rig file. Default: the
        paper's depth for the cube.
    seed
        Seed of the simulated operator and of the sensor noise. Default: 0.
    signal
        Excitation signal of the autonomous condition. Default: sine.
    frequency
        Frequency of the excitation signal, or of the sine that the operator follows in mimic
        [Hz]. For a multisine, it is the lowest of five harmonics; for a chirp over two octaves,
        the lowest frequency. Default: 1 in mimic, 2 otherwise.
    coupling
        velocity: the slave follows the velocity of the master, as in the paper. position: the slave
        also follows the position of the master. Default: velocity.
    feedback
        Force feedback to the hand: none; the contact force (position-force); or a local model of
        the specimen at the master (model-mediated). Default: none.
    channel
        Communication channel between master and slave, such as delay=100ms,jitter=20ms,loss=5%.
        The delay is one-way, so the round trip is twice the delay. Default: none.
    conditioning
        How velocity is computed from the encoder position: by a state-variable filter on position
        and force (matched), or on position only (svf); by first-order adaptive windowing (foaw);
        or by a filtered difference (difference). Default: matched.
    bandwidth
        Bandwidth of the conditioning filter [Hz]; not used by foaw. Default: 20.
    force_lag
        Lag of the force channel, such as 2.66ms, as measured by `teleop lag`; matched
        conditioning compensates it. Default: 0.
    estimators
        Names of estimators, such as rls,kalman,rls_sift, or all. Default: rls,ai,me.
    model
        Model of the environment, for the estimators that support several models. Default:
        kelvin-voigt.
    realtime
        Real-time settings, used with --clock real: real-time scheduling, locked memory, no garbage
        collection, and a processor for the loop only. require: fail if a setting is refused. try:
        apply the settings that the system allows. off: apply none.
    tare
        File with the zero offsets of the channels, from `teleop rig tare`.
    record
        Record every tick to this MCAP file; its folder is created if needed. Default: a new file
        recordings/DATE/TIME-CONDITION-SPECIMEN.mcap.
    no_record
        Do not record.
    plot
        Plot the estimates to this .png, .svg or .pdf file.
    yes
        Arm the drives of a hardware rig without asking, for scripts.
    plot_force
        Plot the measured and the predicted force to this .png, .svg or .pdf file.
    plot_tracking
        In mimic, plot the target, the position of the slave, and the difference between them, to
        this .png, .svg or .pdf file.
    width
        Width of the figures: for a screen (screen), one column (single) or two columns (double) of
        an IEEE paper, or an A4 page (a4).
    json
        Print one JSON document instead of tables.
    """
    from teleop.commands.choices import (
        choose_estimators,
        choose_model,
        make_channel,
        make_coupling,
        make_signal,
    )
    from teleop.commands.live_trials import run_from_page
    from teleop.commands.one_trial import TrialRunner
    from teleop.control.conditions import CONDITIONS
    from teleop.control.tare import read_tare
    from teleop.errors import InputError
    from teleop.files import RECORDING, check_ending, check_outputs, make_folder
    from teleop.printable import print_error
    from teleop.settings.configuration import read_configuration
    from teleop.settings.feedback_checks import check_feedback
    from teleop.settings.rig_loading import load_rig_file
    from teleop.settings.trial_settings import TrialSettings
    from teleop.trial.arming import arming_text, check_stated, is_armed

    settings = read_configuration(config) if config else TrialSettings()
    rig_file = load_rig_file(rig) if rig else None
    if signal or frequency is not None:
        usual = CONDITIONS[condition or settings.condition].default_frequency
        kind = signal or settings.excitation.kind
        excitation = make_signal(kind, usual if frequency is None else frequency)
    else:
        excitation = None
    options: dict[str, Any] = {
        "condition": condition,
        "rig": rig_file,
        "depth": depth,
        "cube": cube,
        "specimen": specimen,
        "operator": operator,
        "notes": notes,
        "duration": duration,
        "clock": clock,
        "rate": rate,
        "seed": seed,
        "signal": excitation,
        "coupling": coupling and make_coupling(coupling),
        "feedback": feedback and replace(settings.feedback, law=feedback),
        "channel": channel and make_channel(channel),
        "conditioning": conditioning,
        "bandwidth": bandwidth,
        "force_lag": force_lag,
        "estimators": None if estimators is None else choose_estimators(estimators),
        "model": model and choose_model(model),
        "tare": tare and read_tare(tare),
    }
    if condition:
        settings = replace(settings, custom_condition=None)
    if rig_file:  # a recorded rate is that of the recorded rig
        settings = replace(settings, custom_rig=None, rate=None)
    settings = replace(settings, **{name: v for name, v in options.items() if v is not None})
    if cube and settings.rig:
        raise InputError("--cube: belongs to the simulated rig: expected --specimen and --depth")
    check_stated(settings)
    if warning := check_feedback(settings):
        print_error(warning)
    if record and no_record:
        raise InputError("--record and --no-record: expected at most one of them")
    if record:
        check_ending(record, RECORDING)
        make_folder(record)
    sources = (config, rig, tare)
    if plot_tracking and not settings.target:
        motion = settings.intended_motion
        followed = [name for name, one in CONDITIONS.items() if one.target_for(motion)]
        raise InputError(
            f"--plot-tracking: expected --condition {' or '.join(followed)}, in which there is a "
            "target"
        )
    pictures = (plot, plot_force, plot_tracking)
    check_outputs(record, pictures=pictures, sources=sources, overwrite=overwrite)
    live = live.requested([settings])
    by_page = live.arms([settings], yes)
    asked = settings.rig if not (by_page or yes) else None
    if asked and not is_armed(asked, arming_text(settings)):
        return 130
    outputs = (record, no_record, *pictures, width, overwrite, json, realtime)
    with live.linked([settings], by_page, choose=by_page) as link:
        runner = TrialRunner(*outputs, link, explained=bool(asked))
        if link and by_page:
            return run_from_page(link, settings, runner, once=bool(record or any(pictures)))
        return runner.run(settings)
