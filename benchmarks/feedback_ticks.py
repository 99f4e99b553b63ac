"""Force feedback in real time on an emulated serial board, and the time that it adds to a tick.

    python benchmarks/feedback_ticks.py                # 60 s of each law

`teleop rig emulate` emulates the board in another process; its simulated operator palpates the soft
cube freely. Each law runs there in real time with the recorder, over the channel. The rehearsal
before a trial is left out, because it ends the trial if other programs keep the machine busy.

The time that a law adds to a tick is measured separately, in virtual time. Trials with all laws
are advanced in turn by one tick at a time, in one process, in an order that changes. The table has
the medians of the paired differences to the law none. The time is that of condition, link and
supervisor, the column `compute_time` of a recording.
"""

from __future__ import annotations

import argparse
import os
import random
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from emulated import emulated

from drivers.rig_file import read_rig_file
from sim_backend import DEPTH, OperatorModel
from teleop.control.admittance import AdmittanceParameters
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.settings import FeedbackSettings
from teleop.names import FeedbackName
from teleop.safety import Mode, Request
from teleop.settings.trial_settings import TrialSettings
from teleop.trial import run as run_module
from teleop.trial.assembly import make_clock, make_controller, make_rig
from teleop.trial.run import run_trial

LAWS: tuple[FeedbackName, ...] = ("none", "position-force", "model-mediated")
CHANNEL = ChannelSettings(2e-3, 1e-3, 0.01)
"""A channel with which position-force is stable on the soft cube at `DAMPING`."""
DAMPING = 50.0
"""Virtual damping [N s/m]."""
WARM = 1000
"""Number of ticks before the measured ones."""


def settings_of(law: FeedbackName, channel: ChannelSettings | None, **more: Any) -> TrialSettings:
    return TrialSettings(
        feedback=FeedbackSettings(law),
        channel=None if law == "none" else channel,
        admittance=AdmittanceParameters(damping=DAMPING),
        **more,
    )


def live(law: FeedbackName, rig: Path, seconds: float) -> tuple[str, bool]:
    """Run a trial on the emulated rig; return its line of the table, and whether it is complete."""
    settings = settings_of(
        law,
        CHANNEL,
        duration=seconds,
        rig=read_rig_file(rig),
        specimen="soft",
        depth=DEPTH["hand"]["soft"],
    )
    with tempfile.TemporaryDirectory() as folder:
        trial = run_trial(settings, Path(folder) / "trial.mcap", real="try", arm=True)
    recording = trial.recording
    compute = recording["compute_time"][WARM:] * 1e6
    found = trial.feedback() or {}
    stop = trial.fault["text"] if trial.fault else "none"
    line = (
        f"{law:<16}{recording['time'][-1]:>8.1f}{os.getloadavg()[0]:>6.1f}"
        f"{np.median(compute):>9.1f}{np.percentile(compute, 99):>9.1f}"
        f"{int(np.sum(recording['overrun'])):>10}{int(np.sum(recording['skipped'])):>9}"
        f"{found.get('rendered_k_error', np.nan):>9.1%}"
        f"{found.get('felt_force_error', np.nan):>8.1%}  {stop}"
    )
    return line, trial.fault is None


def paired(ticks: int, channel: ChannelSettings | None) -> dict[FeedbackName, np.ndarray]:
    """Return the compute time of each tick of each law in virtual time [s]."""
    order = random.Random(0)
    trials = {}
    for law in LAWS:
        settings = settings_of(
            law, channel, clock="virtual", operator_model=OperatorModel(aim_force=10.0)
        )
        clock = make_clock(settings)
        rig = make_rig(settings, clock.now)
        rig.open()
        controller = make_controller(settings, rig, clock)
        controller._stopwatch = time.perf_counter  # in virtual time, it would measure 0
        trials[law] = clock, controller
    spent: dict[FeedbackName, list[float]] = {law: [] for law in LAWS}
    for _ in range(ticks + WARM):
        for law in order.sample(LAWS, len(LAWS)):
            clock, controller = trials[law]
            tick = clock.wait()
            request = Request(arm=controller.mode is not Mode.ACTIVE)
            record = controller.tick(tick, request)
            spent[law].append(record.timing.compute)
    for law, (_, controller) in trials.items():
        assert controller.mode is Mode.ACTIVE, f"{law}: stopped"
    return {law: np.array(times[WARM:]) for law, times in spent.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="of each trial in real time")
    parser.add_argument("--attempts", type=int, default=1, help="until a trial is complete")
    parser.add_argument("--ticks", type=int, default=20000, help="paired ticks in virtual time")
    options = parser.parse_args()
    run_module.check_rate = lambda settings, real: None
    run_module.check_wire = lambda rig, clock, cost: None
    print(
        f"on an emulated serial board in real time, channel {CHANNEL.text}, d = {DAMPING:g} N s/m"
    )
    print(
        f"{'law':<16}{'s':>8}{'load':>6}{'p50 [us]':>9}{'p99 [us]':>9}"
        f"{'overruns':>10}{'skipped':>9}{'k error':>9}{'force':>8}  safety stop"
    )
    for law in LAWS:
        for _ in range(options.attempts):
            with emulated("serial-board", "free") as rig:
                line, complete = live(law, rig, options.seconds)
            print(line, flush=True)
            if complete:
                break
    for channel in (None, CHANNEL):
        name = f"channel {channel.text}" if channel else "no channel"
        print(f"\n{options.ticks} paired ticks in virtual time, {name}, compute time [us]")
        print(f"{'law':<16}{'p50':>8}{'p99':>8}{'median of the difference to none':>34}")
        times = paired(options.ticks, channel)
        for law in LAWS:
            difference = np.median(times[law] - times["none"]) * 1e6
            middle, high = np.percentile(times[law], (50, 99)) * 1e6
            print(f"{law:<16}{middle:>8.1f}{high:>8.1f}{difference:>34.1f}")


if __name__ == "__main__":
    main()
