"""Run one trial: palpate the specimen, estimate its stiffness and damping, and record the data."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from drivers import NotStoppedError, Rig, RigError
from sim_backend import SimulatedRig
from teleop.control.conditions import Condition
from teleop.errors import InputError
from teleop.names import RealtimeName
from teleop.printable import print_error
from teleop.settings.custom_class import described, with_averaged
from teleop.settings.ranges import MOST_TICKS_IN_MEMORY, RATE
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.arming import check_stated
from teleop.trial.assembly import (
    RigMaker,
    make_clock,
    make_condition,
    make_controller,
    make_layout,
    make_rig,
    prepared,
)
from teleop.trial.live_link import LiveLink
from teleop.trial.loop import Loop
from teleop.trial.outputs import Outputs
from teleop.trial.realtime import realtime
from teleop.trial.rehearsal import check_rate, check_wire
from teleop.trial.result import Trial
from teleop.trial.station_waiting import Waiting
from teleop.trial.stop_switch import StopSwitch
from teleop.trial.viewer import Viewer


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
    viewers: Sequence[Viewer] = (),
    station: Waiting | None = None,
) -> Trial:
    """Run a trial until its end, a fault, or Ctrl-C. Then disable the drives; return the result.

    Before a trial in real time, the loop is measured on this computer, see `check_rate`. If its
    rate is higher than usual, the verdict is printed on standard error.

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
    viewers
        Other viewers of the running trial, in other processes.
    station
        Connection to the other station, if the settings state the side of this one.

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
        An exception in a tick. It is raised after the drives have
        stopped and the recording is complete.
    """
    if switch is None:
        is_real = not settings.is_simulated or rig_maker is not None
        with StopSwitch(key=is_real and settings.clock == "real") as switch:
            return run_trial(
                settings,
                record,
                show,
                switch,
                real,
                overwrite,
                condition,
                rig_maker,
                live,
                arm,
                viewers,
                station,
            )
    check_stated(settings)
    if settings.station and not station:
        raise InputError(
            f"station: the settings are those of the {settings.station.side} of two computers: "
            f"expected teleop station {settings.station.side}"
        )
    if condition:
        settings = replace(settings, custom_condition=described(condition))
        condition = prepared(condition, settings)
    else:
        condition = make_condition(settings)
    if custom := settings.custom_condition:
        known = with_averaged(custom, condition, settings.intended_motion)
        settings = replace(settings, custom_condition=known)
    check_memory(settings, record)
    clock = make_clock(settings)
    pointer = live.make_operator() if live else None
    rig = rig_maker(clock.now) if rig_maker else make_rig(settings, clock.now, pointer)
    if rig_maker:
        settings = replace(settings, custom_rig=described(rig))
    check_armed(settings, rig, arm, live)
    bank = settings.estimation_preset.bank()
    layout = make_layout(settings, bank, pointer)
    checked = check_rate(settings, real) if settings.clock == "real" else None
    if checked and settings.loop_rate > RATE:
        print_error(checked.text)
    shown_by = (*([live] if live else []), *viewers)
    outputs = Outputs(settings, layout, bank, switch, record, overwrite, show, shown_by, checked)
    loop = None
    try:
        outputs.begin(time.time_ns() + round((settings.limits.preflight + clock.period) * 1e9))
        rejected: dict[str, dict[str, int]] = {}
        try:
            with switch.reading_keys(), realtime(real) as applied, rig:
                if settings.rig:
                    check_wire(rig, clock, checked.cost if checked else 0.0)
                session = station.begin(clock) if station else None
                controller = make_controller(settings, rig, clock, condition, session)
                if session:
                    switch.station = session
                stream, readers = outputs.stream, outputs.readers
                loop = Loop(controller, clock, stream, readers, switch, settings.duration)
                if live:
                    switch.page = live.begin(settings, stream)
                for viewer in viewers:
                    viewer.begin(settings, stream)
                applied.start(live.pid if live else None, readers.estimation_pid)
                try:
                    loop.run()
                finally:
                    if session:
                        session.finish()
                # no signal may interrupt the closing of rig and files
                switch.clean_up()
                rejected = {name: dict(counts) for name, counts in rig.rejected.items()}
        except NotStoppedError as unstopped:
            if not loop:
                raise
            loop.end_unstopped(str(unstopped))
        except RigError:
            # a rig that fails while it is closed, after a fault, must not hide the fault
            if not loop or not (loop.error or outputs.fault):
                raise
    finally:
        switch.clean_up()
        outputs.close()
        for viewer in shown_by:
            viewer.end_trial()
    ticks = outputs.ticks()
    outputs.write_black_box()
    error = loop.error
    if error and not isinstance(error, RigError):
        outputs.add_notes(error)
        raise error
    return Trial(
        settings,
        ticks,
        bank,
        switch.interrupted,
        outputs.outcome,
        applied.report,
        outputs.fault,
        rejected,
        outputs.black_box,
        outputs.black_box_problem,
        "" if switch.interrupted or outputs.fault else loop.controller.ending,
        readers.failure,
        readers.traceback,
        outputs.stream.missed,
    )


def check_memory(settings: TrialSettings, record: Path | None) -> None:
    """Check that the ticks of a trial without a recording fit into the memory."""
    if not record and settings.duration * settings.loop_rate > MOST_TICKS_IN_MEMORY:
        raise InputError(
            f"duration {settings.duration:g} s without a recording: expected at most "
            f"{MOST_TICKS_IN_MEMORY / settings.loop_rate:g} s, because the ticks are kept in "
            "memory, or a recording"
        )


def check_armed(settings: TrialSettings, rig: Rig, arm: bool, live: LiveLink | None) -> None:
    """Check that a person has permitted the drives to move, or can do so in the live page."""
    # a derived class, such as one with a real sensor or drive, is not known to be harmless
    simulated = settings.is_simulated or type(rig) is SimulatedRig
    simulated |= settings.clock == "virtual" and rig.virtual_time
    if not (simulated or arm is True or (live and live.by_page)):
        raise InputError(
            f"rig {settings.rig_name!r}: nobody has armed the drives: expected arm=True, after a "
            "person has permitted them to move"
        )
