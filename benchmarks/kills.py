"""Kill a process of a trial at random times, and check what is lost and when the slave stops.

    python benchmarks/kills.py              # 25 kills of each kind
    python benchmarks/kills.py --times 2 --target "live page"

The controller, the recorder or the live process is killed with SIGKILL: without and with force
feedback over a channel, without a live page, with a live page that only watches, and with a live
page in which the drives were armed. The rig runs in another process, like a real drive. A line of
the table shows the ticks that are not in the recovered recording (the largest number, the median,
and the limit), the longest time until the slave stopped, and its limit:

- If the controller is killed, the watchdog of the rig stops the slave, and no tick is lost.
- If the recorder is killed, the trial ends with a ramp, and at most 100 ms are lost. `readers.py`
  kills the other readers.
- If the live process is killed, no tick is lost. The slave stops only if the page armed the drives.

The last columns are the numbers of kills with recovered ticks that are not contiguous, with a
process that did not end, of runs that were repeated because the machine was too busy for the loop,
and of kills with another problem. The exit code is 1 if a limit was exceeded, or if one of these
numbers, except that of the repeated runs, is not 0.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import random
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from datetime import date
from multiprocessing.connection import Client, Connection, Listener
from pathlib import Path
from typing import Any

import numpy as np
from fault_kinds import RAMP
from faults import settings_of
from page_process import PageProcess
from watched_trial import Announcement, WatchedTrial

from drivers import Command, Measurement, Rig
from sim_backend import CUBES, FreePalpation, SimulatedRig
from teleop.errors import InputError
from teleop.recording.recording import Recording, load
from teleop.safety import Fault
from teleop.trial import run as run_module
from teleop.trial.page_requests import PROCESS_SILENCE
from teleop.trial.readers import CHECK
from teleop.trial.run import run_trial

WATCHDOG = 0.1
"""Timeout of the emulated drive's watchdog [s]."""
LATEST = 0.02
"""Allowed lateness of the watchdog on a busy machine [s]."""
LOST = 0.1
"""Largest loss of a killed recorder [s]."""
LIVE = "live page"
TARGETS = {
    "controller": ("none", "arms"),
    "recorder": ("none", "arms"),
    LIVE: ("watches", "arms"),
}
"""What the live page may do in the runs in which a process is killed: there is none, it only
watches, or the drives were armed in it."""
LAWS = ("none", "model-mediated")
RATE = 1000.0
"""Ticks per second [Hz]."""
OVERRUN = str(Fault.OVERRUN)
"""Fault of a run that is repeated, because other programs on the machine caused the fault."""
REPEATS = 5
"""Largest number of repetitions of a run."""
GONE = 10.0
"""Time within which all processes of a run must end after the controller was killed [s]."""


def serve_rig(address: str) -> None:
    """Serve the emulated rig. Its watchdog also acts when the controller has been killed.

    The time from the last command until the slave's drive stopped is written to standard output.
    """
    clock = time.monotonic
    rig = SimulatedRig(CUBES["soft"], clock, FreePalpation(9e-3, 0), watchdog=WATCHDOG)
    with Listener(address) as listener:
        print("listening", flush=True)
        connection = listener.accept()
    last = clock()
    with rig:
        while True:
            try:
                if not connection.poll(0.001):
                    rig.read()
                    gone = isinstance(connection, Disconnected)
                    if rig._error or (gone and not rig._enabled):
                        print(f"{clock() - last if rig._error else 0.0:.6f}", flush=True)
                        return
                    continue
                name, arguments = connection.recv()
            except (EOFError, ConnectionResetError):
                connection = Disconnected()
                continue
            last = clock()
            connection.send(getattr(rig, name)(*arguments))


class Disconnected:
    """A connection whose other process has ended."""

    def poll(self, timeout: float) -> bool:
        time.sleep(timeout)
        return False


