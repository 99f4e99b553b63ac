"""Kill the controller or the recorder at random times of a run, and check what is lost.

    python benchmarks/kills.py              # 100 of each
    python benchmarks/kills.py --times 10

The rig runs in another process, like a real drive. When the controller is killed with SIGKILL, the
watchdog of the rig has to stop the slave. The numbers of lost ticks and the time until the slave
stopped are printed. The exit code is 1 if a pushed tick is lost when the controller is killed, if
more than 300 ms are lost when the recorder is killed, if the recovered ticks are not contiguous, or
if the slave did not stop in time.
"""

from __future__ import annotations

import argparse
import mmap
import os
import random
import signal
import struct
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from multiprocessing.connection import Client, Connection, Listener
from pathlib import Path
from typing import Any

import numpy as np

from drivers import Command, Measurement, Rig
from sim_backend import CUBES, FreePalpation, SimulatedRig
from teleop.errors import InputError
from teleop.recording.recorder import RecorderProcess
from teleop.recording.recording import load
from teleop.trial.run import run_trial
from teleop.trial.settings import TrialSettings

WATCHDOG = 0.1
"""Timeout of the emulated drive's watchdog [s]."""
LATEST = 0.02
"""Allowed lateness of the watchdog on a busy machine [s]."""
LOST = 0.3
"""Largest loss of a killed recorder [s]."""
COUNTS = struct.Struct("<qqq")
"""Content of the shared memory: pushed ticks, process id of the recorder, state of the run.

The state is 0 during the run, 1 after a complete run, and 2 if the recording was not complete.
"""


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


def victim(path: Path, shared: Path, address: str, real: Any) -> None:
    """Run the controller that will be killed, or whose recorder will be killed."""
    with shared.open("r+b") as file:
        counts = mmap.mmap(file.fileno(), COUNTS.size)
    push = RecorderProcess.push
    pushed = 0

    def counted(self: RecorderProcess, message: bytes) -> None:
        nonlocal pushed
        push(self, message)
        pushed += 1
        COUNTS.pack_into(counts, 0, pushed, self.process.pid, 0)

    RecorderProcess.push = counted  # type: ignore[method-assign]
    trial = run_trial(
        TrialSettings(duration=2.0),
        path,
        real=real,
        rig_maker=lambda now: RemoteRig(Client(address)),
    )
    COUNTS.pack_into(counts, 0, pushed, 0, 1 + bool(trial.incomplete))


def kill(target: str, folder: Path, instant: float, real: str) -> dict[str, Any]:
    """Run a controller, kill it or its recorder, and return the losses."""
    path, shared = folder / "run.mcap", folder / "counts"
    shared.write_bytes(bytes(COUNTS.size))
    address = str(folder / "rig")
    me = [sys.executable, __file__]
    rig = subprocess.Popen([*me, "--rig", address], stdout=subprocess.PIPE, text=True)
    assert rig.stdout
    rig.stdout.readline()
    controller = subprocess.Popen(
        [*me, "--victim", str(path), str(shared), address, "--realtime", real]
    )

    def counts() -> tuple[int, int, int]:
        return COUNTS.unpack(shared.read_bytes())

    while counts()[0] < 100:
        time.sleep(0.01)
        if controller.poll() is not None:
            raise SystemExit("the victim did not start")
    time.sleep(instant)
    pushed, recorder, _ = counts()
    if target == "controller":
        os.kill(controller.pid, signal.SIGKILL)
        controller.wait()
        pushed = counts()[0]
    else:
        os.kill(recorder, signal.SIGKILL)
        pushed = counts()[0]
        controller.wait()
        if counts()[2] != 2:
            raise SystemExit("the run did not report that its recorder was killed")
    stopped = float(rig.stdout.readline())
    rig.wait()
    recovered = path
    if target == "controller":
        for _ in range(500):
            try:
                recording = load(path)
                break
            except InputError:
                time.sleep(0.02)
        else:
            recording = load(path)
    else:
        recovered = folder / "recovered.mcap"
        silent = subprocess.run(
            [sys.executable, "-m", "teleop", "recover", str(path), "--out", str(recovered)],
            capture_output=True,
        )
        if silent.returncode:  # killed before its first flush
            return {"lost": pushed, "contiguous": True, "stopped": 0.0}
        recording = load(recovered)
    t, dt = recording["time"], recording["dt"]
    return {
        "lost": pushed - len(recording),
        "contiguous": bool(np.allclose(np.diff(t), dt[1:], atol=1e-9)),
        "stopped": stopped if target == "controller" else 0.0,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--times", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--target", choices=("controller", "recorder"), help="only this one")
    parser.add_argument("--realtime", choices=("require", "try", "off"), default="try")
    parser.add_argument("--victim", nargs=3, help=argparse.SUPPRESS)
    parser.add_argument("--rig", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.rig:
        serve_rig(options.rig)
        return 0
    if options.victim:
        path, shared, address = options.victim
        victim(Path(path), Path(shared), address, options.realtime)
        return 0
    rng = random.Random(options.seed)
    bad = 0
    for target, allowed in (("controller", 0), ("recorder", round(LOST * 1000))):
        if options.target not in (None, target):
            continue
        results = []
        for _ in range(options.times):
            with tempfile.TemporaryDirectory() as folder:
                results.append(kill(target, Path(folder), rng.uniform(0.0, 1.2), options.realtime))
        lost = [r["lost"] for r in results]
        stopped = max(r["stopped"] for r in results)
        broken = sum(not r["contiguous"] for r in results)
        print(
            f"{target} killed {len(results)} times: ticks lost at most {max(lost)} "
            f"(allowed {allowed}), median {sorted(lost)[len(lost) // 2]}; "
            f"{broken} recordings not contiguous"
        )
        if target == "controller":
            print(
                f"  the drive stopped {stopped * 1e3:.1f} ms after the last command at the "
                f"latest (watchdog {WATCHDOG * 1e3:.0f} ms)"
            )
        bad += (
            sum(r["lost"] > allowed or r["stopped"] > WATCHDOG + LATEST for r in results) + broken
        )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
