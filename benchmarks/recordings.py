"""Check `teleop estimate` on recordings of known stiffness: `python benchmarks/recordings.py`.

Each recording is written by the library of its format, and evaluated by `teleop estimate` with the
options in the table. One line is printed for each recording. The verdict is

- right: the 95 % interval of k contains the true k, or k is within 1 % of the true k;
- no k: no stiffness is reported, but a reason. This is expected for recordings without a true k;
- remark: the interval of k does not contain the true k, but a remark describes the problem;
- WRONG: none of these. No reason and no remark is reported.

The last line counts the verdicts WRONG. The true stiffness of the measured recordings is not known.
For these, k must be within 3 % of a least-squares fit (`examples/data/mach1/README.md`).
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import tempfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import recording_writers as formats
from numpy.random import Generator

from estimation.testing_records import COVERAGE_KINDS, WITHOUT_STIFFNESS
from teleop.cli import main as teleop

MACH1 = Path(__file__).parents[1] / "examples" / "data" / "mach1"
CLOSE = 0.01
SEED = 60_000


class Record(NamedTuple):
    t: np.ndarray
    x: np.ndarray
    f: np.ndarray
    k: float
    """True stiffness [N/m]; NaN if there is none."""
    tolerance: float = CLOSE


class Case(NamedTuple):
    kind: str
    make: Callable[[Generator], Record]
    form: str = "csv"
    write: formats.Writer = formats.CSV
    options: tuple[str, ...] = ()


def drawn(kind: str) -> Callable[[Generator], Record]:
    def make(rng: Generator) -> Record:
        record = (COVERAGE_KINDS | WITHOUT_STIFFNESS)[kind](rng)
        return Record(record.t, record.x, record.f, record.k)

    return make


def sine(
    rng: Generator,
    rate: float = 200.0,
    seconds: float = 10.0,
    frequency: float = 1.0,
    k: float = 2000.0,
    amplitude: float = 1e-3,
    noise: float = 0.01,
) -> Record:
    """Return a sine about a preload on a body whose force is linear in depth and velocity."""
    t = np.arange(round(rate * seconds)) / rate
    w = 2.0 * math.pi * frequency
    x = amplitude * np.sin(w * t)
    f = 5.0 + k * x + 0.1 * k * amplitude * np.cos(w * t) + rng.normal(0.0, noise, len(t))
    return Record(t, 3e-3 + x, f, k)


def changed(**changes: float) -> Callable[[Generator], Record]:
    return lambda rng: sine(rng, **changes)


def coarse_encoder(rng: Generator) -> Record:
    record = sine(rng)
    return record._replace(x=np.round(record.x / 5e-5) * 5e-5)


def warming(rng: Generator) -> Record:
    record = sine(rng, seconds=30.0)
    return record._replace(f=record.f + 2.0 * (1.0 - np.exp(-record.t / 10.0)))


def spikes(rng: Generator) -> Record:
    record = sine(rng)
    f = record.f.copy()
    f[rng.choice(len(f), 10, replace=False)] += 50.0
    return record._replace(f=f)


def position_spikes(rng: Generator) -> Record:
    record = sine(rng)
    x = record.x.copy()
    x[rng.choice(len(x), 5, replace=False)] += 0.02
    return record._replace(x=x)


def uneven(rng: Generator) -> Record:
    record = sine(rng, rate=1000.0)
    kept = np.sort(rng.choice(len(record.t), len(record.t) // 4, replace=False))
    return Record(record.t[kept], record.x[kept], record.f[kept], record.k)


def repeated(rng: Generator) -> Record:
    record = sine(rng)
    n = np.sort(np.concatenate([np.arange(len(record.t)), rng.choice(len(record.t), 60)]))
    return Record(record.t[n], record.x[n], record.f[n], record.k)


def with_gap(rng: Generator) -> Record:
    record = sine(rng)
    kept = (record.t < 4.0) | (record.t > 5.3)
    return Record(record.t[kept], record.x[kept], record.f[kept], record.k)


def two_bodies(rng: Generator) -> Record:
    """Return a record whose stiffness changes from 1000 to 3000 N/m in the middle."""
    soft, hard = sine(rng, k=1000.0), sine(rng, k=3000.0)
    return Record(
        np.concatenate([soft.t, hard.t + 10.0]),
        np.concatenate([soft.x, hard.x]),
        np.concatenate([soft.f, hard.f]),
        math.nan,
    )


def hunt_crossley(rng: Generator) -> Record:
    t = np.arange(4000) / 200.0
    x = 1.5e-3 - 1.5e-3 * np.cos(2.0 * np.pi * 0.5 * t) + 1e-4
    v = 1.5e-3 * np.pi * np.sin(2.0 * np.pi * 0.5 * t)
    f = 5e4 * x**1.4 * (1.0 + 2.0 * v) + rng.normal(0.0, 0.003, len(t))
    elastic = 5e4 * x**1.4
    middle = (0.5 * (elastic.max() + elastic.min()) / 5e4) ** (1.0 / 1.4)
    return Record(t, x, f, 1.4 * 5e4 * middle**0.4)


def stiffening(rng: Generator) -> Record:
    t = np.arange(4000) / 200.0
    x = 1e-3 - 1e-3 * np.cos(2.0 * np.pi * 0.7 * t)
    f = 1500.0 * x + 2.5e8 * x**3 + rng.normal(0.0, 0.01, len(t))
    grid = np.linspace(0.0, 2e-3, 100_001)
    middle = float(np.interp(0.5, (1500.0 * grid + 2.5e8 * grid**3) / (3.0 + 2.0), grid))
    return Record(t, x, f, 1500.0 + 7.5e8 * middle**2)


def tension(rng: Generator) -> Record:
    record = sine(rng)
    return record._replace(f=-record.f)


def no_motion(rng: Generator) -> Record:
    t = np.arange(1000) / 100.0
    x = 1e-3 + rng.normal(0.0, 1e-7, len(t))
    return Record(t, x, 2.0 + rng.normal(0.0, 0.02, len(t)), math.nan)


def few(rng: Generator) -> Record:
    record = sine(rng, rate=100.0, noise=0.05)
    return Record(record.t[:16], record.x[:16], record.f[:16], math.nan)


def offset(rng: Generator) -> Record:
    record = sine(rng)
    return record._replace(x=record.x + 1.25, f=record.f - 300.0)


def measured(name: str, k: float) -> Case:
    def make(rng: Generator) -> Record:
        return Record(*np.zeros((3, 1)), k, 0.03)

    def write(folder: Path, *arrays: np.ndarray) -> Path:
        return MACH1 / name

    return Case("measured, Mach-1", make, "csv", write)


CASES = [
    *(Case(kind, drawn(kind)) for kind in (*COVERAGE_KINDS, *WITHOUT_STIFFNESS) for _ in range(2)),
    Case("stiffening body", stiffening),
    Case("Hunt-Crossley body", hunt_crossley),
    Case("two bodies", two_bodies),
    Case("nothing moves", no_motion),
    Case("16 samples", few),
    Case("one cycle", changed(seconds=1.0)),
    Case("three cycles", changed(seconds=3.0)),
    Case("coarse encoder", coarse_encoder),
    Case("10 Hz", changed(rate=10.0, frequency=0.2, seconds=60.0)),
    Case("10 Hz, fast motion", changed(rate=10.0, frequency=2.0, seconds=60.0)),
    Case("10 kHz", changed(rate=10_000.0, frequency=5.0, seconds=4.0)),
    Case("force sign inverted", tension),
    Case("force sign inverted", tension, options=("--invert", "force")),
    Case("offsets", offset),
    Case("drift of temperature", warming),
    Case("force spikes", spikes),
    Case("position spikes", position_spikes),
    Case("uneven times", uneven),
    Case("repeated times", repeated),
    Case("a gap", with_gap),
    Case("sine", sine, "Mach-1", formats.MACH_1),
    Case("sine", sine, "Zwick", formats.ZWICK),
    Case("sine", sine, "Bluehill, GBK", formats.BLUEHILL),
    Case("sine", sine, "UTF-16", formats.UTF_16),
    Case("sine", sine, "ms, um, kN", formats.OTHER_UNITS),
    Case("sine", sine, "min, cm, gf", formats.GRAMS),
    Case("sine", sine, "MATLAB", formats.matlab),
    Case("sine", sine, "HDF5", formats.hdf5),
    Case("sine", sine, "Parquet", formats.parquet),
    Case("sine", sine, "TDMS", formats.tdms),
    Case("sine", sine, "Excel", formats.excel),
    Case("sine", sine, "LabVIEW", formats.labview),
    Case("sine", sine, "ROS 1 bag", formats.bag(1), formats.BAG_OPTIONS),
    Case("sine", sine, "ROS 2 bag", formats.bag(2, "sqlite3"), formats.BAG_OPTIONS),
    Case("sine", sine, "ROS 2 MCAP", formats.bag(2, "mcap"), formats.BAG_OPTIONS),
    measured("sinusoid_0.2Hz.csv", 940_800.0),
    measured("sinusoid_0.5Hz.csv", 980_000.0),
    measured("sinusoid_1Hz.csv", 1_007_800.0),
]


def answer(case: Case, record: Record) -> dict[str, object]:
    """Return the result of `teleop estimate`, or the error message as the reason for no result."""
    out, err = io.StringIO(), io.StringIO()
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        path = case.write(Path(folder), record.t, record.x, record.f)
        code = teleop(["estimate", str(path), *case.options, "--json"])
    if code == 2:
        return {"identifiable": False, "reasons": [err.getvalue().strip().splitlines()[-1]]}
    result: dict[str, object] = json.loads(out.getvalue())["result"]
    return result


def verdict(record: Record, result: dict) -> str:
    if not result["identifiable"]:
        return "no k" if result["reasons"] else "WRONG"
    inside = result["k_low"] <= record.k <= result["k_high"]
    if inside or abs(result["k"] / record.k - 1.0) < record.tolerance:
        return "right"
    return "remark" if result["reasons"] else "WRONG"


def main() -> None:
    print(
        f"{'':>2}  {'kind':22} {'format':14} {'true k':>9} {'k':>9} {'low':>9} {'high':>9}  verdict"
    )
    wrong = 0
    for number, case in enumerate(CASES, 1):
        rng = np.random.default_rng([zlib.crc32(case.kind.encode()), SEED + number])
        record = case.make(rng)
        result = answer(case, record)
        found = verdict(record, result)
        wrong += found == "WRONG"
        numbers = [record.k, *(result.get(name) for name in ("k", "k_low", "k_high"))]
        texts = [f"{v:9.5g}" if v is not None and v == v else f"{'-':>9}" for v in numbers]
        why = ""
        if found in ("no k", "remark"):
            why = ": " + str(result["reasons"][0]).replace("\n", " ")[:70]
        print(
            f"{number:2}  {case.kind:22} {case.form:14} {' '.join(texts)}  {found}{why}", flush=True
        )
    kinds = len({case.kind for case in CASES})
    print(f"{len(CASES)} recordings of {kinds} kinds, {wrong} silent wrong answers")


if __name__ == "__main__":
    main()
