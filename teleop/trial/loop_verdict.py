"""Judge from the measured timing of the loop whether this computer can run it at its rate."""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from estimation.arrays import Floats
from teleop.recording.timing import PERCENTILES
from teleop.safety import Limits
from teleop.trial.other_programs import OtherPrograms

SHARE = 0.9
"""Largest fraction of a period of the loop that a tick may take."""
TYPICAL = 90.0
"""Percentile of the durations of the ticks that is compared with the period."""
RARE = 1e-3
"""Largest fraction of the periods that may be missed, or of the ticks that may be late by half a
period, without a remark. At this fraction, the mean rate of the loop is wrong by 0.1 %. A single
such tick is never remarked, because a short measurement cannot tell its fraction."""
MARGIN = 0.5
"""Largest fraction of a watchdog time that the longest time between two ticks may take without a
remark."""
OTHERS = 0.2
"""Use of a processor by other programs that is stated."""

Level = Literal["yes", "with delays", "no"]


class LoopTiming(NamedTuple):
    """Timing of the loop in a measurement; times in s."""

    rate: float
    """Nominal rate [Hz]."""
    seconds: float
    """Duration."""
    ticks: int
    skipped: int
    """Number of missed periods, in which no tick began."""
    late: int
    """Number of ticks that began late by more than half a period."""
    lateness: dict[str, float]
    """Percentiles of the lateness of the ticks, by the names in `PERCENTILES`."""
    busy: dict[str, float]
    """Percentiles of the durations of the ticks."""
    typical: float
    """Percentile `TYPICAL` of the durations of the ticks."""
    reading: dict[str, float] | None
    """Percentiles of the time to read the devices of a rig, which is a part of the tick."""
    longest_gap: float
    """Longest time between two ticks."""
    others: OtherPrograms
    work: float
    """The same percentile of the processor times of the ticks. It does not contain the time in
    which other programs had the processor."""
    fault: str = ""
    """Fault that the timing of the loop has caused; empty if there was none."""

    @classmethod
    def of_ticks(
        cls,
        rate: float,
        lateness: Floats,
        skipped: Floats,
        busy: Floats,
        reading: Floats,
        others: OtherPrograms,
        work: Floats | None = None,
    ) -> Self:
        """Return the statistics of successive ticks; each array has the shape (n,).

        The duration of a tick is known at the next tick: `busy` and `work` are those of the tick
        before. Default of `work`: `busy`.
        """
        gaps = (1.0 + skipped[1:]) / rate + np.diff(lateness)
        busy = busy[1:] if len(busy) > 1 else busy
        work = busy if work is None else work[1:] if len(work) > 1 else work
        return cls(
            rate,
            float(np.sum(gaps)),
            len(lateness),
            int(skipped[1:].sum()),
            int(np.sum(lateness > 0.5 / rate)),
            percentiles(lateness),
            percentiles(busy),
            percentile(busy, TYPICAL),
            percentiles(reading) if len(reading) else None,
            float(np.max(gaps, initial=0.0)),
            others,
            percentile(work, TYPICAL),
        )

    @property
    def missed(self) -> float:
        """Missed periods as a fraction of all periods."""
        return self.skipped / max(1, self.ticks + self.skipped)

    def document(self) -> dict[str, Any]:
        """Return the timing as a part of a JSON document, with the names of a recording's."""
        names = [
            {"name": name, "process": process, "processors": use}
            for name, process, use in self.others.names
        ]
        return {
            "rate_hz": self.rate,
            "duration_s": self.seconds,
            "ticks": self.ticks,
            "skipped": self.skipped,
            "late_ticks": self.late,
            "longest_gap_s": self.longest_gap,
            "lateness_us": microseconds(self.lateness),
            "tick_us": {
                "busy": microseconds(self.busy) | {"p90": self.typical * 1e6},
                "processor_time": {"p90": self.work * 1e6},
                **({"devices": microseconds(self.reading)} if self.reading else {}),
            },
            "other_programs": {**self.others._asdict(), "names": names},
        }


