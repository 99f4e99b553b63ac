"""Run trials, checks and faults in real time on the emulated rigs of the newer devices.

    python benchmarks/emulated_rigs.py                     # about 50 minutes
    python benchmarks/emulated_rigs.py --rigs haply --seeds 0 --seconds 10 --parts trials

The devices of each rig are emulated in another process. Part `trials`: palpation by the simulated
operator. The estimates stand beside those of the simulated rig, which runs within one process with
the same operator, cube and seed, and the same coupling of the drives. Part `checks`: `teleop rig
check --move`. Part `faults`: short trials with a fault of each bus.

On a busy machine, the loop or the emulator is sometimes late. `skipped` is the number of periods
that the loop skipped, and `gap` the longest time between two ticks. A trial that was stopped by
a late program names it in its fault, and is repeated up to two times (`repeated`).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from emulated import RIGS, emulated

from drivers.rig_file import RigFile, read_rig_file
from sim_backend import DEPTH
from sim_backend.force_master import ForceMaster

BUSES = {
    "ati-netft": ("contact", "handle"),
    "moteus": ("can",),
    "mit-motor": ("can",),
    "dynamixel": ("servos",),
    "haply": ("handle",),
    "hapkit": ("handle",),
    "odrive-torque": ("can",),
    "epos4-master": ("drives",),
}
"""Rigs with the newer devices, and the buses of these devices."""
CHANGES = {
    "moteus": (
        ('interface = "socketcan"', 'interface = "udp_multicast"'),
        ('channel = "can0"', 'channel = "239.74.163.2"'),
        ("rate_hz = 1000", "rate_hz = 250"),
        ("stiffness_n_per_m = 600", "stiffness_n_per_m = 190"),
    )
}
"""Changes of rig files, for a machine without CAN FD. udp_multicast is too slow for 1 kHz,
and at 250 Hz only a softer coupling is passive."""
PARTS = ("trials", "checks", "faults")
FAULTS = ("drop", "double", "reorder", "silence")
FAULT_AT = 1.0
"""Time of a fault after the drives were enabled [s]."""
ATTEMPTS = 3
TRANSMISSION = "\n[transmission]\nlag_ms = {lag}\nlost_motion_um = {lost}\n"
LATE = ("overran", "other programs", "fewer programs")
"""Words in the texts of faults that a busy machine can cause."""


def teleop(*arguments: object) -> tuple[dict[str, Any], int, str]:
    """Run a command; return its JSON document, its exit code and its last line on stderr."""
    done = subprocess.run(
        [sys.executable, "-m", "teleop", *map(str, arguments), "--json"],
        capture_output=True,
        text=True,
        check=False,
    )
    text = done.stdout
    lines = done.stderr.strip().splitlines() or [""]
    return json.loads(text) if text else {}, done.returncode, lines[-1]


def rig_file(name: str, folder: Path) -> Path:
    """Return the example of a rig file, with the changes that this machine needs."""
    path, text = folder / f"{name}.toml", (RIGS / f"{name}.toml").read_text()
    for old, new in CHANGES.get(name, ()):
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    return path


def reference(rig: RigFile, seconds: float, seed: int) -> dict[str, Any]:
    """Return the summary of the same palpation on the simulated rig, in virtual time."""
    more: list[object] = []
    master = rig.sections.drives.master
    if master and master.max_force_n:
        values = {
            "stiffness": master.stiffness_n_per_m,
            "damping": master.damping_ns_per_m,
            "mass": master.moving_mass_kg or ForceMaster.mass,
            "friction": master.friction_ns_per_m,
            "latency": master.latency_ticks,
            "max_force": master.max_force_n,
        }
        more = ["--force-master", ",".join(f"{key}={value}" for key, value in values.items())]
    slave = rig.sections.drives.slave
    if slave.moving_mass_kg:
        values = {
            "mass": slave.moving_mass_kg,
            "latency": slave.latency_ticks,
            "max_force": slave.max_force_n,
        }
        more += ["--force-slave", ",".join(f"{key}={value}" for key, value in values.items())]
    found, _, problem = teleop(
        "run", "--condition", "free", "--clock", "virtual", "--duration", seconds, "--seed", seed,
        "--rate", rig.sections.rate_hz, "--no-record", *more,
    )  # fmt: skip
    assert found, problem
    return found


def trial(path: Path, seconds: float, seed: int, fault: str = "") -> dict[str, Any]:
    """Run a trial on an emulated rig; return its summary."""
    extra = ["--seed", str(seed), *(["--fault", fault] if fault else [])]
    with emulated(path, "free", extra=extra) as run_file:
        text = run_file.read_text()
        run_file.write_text(text + TRANSMISSION.format(lag=2.662, lost=121.9))
        found, code, problem = teleop(
            "run", "--rig", run_file, "--condition", "free", "--duration", seconds,
            "--specimen", "soft", "--depth", f"{DEPTH['hand']['soft']}m", "--yes", "--no-record",
        )  # fmt: skip
    return found or {"refused": f"exit {code}: {problem}"}


def fault_text(found: dict[str, Any]) -> str:
    """Return why a trial was stopped or refused; empty if it was not."""
    if "refused" in found:
        return str(found["refused"])
    fault = found["safety"]["fault"]
    if not fault:
        return ""
    at = found["safety"]["fault_s"]
    return f"{'before arming' if at is None else f'{at:.2f} s'}: {fault['text']}"


def is_early(found: dict[str, Any]) -> bool:
    """Return whether a trial was refused, or stopped before the planned fault."""
    return "refused" in found or bool(
        found["safety"]["fault"] and not (found["safety"]["fault_s"] or 0.0) >= FAULT_AT
    )


def trials(name: str, path: Path, seeds: Sequence[int], seconds: float) -> Iterator[str]:
    """Yield a line for each trial: its estimates, their difference from the reference, the loop."""
    for seed in seeds:
        plain = reference(read_rig_file(path), seconds, seed)
        repeated, found = 0, trial(path, seconds, seed)
        while repeated < ATTEMPTS - 1 and any(word in fault_text(found) for word in LATE):
            repeated, found = repeated + 1, trial(path, seconds, seed)
        line = f"{name:14}{seed:2}"
        if "estimates" in found:
            for method in ("rls", "ai"):
                line += difference(found["estimates"].get(method), plain["estimates"][method])
            line += difference(found["result"], plain["result"])
            loop = found["loop"]
            line += (
                f"{loop['mean_rate_hz']:7.0f}{loop['skipped']:6}{loop['longest_gap_s'] * 1e3:6.1f}"
                f"{repeated:4}"
            )
            line += f"  {rejected}" if (rejected := found["rejected"]) else ""
        yield line + (f"  STOPPED {text}" if (text := fault_text(found)) else "")


def difference(found: dict[str, Any] | None, plain: dict[str, Any]) -> str:
    """Return k and its relative difference from the reference, b and its difference."""
    if not found or found["k"] is None or plain["k"] is None:
        return f"{'-':>28}"
    k, b = found["k"], found["b"]
    shown = f"{k:7.0f} {100 * (k / plain['k'] - 1):+5.1f}%"
    if b is None or plain["b"] is None:
        return f"{shown}{'-':>14}"
    return f"{shown}{b:7.1f} {b - plain['b']:+6.2f}"


def checks(name: str, path: Path, seeds: Sequence[int]) -> Iterator[str]:
    """Yield a line for each `teleop rig check --move`."""
    with emulated(path, "autonomous") as run_file:  # nobody holds the handle
        for attempt in seeds:
            time.sleep(1.5 if attempt else 0.0)  # until the plant is in its initial state
            found, code, problem = teleop(
                "rig", "check", run_file, "--duration", "1", "--move", "--yes"
            )
            drives = "; ".join(
                ", ".join(
                    f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}"
                    for key, value in drive.items()
                    if key in ("name", "watchdog_s", "confirmed", "moved")
                )
                for drive in found.get("drives", [])
            )
            yield f"{name:14}{attempt:2}  exit {code}  {drives}  {problem if code else ''}".rstrip()


def faults(name: str, path: Path) -> Iterator[str]:
    """Yield a line for each fault of each bus with a newer device: how the trial ended."""
    for bus in BUSES[name]:
        for kind in FAULTS:
            found = trial(path, 3.0, 0, f"{kind}:{bus}@{FAULT_AT:g}")
            repeated = 0
            while repeated < ATTEMPTS - 1 and is_early(found):
                repeated, found = repeated + 1, trial(path, 3.0, 0, f"{kind}:{bus}@{FAULT_AT:g}")
            text = fault_text(found) or (
                f"no fault, k {found['estimates']['rls']['k']:.0f} N/m, {found['rejected'] or ''}"
            )
            yield f"{name:14}{bus:10}{kind:9}{text}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rigs", nargs="*", default=[*BUSES], choices=[*BUSES])
    parser.add_argument("--parts", nargs="*", default=PARTS, choices=PARTS)
    parser.add_argument("--seeds", nargs="*", type=int, default=(0, 1, 2))
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args()
    heads: dict[str, str] = {
        "trials": f"{given.seconds:g} s, free, soft cube: k [N/m] and b [N s/m], and their "
        "difference from the simulated rig\n"
        f"{'rig':14}{'n':>2}{'rls':>28}{'ai':>28}{'result':>28}{'Hz':>7}{'skip':>6}{'gap':>6}{'rep':>4}",
        "checks": "teleop rig check --move",
        "faults": f"faults of the buses, {FAULT_AT:g} s after the drives were enabled",
    }
    with tempfile.TemporaryDirectory() as folder:
        for part in given.parts:
            print(f"{heads[part]}; load average {os.getloadavg()[0]:.1f}", flush=True)
            for name in given.rigs:
                path = rig_file(name, Path(folder))
                lines = {
                    "trials": partial(trials, name, path, given.seeds, given.seconds),
                    "checks": partial(checks, name, path, given.seeds),
                    "faults": partial(faults, name, path),
                }[part]
                for line in lines():
                    print(line, flush=True)
            print()


if __name__ == "__main__":
    main()
