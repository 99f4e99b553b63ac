"""Two stations in two network namespaces: kill -9, SIGSTOP and a cut cable at random moments.

    sudo python benchmarks/station_processes.py N [RATE] [--cause "cut cable"]

Needs Linux and the permission to create network namespaces. A virtual cable connects the
namespaces. If the kernel has netem, it has a delay of 10 ms, a jitter of 2 ms and a loss of 1 % in
each direction. For each cause, N pairs of stations run in real time at RATE (default 1000 Hz). At a
random moment, the cause acts on one of them. The table states the longest time from the last
datagram of the lost station to a command of zero at the other one, from its recording, and in how
many trials all rules held: the other station ends with its fault, nothing moves after that, and the
recordings can be read. A trial in which the machine was too busy is repeated and counted.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from busy_machine import busy_cause  # noqa: E402

from teleop.recording.recording import load  # noqa: E402
from teleop.recording.recovery import recover_recording  # noqa: E402
from teleop.safety import Mode  # noqa: E402
from teleop.station.keys import write_key  # noqa: E402

HERE, THERE = "teleop-master", "teleop-slave"
SPACES = {"master": HERE, "slave": THERE}
CAUSES = ("kill master", "kill slave", "stop master", "stop slave", "cut cable")
NO_NETEM: list[bool] = []
NETEM = ("delay", "10ms", "2ms", "loss", "1%")


def ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True)


def connect() -> None:
    """Create both namespaces, and the cable between them."""
    disconnect()
    for space in (HERE, THERE):
        ip("netns", "add", space)
    ip("link", "add", "tm", "netns", HERE, "type", "veth", "peer", "name", "ts", "netns", THERE)
    for space, link, host in ((HERE, "tm", 1), (THERE, "ts", 2)):
        ip("-n", space, "addr", "add", f"10.47.1.{host}/24", "dev", link)
        ip("-n", space, "link", "set", link, "up")
        ip("-n", space, "link", "set", "lo", "up")
        queue = ["tc", "-n", space, "qdisc", "add", "dev", link, "root", "netem", *NETEM]
        if not subprocess.run(queue, check=False, stderr=subprocess.DEVNULL).returncode:
            continue
        if not NO_NETEM:
            NO_NETEM.append(True)
            print("this kernel has no netem: the cable has no delay and no loss")


def disconnect() -> None:
    """Remove the namespaces of an earlier run."""
    for space in (HERE, THERE):
        subprocess.run(["ip", "netns", "del", space], check=False, stderr=subprocess.DEVNULL)


def start(side: str, folder: Path, rate: str) -> subprocess.Popen[str]:
    """Start a station in its namespace; its standard error goes to a file."""
    where = ["--listen", "10.47.1.2"] if side == "slave" else ["--connect", "10.47.1.2"]
    error = (folder / f"{side}.err").open("w")
    return subprocess.Popen(
        ["ip", "netns", "exec", SPACES[side], sys.executable, "-m", "teleop", "station", side,
         *where, "--key", folder / "key", "--record", folder / f"{side}.mcap", "--rate", rate,
         "--estimators", "rls", "--duration", "30", "--json"],
        stdout=subprocess.DEVNULL,
        stderr=error,
        text=True,
    )  # fmt: skip


def size(path: Path) -> int:
    with suppress(OSError):
        return path.stat().st_size
    return 0


def one(cause: str, seed: int, rate: str) -> tuple[float, bool] | None:
    """Return the time to zero and whether all rules held; None if the machine was busy."""
    draw = random.Random(f"{cause} {seed}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_key(folder / "key")
        connect()
        slave = start("slave", folder, rate)
        time.sleep(1.5)
        master = start("master", folder, rate)
        processes = {"master": master, "slave": slave}
        try:
            end = time.monotonic() + 60.0
            while "measurement of the round trip" not in (folder / "master.err").read_text():
                if time.monotonic() > end or None not in (master.poll(), slave.poll()):
                    return None
                time.sleep(0.05)
            time.sleep(draw.uniform(2.0, 6.0))
            what, whom = cause.split()
            if what == "cut":
                ip("-n", HERE, "link", "set", "tm", "down")
            else:
                number = signal.SIGKILL if what == "kill" else signal.SIGSTOP
                os.kill(processes[whom].pid, number)  # `ip netns exec` has become the station
            at = time.time()
            lost = processes.get(whom)
            other = slave if lost is master else master
            other.wait(60)
            if what == "stop":
                os.kill(processes[whom].pid, signal.SIGCONT)
                processes[whom].wait(60)
            elif what == "cut":
                slave.wait(60)
        finally:
            for process in processes.values():
                process.kill()
                process.wait()
        errors = {side: (folder / f"{side}.err").read_text() for side in processes}
        if any(busy_cause(text) for side, text in errors.items() if processes[side] is not lost):
            return None
        holds, took = True, 0.0
        for side, process in processes.items():
            path = folder / f"{side}.mcap"
            if process is lost and what == "kill":
                with suppress(Exception):
                    recover_recording(path, folder / "again.mcap")
                readable = folder / "again.mcap"
                recording = load(readable if readable.exists() else path)
                holds &= len(recording) > 100
                continue
            recording = load(path)
            moving = recording[f"commanded_{side}_velocity"] != 0.0
            fault = next((e for e in recording.events if e["fault"]), None)
            holds &= fault is not None and process.returncode == 3
            last = recording["time"][np.flatnonzero(moving)[-1]] if moving.any() else -np.inf
            if process is not lost and fault:
                active = recording["mode"] == Mode.ACTIVE
                heard = recording["received_datagram"]
                newest = np.flatnonzero(np.diff(heard) > 0)[-1]
                took = max(took, last - recording["time"][newest])
                holds &= not np.any(
                    moving[np.flatnonzero(active)[-1] + round(0.05 * float(rate)) :]
                )
        assert at
        if not holds:
            codes = {side: process.returncode for side, process in processes.items()}
            print(f"{cause}, seed {seed}: codes {codes}\n{errors}", file=sys.stderr)
        return took, holds


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("trials", type=int)
    parser.add_argument("rate", nargs="?", default="1000")
    parser.add_argument("--cause", action="append", choices=CAUSES)
    options = parser.parse_args()
    print(f"{'cause':14} trials   zero commands after the last datagram   as it must be   busy")
    try:
        for cause in options.cause or CAUSES:
            took, held, busy = [], 0, 0
            seed = 0
            while len(took) < options.trials and busy < 3 * options.trials:
                found = one(cause, seed, options.rate)
                seed += 1
                if found is None:
                    busy += 1
                    continue
                took.append(found[0])
                held += found[1]
            longest = f"{max(took) * 1e3:8.0f} ms" if took else "       -"
            print(f"{cause:14} {len(took):6} {longest:>40} {held:12} of {len(took)} {busy:6}")
            sys.stdout.flush()
    finally:
        disconnect()
    return 0


if __name__ == "__main__":
    sys.exit(main())
