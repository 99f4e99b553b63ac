"""One trial: palpate a cube under a control condition, and estimate while doing so."""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from drivers import RigError
from drivers.registry import device_class
from estimation import Bank, Estimates
from estimation.compiled import Floats
from teleop.errors import InputError
from teleop.json_documents import dumps
from teleop.names import RealtimeName
from teleop.recording.black_box import BlackBox
from teleop.recording.gaps import gap_rows, missing_text
from teleop.recording.message import Layout
from teleop.recording.recording import Recording, from_messages, salvage
from teleop.recording.sinks import Memory, Outcome, RecorderProcess, Sink
from teleop.recording.timing import loop_timing, safety_summary, summarise, tick_times
from teleop.safety.events import ACTIVE, STOPPING
from teleop.trial.loop import Session
from teleop.trial.realtime import realtime
from teleop.trial.rehearsal import check_rate, check_wire
from teleop.trial.settings import TrialSettings
from teleop.trial.stop_switch import StopSwitch


@dataclass(frozen=True)
class Trial:
    """A trial that has been run."""

    settings: TrialSettings
    recording: Recording
    """Every tick; of a recording that broke off, as much as is intact."""
    bank: Bank
    """The estimators in their final state."""
    interrupted: bool
    """Whether a person ended it before its time."""
    outcome: Outcome
    """State of the recording at the end."""
    realtime: dict[str, str]
    """What became of each step of the real-time set-up."""
    fault: dict[str, Any] | None
    """The event that stopped it for safety, if any did."""
    rejected: dict[str, dict[str, int]]
    """How many frames each of the rig's devices did not take, by reason."""
    black_box: Path | None
    """Folder of the black box, where a fault left one."""
    black_box_problem: str = ""
    """Why the black box could not be written; empty if it could, or if there was no fault."""

    @property
    def columns(self) -> dict[str, Floats]:
        """The ticks at which the estimators were given a sample, by column; shape (ticks,)."""
        return self.recording.estimated().columns

    @property
    def estimates(self) -> dict[str, Estimates]:
        """Each estimator's estimates at those ticks."""
        return self.recording.estimated().estimates()

    @property
    def incomplete(self) -> str:
        """What is missing from the files of the trial; empty if nothing is."""
        path, _, dropped, problem, _ = self.outcome
        problems = []
        if problem:
            problems.append(f"{path}: the recording is not complete: {problem}")
        elif dropped and path:
            missing = missing_text(self.recording.gaps) or f"{dropped} ticks are missing"
            problems.append(f"{path}: {missing}")
        if self.black_box_problem:
            problems.append(self.black_box_problem)
        return "; ".join(problems)

    def summary(self) -> dict[str, Any]:
        """What the trial comes to, as `teleop run --json` prints it."""
        settings, active = self.settings, self.recording.estimated()
        t, regression = active["time"], active.regression()
        if len(t):
            depth = float(np.max(np.abs(active["slave_position"])))
            excitation = float(np.mean(active["excitation"])), float(active["excitation"][-1])
        else:
            depth, excitation = 0.0, (math.nan, math.nan)
        whole = self.recording
        return {
            "condition": settings.condition,
            "cube": settings.cube,
            "rig": settings.rig_name,
            "estimated_channels": list(estimated_channels(settings)),
            "duration_s": settings.duration,
            "clock": settings.clock,
            "seed": settings.seed,
            "ticks": int(np.isin(self.recording["mode"], (ACTIVE, STOPPING)).sum()),
            "pairs": len(t),
            "rejected": self.rejected,
            "interrupted": self.interrupted,
            "estimates": {
                name: summarise(t, regression, estimates, self.bank[name])._asdict()
                for name, estimates in active.estimates().items()
                if len(t)
            },
            "truth": None if settings.rig else truth(settings, depth),
            "excitation": {"mean": excitation[0], "last": excitation[1]},
            "loop": loop_timing(settings.rate, whole["dt"], whole["lateness"], whole["overrun"])
            | tick_times(whole),
            "safety": safety_summary(active, self.fault),
            "realtime": self.realtime,
            "recording": {
                "path": str(self.outcome.path) if self.outcome.path else None,
                "complete": not (self.outcome.problem or self.outcome.dropped),
                "problem": self.outcome.problem or None,
                "recoverable": bool(self.outcome.problem) and self.outcome.at_path,
                "dropped": self.outcome.dropped,
                "missing_ticks": gap_rows(whole.gaps),
                "black_box": str(self.black_box) if self.black_box else None,
                "black_box_problem": self.black_box_problem or None,
            },
        }


