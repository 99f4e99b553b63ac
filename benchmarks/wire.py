"""Measure each step of the communication with devices, beside the limit of the same bytes.

    python benchmarks/wire.py                     # all rigs
    python benchmarks/wire.py odrive-bota --against ../main

The devices are emulated in another process (`teleop rig emulate`) and connected by
pseudo-terminals. A loop at 1 kHz reads the rig and commands standstill. For each bus, four steps
are measured: `read` is the system call that reads, `decode` the rest of the reading with the
processing of the samples, `encode` the work of the devices on their commands, `write` the system
call that writes. The row of a rig is its whole tick, measured without the probes of the steps.

The limit is a loop at 1 kHz that only calls `os.read` and `os.write` on a pseudo-terminal, once per
tick. Another process sends it the bytes that the bus has received, and the loop writes those that
the bus has sent. The ratio is the sum of the steps, or the tick of the rig, to the limit. Rig and
limit are measured in turn. `--against` is the folder with the source of another version, which is
measured in the same turns.

For SocketCAN, whose kernel module many machines lack, two frames in each direction go through a
pair of datagram sockets with time stamps of the kernel: with this package, with python-can, and
with the bare calls `recv` and `send`.
"""

from __future__ import annotations

import argparse
import json
import os
import select
import socket
import subprocess
import sys
import time
import tty
from collections import defaultdict
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from emulated import emulated

from drivers import STANDSTILL
from drivers.rig_file import read_rig_file
from drivers.transports.can_bus import CanBus
from drivers.transports.datagram_port import SO_TIMESTAMPNS, DatagramPort
from drivers.wired_rig import WiredRig
from teleop.control.clock import RealClock
from teleop.trial.realtime import realtime

RIGS = ("serial-board", "odrive-bota", "cia402-ft300")
RATE = 1000.0
WARM = 500
"""Number of ticks before the measured ticks."""
STEPS = ("read", "decode", "encode", "write")
TICK, BYTES = "tick", "bytes"
WIDTH = 30
Times = dict[str, dict[str, list[float]]]
"""Duration of each step in each tick [s], by bus; the rig has the name ``."""


class Probes:
    """Measures the time in probed functions, without that in probed functions which they call."""

    def __init__(self) -> None:
        self.spent: dict[tuple[str, str], float] = defaultdict(float)
        self.passed: dict[tuple[str, str], bytes] = defaultdict(bytes)
        """Bytes that the system calls returned or got."""
        self._inner = [0.0]

    def probe(self, owner: Any, name: str, bus: str, step: str) -> None:
        """Measure a method of an object from now on."""
        original: Callable[..., Any] = getattr(owner, name)

        def probed(*arguments: Any) -> Any:
            self._inner.append(0.0)
            start = time.perf_counter()
            try:
                result = original(*arguments)
            finally:
                whole = time.perf_counter() - start
                self.spent[bus, step] += whole - self._inner.pop()
                self._inner[-1] += whole
            if step == "read":
                self.passed[bus, step] += result if isinstance(result, bytes) else result[0]
            elif step == "write":
                self.passed[bus, step] += arguments[0]
            return result

        setattr(owner, name, probed)

    def probe_rig(self, rig: WiredRig) -> None:
        """Measure the steps of each bus of an open rig."""
        for name, bus in rig.buses.items():
            self.probe(bus, "poll", name, "decode")
            if isinstance(bus, CanBus) and hasattr(bus, "transmit"):
                self.probe(bus, "transmit", name, "encode")
            line = getattr(bus, "_stream", bus)
            adapter = getattr(line, "_adapter", None) or getattr(line, "_bus", None)
            if adapter:
                port = adapter._port
                self.probe(port, "read", name, "read")
                self.probe(port, "send" if hasattr(port, "send") else "write", name, "write")
            elif isinstance(line, DatagramPort):
                self.probe(line, "_take", name, "read")
                self.probe(line, "send", name, "write")
            else:
                self.probe(line, "_read", name, "read")
                self.probe(line, "_write", name, "write")
        for device in rig.devices.values():
            self.probe(device, "transmit", device.settings.bus, "encode")


