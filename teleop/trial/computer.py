"""Find the properties of a computer on which the timing of the loop depends, and what to change."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from teleop.trial.loop_verdict import OTHERS, LoopVerdict
from teleop.trial.realtime import DONE, FIFO, PROCESSOR

SYS, PROC = Path("/sys"), Path("/proc")
TTY = SYS / "class" / "tty"
PERMISSIONS = ("locked memory", FIFO)
"""Real-time settings that need a permission of the system."""
LARGEST_LATENCY = 1
"""Largest latency timer of a serial adapter of FTDI that needs no change [ms]."""


class Computer(NamedTuple):
    """Properties of a computer, as its kernel states them; empty if it does not state them."""

    system: str
    processors: int
    kernel: str
    """`PREEMPT_RT`, or the usual preemption model of the kernel."""
    governors: tuple[str, ...]
    """Different frequency governors of the processors."""
    isolated: str
    """Processors that are reserved by the kernel parameter isolcpus, such as `2-3`."""
    virtual: bool
    """Whether it is a virtual machine."""


def read(path: Path) -> str:
    """Return the text of a file of the kernel; empty if there is no such file."""
    try:
        return path.read_text().strip()
    except (OSError, UnicodeDecodeError):
        return ""


def this_computer(sys: Path = SYS, proc: Path = PROC) -> Computer:
    """Return the properties of this computer."""
    cpus = sys / "devices" / "system" / "cpu"
    governors = {read(path) for path in cpus.glob("cpu[0-9]*/cpufreq/scaling_governor")}
    realtime = read(sys / "kernel" / "realtime") == "1" or "PREEMPT_RT" in platform.version()
    flags = next((line for line in read(proc / "cpuinfo").splitlines() if "flags" in line), "")
    preempt = next((word for word in platform.version().split() if "PREEMPT" in word), "")
    return Computer(
        platform.platform(),
        os.cpu_count() or 1,
        "PREEMPT_RT" if realtime else preempt,
        tuple(sorted(governors - {""})),
        read(cpus / "isolated"),
        "hypervisor" in flags.split(),
    )


def latency_timers(ports: Iterable[str], folder: Path = TTY) -> dict[str, int]:
    """Return the latency timer of each serial port that has one [ms], by the name of the port."""
    found = {}
    for port in ports:
        name = Path(port).resolve().name
        text = read(folder / name / "device" / "latency_timer")
        if text.isdecimal():
            found[name] = int(text)
    return found


def changes(
    verdict: LoopVerdict,
    computer: Computer,
    realtime: Mapping[str, str],
    timers: Mapping[str, int] | None = None,
) -> list[str]:
    """Return what can be changed so that the loop is more punctual, the most effective first.

    Parameters
    ----------
    verdict
        Result of the measurement. If the loop was always punctual, only what is likely to disturb
        it later is returned.
    computer
        Properties of the computer.
    realtime
        Result of each real-time setting.
    timers
        Latency timers of the serial ports of a rig [ms]. Default: none.
    """
    found = []
    refused = [name for name in PERMISSIONS if realtime.get(name, DONE) != DONE]
    if refused:
        found.append(
            f"{' and '.join(refused)}: not permitted: allow rtprio and memlock in "
            "/etc/security/limits.conf (docs/requirements.md), and log in again"
        )
    if realtime.get(PROCESSOR, DONE) != DONE:
        found.append(
            "the loop shares its processor: use a computer with at least two processors, and end "
            "other teleop processes"
        )
    others = verdict.timing.others
    if others.used > OTHERS:
        names = ", ".join(f"{name} (process {number})" for name, number, _ in others.names)
        found.append(f"other programs use the processors: end {names or 'them'}")
    if others.stolen > OTHERS:
        found.append("the host uses the processors of this virtual machine: reserve them for it")
    slow = [name for name in computer.governors if name != "performance"]
    if slow:
        found.append(
            f"frequency governor {', '.join(slow)}: echo performance | sudo tee "
            "/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"
        )
    for name, milliseconds in (timers or {}).items():
        if milliseconds > LARGEST_LATENCY:
            found.append(
                f"latency_timer of {name} is {milliseconds} ms: "
                f"echo 1 | sudo tee {TTY / name / 'device' / 'latency_timer'}"
            )
    if verdict.level == "yes":
        return found
    if computer.virtual:
        found.append("this is a virtual machine, which its host can pause: use a computer itself")
    if computer.kernel != "PREEMPT_RT":
        found.append("the kernel has no PREEMPT_RT: install one, such as linux-image-rt-amd64")
    if not computer.isolated and computer.processors > 1:
        last = computer.processors - 1
        found.append(
            f"no processor is reserved: start the kernel with isolcpus={last}, and teleop with "
            f"taskset -c 0-{last} teleop"
        )
    return found