def run_trial(
    settings: TrialSettings,
    record: Path | None = None,
    show: bool = False,
    switch: StopSwitch | None = None,
    real: RealtimeName = "off",
    overwrite: bool = False,
) -> Trial:
    """Run a trial to its end, to a fault, or to Ctrl-C; the drives are idle on every way out.

    Parameters
    ----------
    settings
        What to run.
    record
        MCAP file to record to, in a process of its own; None to keep the ticks in memory.
    show
        Whether to draw a progress line on standard error.
    switch
        How a person stops it, entered; by default signals alone.
    real
        Whether to set the process up for real time: `require`, `try` or `off`.
    overwrite
        Whether the MCAP file may exist.

    Raises
    ------
    InputError
        The machine cannot hold the rate, the recording cannot be written, or a required
        real-time step could not be taken.
    Exception
        Whatever a tick raised, after the drives stopped and the recording was completed.
    """
    if switch is None:
        with StopSwitch() as switch:
            return run_trial(settings, record, show, switch, real, overwrite)
    bank = settings.make_bank()
    layout = Layout(bank)
    metadata = session_metadata(settings)
    recorder = session = None
    if record or show:
        virtual = settings.clock == "virtual"
        recorder = RecorderProcess(
            record,
            layout,
            metadata,
            settings.duration,
            show,
            virtual,
            overwrite,
            switch.hint,
            switch.instructions,
        )
    memory = None if record else Memory()
    sinks: list[Sink] = [sink for sink in (recorder, memory) if sink]
    box = BlackBox(layout, settings.rate)
    try:
        cost = check_rate(settings) if settings.clock == "real" else 0.0
        clock = settings.make_clock()
        start = time.time_ns() + round((settings.limits.preflight + clock.period) * 1e9)
        if recorder:
            recorder.begin(start)
        try:
            with (
                switch.attended(),
                realtime(real) as real_time,
                settings.make_rig(clock.now) as rig,
            ):
                if settings.rig:
                    check_wire(rig, clock, cost)
                session = Session(settings, clock, rig, bank, layout, sinks, box, switch)
                real_time.start(recorder.process.pid if recorder else None)
                while session.step():
                    pass
                switch.clean_up()
                rejected = {name: dict(counts) for name, counts in rig.rejected.items()}
        except RigError:
            if not session or not session.error:
                raise
    finally:
        switch.clean_up()
        outcomes = [sink.close() for sink in sinks]
    assert session
    outcome = outcomes[0] if record else Outcome(None, session.ticks, 0, "")
    if memory:
        recording = from_messages(layout.definition, memory.messages, memory.events, metadata)
    else:
        assert record
        recording = (salvage(record) if outcome.at_path else None) or box.recording(metadata)
    folder, box_problem, error, fault = None, "", session.error, box.fault
    if record and fault:
        folder = record.with_suffix(".fault")
        try:
            box.write(folder, metadata, start)
        except InputError as full:
            folder, box_problem = None, f"black box: {full}"
    if error and not isinstance(error, RigError):
        error.add_note(f"The drives were stopped. Recording: {record}. Black box: {folder}.")
        for problem in filter(None, (outcome.problem, box_problem)):
            error.add_note(f"Not complete: {problem}.")
        raise error
    return Trial(
        settings,
        recording,
        bank,
        switch.interrupted,
        outcome,
        real_time.report,
        fault,
        rejected,
        folder,
        box_problem,
    )


def truth(settings: TrialSettings, depth: float) -> dict[str, float]:
    """What the simulated cube is, from its surface to the deepest that the slave went [m]."""
    cube = settings.setup.cube
    return {
        "b": cube.b,
        "k_surface": cube.k1,
        "k_deepest": cube.k1 + cube.k3 * depth**2,
        "force_lag_s": settings.setup.force_lag,
    }


def estimated_channels(settings: TrialSettings) -> Iterator[str]:
    """The channels that no sensor measures: an observer estimates them."""
    if settings.rig:
        devices = settings.rig.devices
        for name, channel in settings.rig.sections.channels.items():
            if device_class(devices[channel.device].kind).estimated:
                yield name


def session_metadata(settings: TrialSettings) -> dict[str, dict[str, str]]:
    """What a recording says of its session."""
    return {
        "session": {
            "software": f"teleop {version('teleop')}",
            "python": platform.python_version(),
            "machine": f"{platform.node()}, {platform.platform()}",
            "created": datetime.now().astimezone().isoformat(timespec="seconds"),
            "seed": str(settings.seed),
            "rig": settings.rig_name,
            "estimated_channels": ", ".join(estimated_channels(settings)) or "none",
        },
        "settings": {"json": dumps(settings.description())},
    }
