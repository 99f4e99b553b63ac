"""Run one trial: palpate the specimen, estimate its stiffness and damping, and record the data."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from drivers import NotStoppedError, RigError
from teleop.control.conditions import Condition
from teleop.errors import InputError
from teleop.files import FAULT_REPORT, unwritable
from teleop.names import RealtimeName
from teleop.recording.black_box import BlackBox
from teleop.recording.recorder import RecorderProcess
from teleop.recording.recording import Recording, from_messages
from teleop.recording.recording_file import RecordingFile, recorded_ticks
from teleop.recording.sinks import Memory, Outcome, Sink
from teleop.trial.arming import check_stated
from teleop.trial.assembly import RigMaker, make_clock, make_controller, make_layout, make_rig
from teleop.trial.later_estimates import LaterEstimates
from teleop.trial.live_link import LiveLink
from teleop.trial.loop import Loop
from teleop.trial.metadata import session_metadata
from teleop.trial.ranges import IN_MEMORY
from teleop.trial.realtime import realtime
from teleop.trial.rehearsal import check_rate, check_wire
from teleop.trial.result import Trial
from teleop.trial.settings import TrialSettings
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
        block. By default, signals such as Ctrl-C stop the trial, but no other key does.
    real
        Whether to apply real-time settings: `require`, `try` or `off`, see `realtime`.
    overwrite
        Whether to overwrite an existing MCAP file.
    condition
        Control condition that replaces the condition of the settings.
    rig_maker
        Function that creates a rig, which replaces the rig of the settings.
    live
        Link to the process that serves the live page (a web page); None for no live page.

    Raises
    ------
    InputError
        The trial is too long to be kept in memory, the machine cannot run at the rate, the
        recording cannot be written, a required real-time step failed, or the settings of a trial on
        a hardware rig have no specimen or no depth.
    RigError
        The rig cannot be opened, a device cannot be read before the loop starts, or the drives did
        not become ready.
    Exception
        An exception in a tick (period of the control loop). It is raised after the drives have
        stopped and the recording is complete.
    """
    if switch is None:
        with StopSwitch() as switch:
            return run_trial(
                settings, record, show, switch, real, overwrite, condition, rig_maker, live
            )
    if condition is None:
        check_stated(settings)
    if not record and settings.duration * settings.rate > IN_MEMORY:
        raise InputError(
            f"duration {settings.duration:g} s without a recording: expected at most "
            f"{IN_MEMORY / settings.rate:g} s, because the ticks are kept in memory, or a recording"
        )
    bank = settings.estimation_preset.bank()
    pointer = live.make_operator() if live else None
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
            (target.depth, target.count_in) if settings.condition == "mimic" else None,
        )
    memory = None if record else Memory()
    box = BlackBox(layout, settings.rate)
    sinks: list[Sink] = [sink for sink in (recorder, memory, box, live) if sink]
    later = None
    if settings.clock == "virtual" and not live:
        later = LaterEstimates(settings.make_conditioner(), bank, layout, sinks)
    try:
        cost = check_rate(settings) if settings.clock == "real" else 0.0
        clock = make_clock(settings)
        start = time.time_ns() + round((settings.limits.preflight + clock.period) * 1e9)
        if recorder:
            recorder.begin(start)
        rig = rig_maker(clock.now) if rig_maker else make_rig(settings, clock.now, pointer)
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
                real_time.start(recorder.process.pid if recorder else None)
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