@dataclass
class RemoteRig(Rig):
    """The controller's access to the rig in the other process."""

    connection: Connection

    def _call(self, name: str, *arguments: Any) -> Any:
        self.connection.send((name, arguments))
        return self.connection.recv()

    def open(self) -> None: ...

    def close(self) -> None: ...

    def read(self) -> Measurement:
        return self._call("read")

    def enable(self) -> bool:
        return bool(self._call("enable"))

    def write(self, command: Command) -> Command:
        return self._call("write", command)

    def idle(self) -> bool:
        return bool(self._call("idle"))


def victim(path: Path, address: str, real: Any, law: Any, page: str) -> None:
    """Run the controller. It, its recorder or its live process will be killed.

    At the end, whether the recording is complete is written to standard output.
    """
    run_module.check_rate = lambda settings, real: None
    settings = settings_of("free", "soft", law, duration=2.0)
    live = None
    if page != "none":
        live = PageProcess(page == "arms")
        live.arm()
    trial = run_trial(
        settings,
        path,
        real=real,
        rig_maker=lambda now: RemoteRig(Client(address)),
        arm=True,
        live=live,
        viewers=[Announcement()],
    )
    print(json.dumps({"complete": not trial.incomplete}), flush=True)
    if live:
        live.end()


def has_ended(pid: int) -> bool:
    """Return whether a process has ended, even if nobody has waited for it."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


def remaining(pids: list[int]) -> int:
    """Return the number of processes that have not ended within `GONE`."""
    deadline = time.monotonic() + GONE
    while not all(map(has_ended, pids)) and time.monotonic() < deadline:
        time.sleep(0.02)
    return sum(not has_ended(pid) for pid in pids)


def recovered(path: Path, target: str) -> Recording | None:
    """Return the recording of a run; None if its recorder was killed before its first flush."""
    if target == "recorder":
        out = path.with_name("recovered.mcap")
        silent = subprocess.run(
            [sys.executable, "-m", "teleop", "recover", str(path), "--out", str(out)],
            capture_output=True,
        )
        return None if silent.returncode else load(out)
    for _ in range(500):  # the recorder may still write
        try:
            return load(path)
        except InputError:
            time.sleep(0.02)
    return load(path)


def faults_of(recording: Recording) -> list[str]:
    return [event["fault"] for event in recording.events if event["fault"]]


def kill(
    target: str, law: str, page: str, folder: Path, instant: float, real: str
) -> dict[str, Any]:
    """Run a controller, kill one of its processes, and return the losses."""
    path, address = folder / "run.mcap", str(folder / "rig")
    me = [sys.executable, __file__]
    rig = subprocess.Popen([*me, "--rig", address], stdout=subprocess.PIPE, text=True)
    assert rig.stdout
    rig.stdout.readline()
    trial = WatchedTrial(__file__, "--victim", str(path), address, law, page, "--realtime", real)
    ticks = trial.stream.ticks
    try:
        trial.wait_until_armed()
        time.sleep(0.1 + instant)
        pids = {"controller": trial.process.pid, **trial.readers}
        os.kill(pids[target], signal.SIGKILL)
        at_kill = ticks.newest
        end = trial.wait()
        pushed = ticks.newest
        stopped = float(rig.stdout.readline())
        rig.wait()
    except ConnectionError as error:
        return {"overran": OVERRUN in str(error), "problem": f"not armed: {error}"}
    finally:
        rig.kill()
        rig.communicate()
        trial.process.kill()
        left = remaining([*trial.readers.values()])
        files = trial.clean_up()
    recording = recovered(path, target)
    if target == "recorder":
        pushed = at_kill
    if recording is None:
        return {"lost": pushed, "left": left}
    t, dt = recording["time"], recording["dt"]
    result: dict[str, Any] = {
        "lost": pushed - len(recording),
        "contiguous": bool(np.allclose(np.diff(t), dt[1:], atol=1e-9)),
        "left": left,
    }
    faults, expected = faults_of(recording), []
    if target == "controller":
        result["stopped"] = stopped
    elif bound(target, page):
        expected = [str(Fault.PAGE_LOST)] if target == LIVE else []
        columns = trial.columns()
        t, moves = columns["time"], np.flatnonzero(columns["commanded_slave_velocity"])
        result["stopped"] = max(t[moves[-1] + 1] - t[at_kill - 1], 0.0)
    if target != "controller" and end.get("complete") is not (target != "recorder"):
        result["problem"] = f"the process of the trial reports {end}"
    if files:
        result["problem"] = f"{files} files of shared memory are left"
    if faults != expected:
        result["problem"] = f"faults {faults}"
    return result | {"overran": OVERRUN in faults}


def repeated(target: str, law: str, page: str, instant: float, real: str) -> dict[str, Any]:
    """Return the result of `kill`, repeated while the loop overran on a busy machine."""
    repeats = -1
    result: dict[str, Any] = {"overran": True}
    while result.get("overran") and repeats < REPEATS:
        repeats += 1
        with tempfile.TemporaryDirectory() as folder:
            result = kill(target, law, page, Path(folder), instant, real)
    return result | {"repeats": repeats}


def bound(target: str, page: str) -> float:
    """Return the longest permitted time from the kill until the slave has stopped [s]."""
    if target == "controller":
        return WATCHDOG + LATEST
    if target == "recorder":
        return CHECK + RAMP + LATEST
    return PROCESS_SILENCE + RAMP + LATEST if (target, page) == (LIVE, "arms") else 0.0


def table_line(target: str, law: str, page: str, results: list[dict[str, Any]]) -> bool:
    """Print the results of one kind of kill, and return whether all are as they should be."""
    allowed = round(LOST * RATE) if target == "recorder" else 0
    limit = bound(target, page)
    lost = sorted(r.get("lost", 0) for r in results)
    stopped = max(r.get("stopped", 0.0) for r in results)
    broken = sum(not r.get("contiguous", True) for r in results)
    left = sum(r.get("left", 0) > 0 for r in results)
    problems = [r["problem"] for r in results if "problem" in r]
    print(
        f"{target:<12}{law:<16}{page:<9}{len(results):>6}{lost[-1]:>6}{lost[len(lost) // 2]:>8}"
        f"{allowed:>9}{stopped * 1e3:>11.1f}{limit * 1e3:>8.0f}{broken:>10}{left:>6}"
        f"{sum(r['repeats'] for r in results):>10}{len(problems):>10}",
        flush=True,
    )
    for problem in problems[:3]:
        print(f"    {problem}")
    return not (lost[-1] > allowed or stopped > limit or broken or left or problems)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--times", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--target", choices=[*TARGETS], help="only this one")
    parser.add_argument("--law", choices=LAWS, help="only this law of force feedback")
    parser.add_argument("--realtime", choices=("require", "try", "off"), default="try")
    parser.add_argument("--victim", nargs=4, help=argparse.SUPPRESS)
    parser.add_argument("--rig", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.rig:
        serve_rig(options.rig)
        return 0
    if options.victim:
        path, address, law, page = options.victim
        victim(Path(path), address, options.realtime, law, page)
        return 0
    rng = random.Random(options.seed)
    print(f"# python {shlex.join(sys.argv)}, {date.today()}")
    print(
        f"{'killed':<12}{'feedback':<16}{'page':<9}{'kills':>6}{'lost':>6}{'median':>8}"
        f"{'allowed':>9}{'stop [ms]':>11}{'bound':>8}{'not cont.':>10}{'left':>6}"
        f"{'repeated':>10}{'problems':>10}"
    )
    good = True
    for target, pages in TARGETS.items():
        for law, page in itertools.product(LAWS, pages):
            if options.target in (None, target) and options.law in (None, law):
                results = [
                    repeated(target, law, page, rng.uniform(0.0, 1.2), options.realtime)
                    for _ in range(options.times)
                ]
                good &= table_line(target, law, page, results)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
