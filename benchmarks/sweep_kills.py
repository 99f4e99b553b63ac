"""Kill workers or the main process of sweeps at random times, and check the tables.

    python benchmarks/sweep_kills.py             # 20 of each kind
    python benchmarks/sweep_kills.py --times 5 --kind dask

First, a sweep of short trials runs without interruption. Then three kinds of process are killed
with SIGKILL while such a sweep runs: workers of the process pool, workers of a local Dask cluster,
and the main process. After the main process was killed, the same command resumes the sweep. The
exit code is 1 if a table differs by a byte from that of the first sweep, or if a point that was
done was run again.
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
seeds = {seeds}
[factors]
cube = ["soft", "medium", "hard"]
condition = ["free", "autonomous"]
[settings]
duration_s = 2.0
"""
KINDS = {"pool": "pool worker", "dask": "Dask worker", "main": "main process"}


class Sweep:
    """A sweep that is run by two workers. The plan is the file plan.toml in the parent folder.

    Parameters
    ----------
    folder
        Folder of the sweep.
    dask
        Whether the sweep runs on a local Dask cluster.
    """

    def __init__(self, folder: Path, dask: bool = False) -> None:
        self.folder = folder
        self._options = ["--dask", "local"] if dask else []

    def start(self) -> psutil.Popen:
        """Start or resume the sweep."""
        plan = self.folder.parent / "plan.toml"
        command = [sys.executable, "-m", "teleop", "sweep", plan, "--out", self.folder]
        return psutil.Popen(
            [*map(str, command), "--workers", "2", *self._options],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    @property
    def done(self) -> list[int]:
        """Numbers of the points in the complete lines of the journal."""
        journal = self.folder / "journal.jsonl"
        lines = journal.read_bytes().splitlines(keepends=True) if journal.exists() else []
        points = (json.loads(line).get("point") for line in lines if line.endswith(b"\n"))
        return [point for point in points if point is not None]

    @property
    def tables(self) -> dict[str, bytes]:
        """Content of the tables by name."""
        return {path.name: path.read_bytes() for path in sorted(self.folder.glob("results.*"))}

    def problems(self, expected: dict[str, bytes]) -> list[str]:
        """Return how this sweep, which has ended, differs from an uninterrupted sweep."""
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


def kill_workers(
    kind: str, times: int, folder: Path, expected: dict[str, bytes], gap: float
) -> int:
    """Kill workers of sweeps until `times` are killed, and return how many sweeps differ.

    Parameters
    ----------
    kind
        `pool` or `dask`.
    times
        Number of workers that are killed.
    folder
        Folder for the folders of the sweeps.
    expected
        Tables of the uninterrupted sweep.
    gap
        Mean time between two kills [s].
    """
    rng, bad, done, sweeps = random.Random(kind), 0, [], 0
    while len(done) < times:
        sweep = Sweep(folder / f"{kind}{sweeps}", kind == "dask")
        sweeps += 1
        process = sweep.start()
        while not sweep.done and process.poll() is None:
            time.sleep(0.01)
        while process.poll() is None and len(done) < times:
            try:
                process.wait(gap * rng.uniform(0.1, 1.9))
            except psutil.TimeoutExpired:
                if kill_worker(process, rng):
                    done.append(len(sweep.done))
        bad += differs(sweep, process.wait(), expected)
    report(kind, done, sweeps, bad)
    return bad


def kill_main(
    times: int, folder: Path, expected: dict[str, bytes], gap: float, start: float
) -> int:
    """Kill the main process of sweeps and resume the sweeps; return how many sweeps differ.

    `start` is the time from the start of the process to the first point [s]. The other parameters
    are those of `kill_workers`.
    """
    rng, bad, done, sweeps = random.Random("main"), 0, [], 1
    sweep = Sweep(folder / "main0")
    while True:
        process = sweep.start()
        try:
            wait = rng.uniform(0.0, start + 2.0 * gap) if len(done) < times else None
            code = process.wait(wait)
        except psutil.TimeoutExpired:
            process.kill()
            process.wait()
            done.append(len(sweep.done))
            continue
        bad += differs(sweep, code, expected)
        if len(done) >= times:
            break
        sweep = Sweep(folder / f"main{sweeps}")
        sweeps += 1
    report("main", done, sweeps, bad)
    return bad


def differs(sweep: Sweep, code: int, expected: dict[str, bytes]) -> bool:
    """Print what differs in a sweep that has ended, and return whether anything does."""
    problems = sweep.problems(expected)
    if code:
        problems.append(f"exit code {code}")
    for problem in problems:
        print(f"  {sweep.folder.name}: {problem}")
    return bool(problems)


def report(kind: str, done: list[int], sweeps: int, bad: int) -> None:
    """Print the result of a kind."""
    print(
        f"{KINDS[kind]:13} killed {len(done)} times, after {min(done)} to {max(done)} points; "
        f"{bad} of {sweeps} sweeps differ",
        flush=True,
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seeds", type=int, default=20, help="for 6 points each")
    parser.add_argument("--kind", choices=KINDS, nargs="*", default=[*KINDS])
    options = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "plan.toml").write_text(PLAN.format(seeds=options.seeds))
        whole = Sweep(folder / "whole")
        begin = time.monotonic()
        process = whole.start()
        while not whole.done and process.poll() is None:
            time.sleep(0.01)
        start = time.monotonic() - begin
        if process.wait():
            raise SystemExit("the uninterrupted sweep failed")
        gap = (time.monotonic() - begin - start) / (options.times + 2)
        expected = whole.tables
        print(f"a sweep of {len(whole.done)} points by two workers", flush=True)
        for kind in options.kind:
            if kind == "main":
                bad += kill_main(options.times, folder, expected, gap, start)
            else:
                bad += kill_workers(kind, options.times, folder, expected, gap)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
