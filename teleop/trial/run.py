"""Run one trial: palpate the specimen, estimate its stiffness and damping, and record the data."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from drivers import NotStoppedError, Rig, RigError
from sim_backend import SimulatedRig
from teleop.control.conditions import Condition
from teleop.errors import InputError
from teleop.files import FAULT_REPORT, unwritable
from teleop.names import RealtimeName
from teleop.recording.black_box import BlackBox
from teleop.recording.recorder import RecorderProcess
from teleop.recording.recording import Recording, from_messages
from teleop.recording.recording_file import RecordingFile, recorded_ticks
from teleop.recording.sinks import Memory, Outcome, Sink
from teleop.settings.custom_class import described
from teleop.settings.ranges import IN_MEMORY
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.arming import check_stated
from teleop.trial.assembly import (
    RigMaker,
    make_clock,
    make_condition,
    make_controller,
    make_layout,
    make_rig,
)
from teleop.trial.later_estimates import LaterEstimates
from teleop.trial.live_link import LiveLink
from teleop.trial.loop import Loop
from teleop.trial.metadata import session_metadata
from teleop.trial.realtime import realtime
from teleop.trial.rehearsal import check_rate, check_wire
from teleop.trial.result import Trial
from teleop.trial.stop_switch import StopSwitch


def run_trial(
    settings: TrialSettings,
    record: Path | None = None,
    show: bool = False,
    switch: StopSwitch | None = None,
    real: RealtimeName = "off",
    overwrite: bool = False,
    condition: Condition | None = None,
    rig_maker: RigMaker | None = None,
    live: LiveLink | None = None,
    arm: bool = False,
) -> Trial:
    """Run a trial until its end, a fault, or Ctrl-C. Then disable the drives; return the result.

    Parameters
    ----------
    settings
        Settings of the trial.
    record
        MCAP file of the recording, which another process writes; None to store the data in memory.
    show
        Whether to show a progress line on standard error.
    switch
        Stop switch, with which a person stops the trial. Call this function within its `with`
        block. By default, signals such as Ctrl-C stop the trial. On a hardware rig, Enter and Space
        in the terminal also stop it.
    real
        Whether to apply real-time settings: `require`, `try` or `off`, see `realtime`.
    overwrite
        Whether to overwrite an existing MCAP file.
    condition
        Control condition that replaces the condition of the settings. Its class is recorded. The
        recorded trial can be run again if the class is a dataclass in an installed package.
    rig_maker
        Function that creates a rig, which replaces the rig of the settings.
    live
        Link to the process that serves the live page (a web page); None for no live page.
    arm
        Whether a person has permitted the drives to move, for example by the answer to
        `teleop.trial.arming.is_armed`. Needed on every rig except the simulated rig, unless the
        drives are armed in the live page.

    Raises
    ------
    InputError
        The trial is too long to be kept in memory, the machine cannot run at the rate, the
        recording cannot be written, a required real-time step failed, the settings of a trial on
        a hardware rig have no specimen or no depth, nobody has armed its drives, or the class of
        the user that the settings state is not installed.
    RigError
        The rig cannot be opened, a device cannot be read before the loop starts, or the drives did
        not become ready.
    Exception
        An exception in a tick (period of the control loop). It is raised after the drives have
        stopped and the recording is complete.
    """
    if switch is None:
        with StopSwitch(key=not settings.is_simulated or rig_maker is not None) as switch:
            return run_trial(
                settings, record, show, switch, real, overwrite, condition, rig_maker, live, arm
            )
    check_stated(settings)
    if condition:
        settings = replace(settings, custom_condition=described(condition))
    else:
        condition = make_condition(settings)
    if not record and settings.duration * settings.loop_rate > IN_MEMORY:
        raise InputError(
            f"duration {settings.duration:g} s without a recording: expected at most "
            f"{IN_MEMORY / settings.loop_rate:g} s, because the ticks are kept in memory, or a "
            "recording"
        )
    pointer = live.make_operator() if live else None
    clock = make_clock(settings)
    rig = rig_maker(clock.now) if rig_maker else make_rig(settings, clock.now, pointer)
    if rig_maker:
        settings = replace(settings, custom_rig=described(rig))
    check_armed(settings, rig, arm, live)
    bank = settings.estimation_preset.bank()
    layout = make_layout(settings, bank, pointer)
    metadata = session_metadata(settings)
    recorder = loop = None
    target = settings.target
    if record or show:
        recorder = RecorderProcess(
            record,
            layout,
            metadata,
            settings.duration,
            show,
            settings.clock == "virtual",
            overwrite,
            switch.hint,
            "" if switch.explained else switch.instructions,
            (target.depth, target.count_in) if settings.condition_name == "mimic" else None,
        )
    memory = None if record else Memory()
    box = BlackBox(layout, settings.loop_rate)
    sinks: list[Sink] = [sink for sink in (recorder, memory, box, live) if sink]
    later = None
    if settings.clock == "virtual" and not live:
        later = LaterEstimates(settings.make_conditioner(), bank, layout, sinks)
    try:
        cost = check_rate(settings) if settings.clock == "real" else 0.0
        start = time.time_ns() + round((settings.limits.preflight + clock.period) * 1e9)
        if recorder:
            recorder.begin(start)
        rejected: dict[str, dict[str, int]] = {}
        try:
            with switch.reading_keys(), realtime(real) as real_time, rig:
                if settings.rig:
                    check_wire(rig, clock, cost)
                controller = make_controller(settings, rig, bank, clock, condition, later)
                receivers = [later] if later else sinks
                loop = Loop(controller, clock, layout, receivers, switch, settings.duration)
                if live:
                    switch.page = live.begin(settings, layout)
                real_time.start(
                    recorder.process.pid if recorder else None, live.pid if live else None
                )
                loop.run()
                switch.clean_up()
                rejected = {name: dict(counts) for name, counts in rig.rejected.items()}
        except NotStoppedError as unstopped:
            if not loop:
                raise
            loop.end_unstopped(str(unstopped))
        except RigError:
            if not loop or not (loop.error or box.fault):
                raise
    finally:
        switch.clean_up()
        try:
            if later:
                later.close()
        finally:
            outcomes = [sink.close() for sink in sinks]
    assert loop
    ticks: Recording | RecordingFile
    outcome = outcomes[0] if record else Outcome(None, loop.ticks, 0, "")
    if memory:
        ticks = from_messages(layout.definition, memory.messages, memory.events, metadata)
    else:
        assert record
        ticks = (recorded_ticks(record) if outcome.at_path else None) or box.recording(metadata)
    folder, box_problem, error, fault = None, "", loop.error, box.fault
    error = error or (later.error if later else None)
    if record and fault:
        folder = record.with_suffix(FAULT_REPORT)
        try:
            write_black_box(folder, box, metadata, start)
        except InputError as problem:
            folder, box_problem = None, f"black box: {problem}"
    if error and not isinstance(error, RigError):
        error.add_note(f"The drives were stopped. Recording: {record}. Black box: {folder}.")
        for text in filter(None, (outcome.problem, box_problem)):
            error.add_note(f"Not complete: {text}.")
        raise error
    return Trial(
        settings,
        ticks,
        bank,
        switch.interrupted,
        outcome,
        real_time.report,
        fault,
        rejected,
        folder,
        box_problem,
    )


def check_armed(settings: TrialSettings, rig: Rig, arm: bool, live: LiveLink | None) -> None:
    """Check that a person has permitted the drives to move, or can do so in the live page.

    Raises
    ------
    InputError
        Nobody has, nor can, and the rig is not a simulated one.
    """
    # a derived class, such as one with a real sensor or drive, is not known to be harmless
    simulated = settings.is_simulated or type(rig) is SimulatedRig
    if not (simulated or arm is True or (live and live.by_page)):
        raise InputError(
            f"rig {settings.rig_name!r}: nobody has armed the drives: expected arm=True, after a "
            "person has permitted them to move"
        )


def write_black_box(
    folder: Path, box: BlackBox, metadata: dict[str, dict[str, str]], start: int
) -> None:
    """Write the ticks before and after a fault, and the cause of the fault, to a folder.

    A tick is one period of the control loop. matplotlib is imported here, after the loop has ended,
    because its import is slow.

    Parameters
    ----------
    folder
        The folder; created if it does not exist.
    box
        The black box, which stores the fault and these ticks in memory.
    metadata
        Metadata of the recording, see `session_metadata`.
    start
        Wall-clock time of the beginning of the trial, as nanoseconds since 1970 (Unix time).

    Raises
    ------
    InputError
        The folder or a file cannot be written.
    """
    from teleop.output.fault_report import write_fault_report

    fault: dict[str, Any] | None = box.fault
    assert fault
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(folder, error) from error
    box.write(folder / "ticks.mcap", metadata, start)
    write_fault_report(folder, box.recording(metadata), fault)