def measure(path: Path, ticks: int) -> dict[str, Any]:
    """Return the times of a rig and of its buses, and the bytes of each bus in each tick."""
    clock = RealClock(RATE)
    times: Times = defaultdict(lambda: defaultdict(list))
    passed: dict[str, list[tuple[str, str]]] = defaultdict(list)
    with realtime("try") as real_time, WiredRig(read_rig_file(path), clock.now) as rig:
        real_time.start()
        probes, enabled = Probes(), False
        for tick in range(2 * (WARM + ticks)):
            if tick == WARM + ticks:
                probes.probe_rig(rig)
            clock.wait()
            start = time.perf_counter()
            rig.read()
            middle = time.perf_counter()
            enabled = enabled or rig.enable()
            before = time.perf_counter()
            rig.write(STANDSTILL)
            end = time.perf_counter()
            if WARM <= tick < WARM + ticks:
                times[""]["read"].append(middle - start)
                times[""]["write"].append(end - before)
                times[""][TICK].append(middle - start + end - before)
            if tick >= 2 * WARM + ticks:
                for (bus, step), seconds in probes.spent.items():
                    times[bus][step].append(seconds)
                for bus in rig.buses:
                    both = (probes.passed[bus, step].hex() for step in ("read", "write"))
                    passed[bus].append(tuple(both))  # type: ignore[arg-type]
            for found in (probes.spent, probes.passed):
                for key in found:
                    found[key] = type(found[key])()  # type: ignore[index]
    return {"times": times, BYTES: passed}


def replay(chunks: list[tuple[str, str]]) -> None:
    """Act as the device of the limit: send the next bytes in each period, and read all bytes."""
    leader, follower = os.openpty()
    tty.setraw(follower)
    print(os.ttyname(follower), flush=True)
    due = time.monotonic()
    while True:
        for received, _ in chunks:
            due += 1.0 / RATE
            while (left := due - time.monotonic()) > 0.0:
                if select.select([leader], [], [], left)[0]:
                    os.read(leader, 65_536)
            os.write(leader, bytes.fromhex(received))


