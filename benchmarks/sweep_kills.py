"""Kill tests of sweeps: SIGKILL of a worker or of the main process at random instants.

    python benchmarks/sweep_kills.py             # 20 instants of each kind
    python benchmarks/sweep_kills.py --times 5 --kind dask

A sweep of short trials runs without interruption first. Then the sweep is run again and again, and
each time one process is killed: a worker of the process pool, a worker of a local Dask cluster, or
the main process, after which the same command resumes the sweep. The exit code is 1 if a table
differs by a byte from that of the first sweep, or if a point that was done was run again.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import psutil

PLAN = """
name = "kills"
seeds = 4
[factors]
cube = ["soft", "medium", "hard"]
condition = ["free", "autonomous"]
[settings]
duration_s = 2.0
"""
KINDS = {"pool": "pool worker", "dask": "Dask worker", "main": "main process"}


class Sweep:
    """A sweep of the plan in a folder, run by two workers.

    Parameters
    ----------
    folder
        Folder of the sweep.
    dask
        Whether it runs on a local Dask cluster.
    """

    def __init__(self, folder: Path, dask: bool = False) -> None:
        self.folder = folder
        self._options = ["--dask", "local"] if dask else []

    def start(self) -> psutil.Popen:
        """Start or resume the sweep."""
        plan = self.folder.parent / "plan.toml"
        plan.write_text(PLAN)
        command = [sys.executable, "-m", "teleop", "sweep", plan, "--out", self.folder]
        return psutil.Popen(
            [*map(str, command), "--workers", "2", *self._options],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    @property
    def done(self) -> list[int]:
        """Numbers of the points in the journal, whose lines are complete."""
        journal = self.folder / "journal.jsonl"
        lines = journal.read_bytes().splitlines(keepends=True) if journal.exists() else []
        points = (json.loads(line).get("point") for line in lines if line.endswith(b"\n"))
        return [point for point in points if point is not None]

    @property
    def tables(self) -> dict[str, bytes]:
        """Content of the tables by name."""
        return {path.name: path.read_bytes() for path in sorted(self.folder.glob("results.*"))}

    def problems(self, expected: dict[str, bytes]) -> list[str]:
        """Return what differs from an uninterrupted sweep after the end of this one."""
        tables = self.tables
        different = [name for name in expected if tables.get(name) != expected[name]]
        repeated = [point for point, count in Counter(self.done).items() if count > 1]
        return [
            *(f"{name} differs" for name in different),
            *(f"point {point} was run {self.done.count(point)} times" for point in repeated),
        ]


def kill_worker(process: psutil.Popen, rng: random.Random) -> bool:
    """Kill one worker of a sweep, and return whether there was one."""
    try:
        workers = [
            child
            for child in process.children(recursive=True)
            if "resource_tracker" not in " ".join(child.cmdline())
        ]
        rng.choice(workers).kill()
    except (psutil.NoSuchProcess, IndexError):
        return False
    return True


def worker_killed(
    sweep: Sweep, rng: random.Random, expected: dict[str, bytes], longest: float
) -> tuple[list[str], int] | None:
    """Kill a worker of a sweep once; return the problems and the number of points done before.

    None: the sweep had ended before.
    """
    process = sweep.start()
    while not sweep.done and process.poll() is None:
        time.sleep(0.01)
    time.sleep(rng.uniform(0.0, longest))
    before = len(sweep.done)
    hit = process.poll() is None and kill_worker(process, rng)
    code = process.wait()
    if not hit or before == len(expected_points(expected)):
        return None
    return [*sweep.problems(expected), *([f"exit code {code}"] if code else [])], before


def expected_points(expected: dict[str, bytes]) -> set[bytes]:
    """Return the numbers of the points in results.csv."""
    return {line.split(b",")[0] for line in expected["results.csv"].splitlines()[1:]}


def kill_workers(
    kind: str, times: int, folder: Path, expected: dict[str, bytes], longest: float
) -> int:
    """Kill a worker in each of several sweeps, print the result, and return how many failed."""
    rng, bad, done = random.Random(kind), 0, []
    turn = 0
    while len(done) < times:
        turn += 1
        sweep = Sweep(folder / f"{kind}{turn}", kind == "dask")
        found = worker_killed(sweep, rng, expected, longest)
        if found is None:
            continue
        problems, before = found
        done.append(before)
        bad += bool(problems)
        for problem in problems:
            print(f"  {sweep.folder.name}: {problem}")
    report(kind, done, len(expected_points(expected)), f"{len(done)} sweeps", bad)
    return bad


def kill_main(times: int, folder: Path, expected: dict[str, bytes], longest: float) -> int:
    """Kill the main process of sweeps, resume them until they end, and report as `kill_workers`."""
    rng, bad, done, finished = random.Random("main"), 0, [], 0
    sweep = Sweep(folder / "main0")
    while True:
        process = sweep.start()
        try:
            process.wait(rng.uniform(0.0, longest) if len(done) < times else None)
        except psutil.TimeoutExpired:
            process.kill()
            process.wait()
            done.append(len(sweep.done))
            continue
        finished += 1
        problems = sweep.problems(expected)
        problems += [f"exit code {process.returncode}"] if process.returncode else []
        bad += bool(problems)
        for problem in problems:
            print(f"  {sweep.folder.name}: {problem}")
        if len(done) >= times:
            break
        sweep = Sweep(folder / f"main{finished}")
    report("main", done, len(expected_points(expected)), f"{finished} sweeps", bad)
    return bad


def report(kind: str, done: list[int], total: int, sweeps: str, bad: int) -> None:
    """Print the result of a kind."""
    print(
        f"{KINDS[kind]:13} killed {len(done)} times in {sweeps}, after {min(done)} to {max(done)} "
        f"of {total} points; {bad} sweeps differ from the uninterrupted one",
        flush=True,
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--kind", choices=KINDS, nargs="*", default=[*KINDS])
    options = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        whole = Sweep(folder / "whole")
        begin = time.monotonic()
        process = whole.start()
        while not whole.done:
            time.sleep(0.01)
        first = time.monotonic()
        if process.wait():
            raise SystemExit("the uninterrupted sweep failed")
        end = time.monotonic()
        expected = whole.tables
        for kind in options.kind:
            if kind == "main":
                bad += kill_main(options.times, folder, expected, end - begin)
            else:
                bad += kill_workers(kind, options.times, folder, expected, end - first)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