class LoopVerdict(NamedTuple):
    """Whether a computer can run the loop at its rate, with the reasons in plain words."""

    level: Level
    reasons: list[str]
    """Reasons against it, and what was remarkable; empty for the level `yes`."""
    watchdog: float
    """Shortest time after which a pause of the loop stops the rig [s]."""
    timing: LoopTiming

    @property
    def possible(self) -> bool:
        """Whether a trial at this rate can be run."""
        return self.level != "no"

    @property
    def fits(self) -> bool:
        """Whether the processor time of a tick fits into its period.

        A short measurement can tell this, also while other programs use the processor.
        """
        return self.cost <= SHARE / self.timing.rate

    @property
    def margin(self) -> float:
        """Time by which the longest gap between two ticks was shorter than the watchdog [s]."""
        return self.watchdog - self.timing.longest_gap

    @property
    def cost(self) -> float:
        """Processor time of a tick [s]."""
        return self.timing.work

    @property
    def text(self) -> str:
        """The verdict in one line, with its figures."""
        t = self.timing
        judged = {
            "yes": "this computer can run the loop",
            "with delays": "this computer can run the loop, with delays",
            "no": "this computer cannot run the loop",
        }[self.level]
        return (
            f"{t.rate:g} Hz: {judged}: measured for {t.seconds:.3g} s: a tick takes "
            f"{t.typical * 1e6:.0f} us (p90) of {1e6 / t.rate:.0f} us, begins "
            f"{t.lateness['p99_9'] * 1e6:.0f} us late (p99.9), {t.skipped} of "
            f"{t.ticks + t.skipped} periods missed, longest gap {t.longest_gap * 1e3:.1f} ms"
        )


def verdict_of(
    timing: LoopTiming, limits: Limits, watchdogs: dict[str, float] | None = None
) -> LoopVerdict:
    """Judge the timing of a loop.

    Parameters
    ----------
    timing
        The measured timing.
    limits
        Limits of the safety supervisor, which stops a loop that pauses or skips too many periods.
    watchdogs
        Watchdog time of each drive [s], by the name of its device. Default: none.

    Returns
    -------
    LoopVerdict
        `no` if a tick does not fit into a period, or if the supervisor or a watchdog would stop the
        rig. `with delays` if more than the fraction `RARE` of the periods was missed, or of the
        ticks late by half a period, or if a pause took more than the fraction `MARGIN` of a
        watchdog time. Otherwise `yes`.
    """
    name, shortest = "the safety supervisor", limits.max_gap
    for device, seconds in (watchdogs or {}).items():
        if seconds < shortest:
            name, shortest = f"the watchdog of {device}", seconds
    gap, rate = timing.longest_gap, timing.rate
    fewer = "expected fewer programs at the same time, or a lower rate"
    against = []
    if timing.typical > SHARE / rate:
        against.append(too_slow(rate, timing.typical))
    if timing.missed > limits.max_skipped_fraction:
        against.append(
            f"rate {rate:g} Hz: {timing.missed:.0%} of the periods were missed, at most "
            f"{limits.max_skipped_fraction:.0%} are permitted: {fewer}"
        )
    if gap > shortest:
        against.append(
            f"rate {rate:g} Hz: the loop paused for {gap * 1e3:.0f} ms, and {name} stops the rig "
            f"after {shortest * 1e3:.0f} ms: {fewer}"
        )
    elif timing.fault:
        against.append(f"rate {rate:g} Hz: {timing.fault}: {fewer}")
    if against:
        return LoopVerdict("no", against, shortest, timing)
    remarks = []
    few = max(1.0, RARE * (timing.ticks + timing.skipped))
    if timing.skipped > few:
        remarks.append(f"{timing.skipped} periods ({timing.missed:.1%}) were missed")
    if timing.late > few:
        remarks.append(
            f"{timing.late} of {timing.ticks} ticks began late by more than half a period"
        )
    if gap > MARGIN * shortest:
        remarks.append(
            f"the loop paused for {gap * 1e3:.0f} ms, and {name} stops the rig after "
            f"{shortest * 1e3:.0f} ms"
        )
    return LoopVerdict("with delays" if remarks else "yes", remarks, shortest, timing)


def too_slow(rate: float, cost: float, part: str = "") -> str:
    """Return an error message: a tick takes longer than `SHARE` of the period."""
    return (
        f"rate {rate:g} Hz: a tick takes {cost * 1e6:.0f} us{part} on this machine with the "
        f"programs that run now, more than {SHARE:.0%} of the period of {1e6 / rate:.0f} us: "
        f"expected a rate of at most {SHARE / cost:.0f} Hz, or fewer programs at the same time"
    )


def percentile(values: Floats, percentage: float) -> float:
    """Return a percentile; NaN without values."""
    return float(np.percentile(values, percentage)) if len(values) else math.nan


def percentiles(values: Floats) -> dict[str, float]:
    """Return the percentiles in `PERCENTILES`, by name."""
    return {name: percentile(values, q) for name, q in PERCENTILES.items()}


def microseconds(times: dict[str, float]) -> dict[str, float]:
    """Return times in microseconds."""
    return {name: seconds * 1e6 for name, seconds in times.items()}