def limit(chunks: list[tuple[str, str]], ticks: int) -> dict[str, list[float]]:
    """Return the times of `os.read` and `os.write` of the same bytes [s]."""
    times: dict[str, list[float]] = {"read": [], "write": []}
    sent = [bytes.fromhex(written) for _, written in chunks]
    clock = RealClock(RATE)
    process = subprocess.Popen(
        [sys.executable, __file__, "--replay"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdin
    assert process.stdout
    process.stdin.write(json.dumps(chunks).encode())
    process.stdin.close()
    port = os.open(process.stdout.readline().strip(), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        with realtime("try") as real_time:
            real_time.start()
            for tick in range(WARM + ticks):
                data = sent[tick % len(sent)]
                clock.wait()
                start = time.perf_counter()
                with suppress(BlockingIOError):
                    os.read(port, 65_536)
                middle = time.perf_counter()
                if data:
                    os.write(port, data)
                end = time.perf_counter()
                if tick >= WARM:
                    times["read"].append(middle - start)
                    times["write"].append(end - middle)
    finally:
        os.close(port)
        process.kill()
        process.wait()
    return times


def in_process(tree: Path | None, path: Path, ticks: int) -> dict[str, Any]:
    """Measure a version in another process."""
    environment = dict(os.environ)
    if tree:
        environment["PYTHONPATH"] = str(tree)
    command = [sys.executable, __file__, "--path", str(path), "--ticks", str(ticks)]
    done = subprocess.run(command, env=environment, cwd=tree, stdout=subprocess.PIPE, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def p50(seconds: list[float]) -> float:
    return float(np.percentile(seconds, 50)) * 1e6 if seconds else 0.0


def report(rig: str, versions: dict[str, Times], limits: dict[str, dict[str, list[float]]]) -> None:
    """Print the steps of each bus, and the ratio to the limit."""
    floors = {bus: sum(map(p50, steps.values())) for bus, steps in limits.items()}
    for title, times in versions.items():
        whole, total = times[""], sum(floors.values())
        tick, high = p50(whole[TICK]), float(np.percentile(whole[TICK], 99)) * 1e6
        print(
            f"{f'{rig}{title}':{WIDTH}}{p50(whole['read']):8.1f}{'':16}{p50(whole['write']):8.1f}"
            f"{tick:8.1f} /{high:7.1f}{tick / total:8.1f}"
        )
        for bus, floor in floors.items():
            cells = [p50(times[bus].get(step, [])) for step in STEPS]
            steps = "".join(f"{cell:8.1f}" for cell in cells)
            print(f"{f'  {bus}':{WIDTH}}{steps}{sum(cells):8.1f}{'':9}{sum(cells) / floor:8.1f}")
    for bus, steps in limits.items():
        read, write = p50(steps["read"]), p50(steps["write"])
        print(f"{f'  limit of {bus}':{WIDTH}}{read:8.1f}{'':16}{write:8.1f}{read + write:8.1f}")


def socketcan(ticks: int) -> None:
    """Print the time to receive and send two frames of Linux with a pair of datagram sockets."""
    from can.interfaces.socketcan import SocketcanBus

    from drivers.transports.can_adapter import PythonCanAdapter, SocketCanAdapter, packed
    from drivers.transports.can_frame import CanFrame

    host, device = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    host.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    frames = [CanFrame(identifier, bytes(8)) for identifier in (0x29, 0x49)]
    wire = [packed(frame) for frame in frames]
    bus = SocketcanBus.__new__(SocketcanBus)  # without its constructor, which needs SocketCAN
    bus.socket, bus.channel, bus._filters, bus._is_filtered = host, "pair", None, True
    bus._is_shutdown = True
    adapter, theirs = SocketCanAdapter(bus), PythonCanAdapter(bus)

    def receive() -> None:
        with suppress(BlockingIOError):
            while True:
                host.recv(len(wire[0]), socket.MSG_DONTWAIT)

    def send() -> None:
        for data in wire:
            host.send(data, socket.MSG_DONTWAIT)

    ways: dict[str, tuple[Callable[[], object], Callable[[], object]]] = {
        "two frames of SocketCAN": (adapter.drain, lambda: adapter.put(frames)),
        "the same with python-can": (theirs.drain, lambda: theirs.put(frames)),
        "limit of the same frames": (receive, send),
    }
    times: dict[str, tuple[list[float], list[float]]] = {way: ([], []) for way in ways}
    clock = RealClock(RATE)
    with realtime("try") as real_time:
        real_time.start()
        for _ in range(ticks):
            for way, (read, write) in ways.items():
                for data in wire:
                    device.send(data)
                clock.wait()
                start = time.perf_counter()
                read()
                middle = time.perf_counter()
                write()
                end = time.perf_counter()
                times[way][0].append(middle - start)
                times[way][1].append(end - middle)
                for data in wire:
                    device.recv(len(data))
    *_, limits = times.values()
    floor = sum(map(p50, limits))
    for way, (reads, writes) in times.items():
        both = p50(reads) + p50(writes)
        ratio = f"{both / floor:8.1f}" if times[way] is not limits else ""
        print(f"{way:{WIDTH}}{p50(reads):8.1f}{'':16}{p50(writes):8.1f}{both:8.1f}{'':9}{ratio}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rigs", nargs="*", default=RIGS, help="names of example rigs")
    parser.add_argument("--ticks", type=int, default=1500, help="of each round")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--against", type=Path, help="folder with the source of another version")
    parser.add_argument("--path", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--replay", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.replay:
        replay(json.load(sys.stdin))
    if given.path:
        print(json.dumps(measure(given.path, given.ticks)))
        return
    trees: dict[str, Path | None] = {"": None}
    if given.against:
        trees[", other version"] = given.against.absolute()
    print(f"{given.rounds} times {given.ticks} ticks at 1 kHz, load {os.getloadavg()[0]:.1f}")
    head = "".join(f"{step:>8}" for step in STEPS)
    print(f"{'p50 (of a tick also p99) [us]':{WIDTH}}{head}{'tick':>8}{'':9}{'ratio':>8}")
    for rig in given.rigs:
        versions: dict[str, Times] = {t: defaultdict(lambda: defaultdict(list)) for t in trees}
        limits: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
        for _ in range(given.rounds):
            for title, tree in trees.items():
                with emulated(rig) as path:
                    found = in_process(tree, path, given.ticks)
                for bus, steps in found["times"].items():
                    for step, seconds in steps.items():
                        versions[title][bus][step] += seconds
            for bus, chunks in found[BYTES].items():
                for step, seconds in limit(chunks, given.ticks).items():
                    limits[bus][step] += seconds
        report(rig, versions, limits)
    socketcan(given.ticks)


if __name__ == "__main__":
    main()
