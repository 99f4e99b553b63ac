"""Checks for authors of drivers: `check_device` and `check_drive`.

A test of a driver calls them. The time is virtual, and no hardware is needed. The checks with
random data need hypothesis.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from struct import pack
from threading import get_ident
from typing import Any, NamedTuple
from unittest import mock

import can

from drivers.bench import FORCE, SPEED, STEP, TICK, Bench, Emulated, Frame, Sender, Violation
from drivers.device import (
    NO_SAMPLE,
    DatagramDevice,
    Device,
    DeviceSettings,
    ImpedanceDrive,
    PositionDrive,
    SerialDevice,
    SharedSerialDevice,
    sole_drive,
)
from drivers.transports.can_adapter import EXTENDED

PAGE = "docs/writing-a-driver.md"


class Rule(NamedTuple):
    """A rule for drivers."""

    text: str
    """The rule, as it stands on the page."""
    section: str
    """Section of the page with the rule."""


DEVICE, DRIVE, EMULATED = "The rules of a device", "The rules of a drive", "The emulated device"
RULES = {
    "starts": Rule("`start` succeeds with a device that works", DEVICE),
    "raises": Rule("no method raises an exception, whatever arrives", DEVICE),
    "waits": Rule("only `start` waits", DEVICE),
    "signals": Rule("every signal gets samples", DEVICE),
    "finite": Rule("valid frames give finite values and are not rejected", DEVICE),
    "values": Rule("a value is that of the sensor, in the unit of the signal", DEVICE),
    "future": Rule("no sample is newer than the present time", DEVICE),
    "clock": Rule("the time of a sample is on the controller's clock", DEVICE),
    "backwards": Rule("the times of the samples do not decrease", DEVICE),
    "silence": Rule("without a frame there is no new sample", DEVICE),
    "cut": Rule("a frame of a stream may be cut anywhere", DEVICE),
    "truncated": Rule("a frame that is too short gives no sample", DEVICE),
    "noise": Rule("noise between frames is skipped", DEVICE),
    "repeated": Rule("an old or repeated datagram gives no sample", DEVICE),
    "nan": Rule("NaN is passed on or rejected, not replaced by a number", DEVICE),
    "reset": Rule("`start` resets the state of the driver", DEVICE),
    "rearm": Rule("`rearm` clears the stored error", DEVICE),
    "emulated": Rule("the emulated device raises no exception", EMULATED),
    "enables": Rule("`enable` puts the drive into operation", DRIVE),
    "confirms": Rule("`enable` returns True only after the drive has confirmed it", DRIVE),
    "still": Rule("`enable` causes neither motion nor force", DRIVE),
    "command": Rule("`command` returns the value that is sent", DRIVE),
    "at once": Rule("`idle` sends its request at once", DRIVE),
    "repeats": Rule("the request of `idle` is repeated until the drive has confirmed it", DRIVE),
    "stopped": Rule("`idle` returns True only after the drive has confirmed it", DRIVE),
    "stops": Rule("`idle` takes the drive out of operation", DRIVE),
    "feeds": Rule("only a command resets the watchdog timer", DRIVE),
    "watchdog": Rule("the watchdog stops the drive if the host is silent", DRIVE),
    "restart": Rule("a restart of the device in operation is an error", DRIVE),
    "latched": Rule("an error of a drive stays until `rearm`", DRIVE),
}
"""The rules that are checked."""

LONGEST_START = 2.0
"""Longest time until every signal has a sample, and until a drive is in operation [s]."""
RUN = 0.3
"""Time for which the device sends frames in a check, at least [s]."""
OLDEST = 1.0
"""Largest age of the samples of a device that sends [s]."""
SLACK = 0.1
"""Longest time from the end of the watchdog time until the drive stands still [s]."""
LONGEST_STOP = 1.0
"""Longest time until a drive confirms a stop or reports an error [s]."""
EXAMPLES = 25
"""Number of runs with random data."""
NANS = tuple(pack(form, math.nan) for form in ("<f", ">f", "<d", ">d"))
"""NaN as a sequence of bytes."""


@dataclass(frozen=True)
class Case:
    """A driver that is checked."""

    make_device: Callable[[], Device]
    make_emulated: Callable[[Bench], Emulated]
    values: Mapping[str, float] = field(default_factory=dict)
    drive: str = ""
    watchdog: float = math.nan

    def bench(self) -> Bench:
        """Return a new device on a new bench. The driver is not started."""
        return Bench(self.make_device(), self.make_emulated, self.values, self.drive)

    def started(self) -> Bench:
        """Return a bench on which the driver is started and every signal has a sample."""
        bench = self.bench()
        bench.start()
        await_samples(bench)
        return bench

    def moving(self) -> Bench:
        """Return a bench whose drive follows a command."""
        bench = self.started()
        operate(bench)
        bench.command(1.0, 0.2)
        return bench


Check = Callable[[Case], Iterator[tuple[str, str]]]
"""Check of a driver: yields the rules that are violated, each with what was seen."""


def silent_signals(bench: Bench) -> list[str]:
    """Return the signals without a sample."""
    return [name for name in bench.device.signals() if bench.device.samples[name] is NO_SAMPLE]


def await_samples(bench: Bench) -> None:
    """Read until every signal has a sample."""
    end = bench.time + LONGEST_START
    while silent := silent_signals(bench):
        if bench.time > end:
            rejected = f", rejected: {dict(bench.device.rejected)}" if bench.device.rejected else ""
            seen = f"no sample of {', '.join(silent)} in {LONGEST_START:g} s{rejected}"
            raise Violation("signals", seen)
        bench.read(TICK)


def operate(bench: Bench) -> None:
    """Request operation until the drive has confirmed it."""
    end = bench.time + LONGEST_START
    while not bench.enable():
        if bench.time > end:
            error = bench.device.error
            seen = f"enable returned False for {LONGEST_START:g} s"
            raise Violation("enables", seen + (f", error: {error}" if error else ""))
        check_still(bench)
    check_still(bench)


def check_still(bench: Bench) -> None:
    """Raise Violation if the part moves or is pushed while operation is only requested.

    A drive may round zero to a small value.
    """
    if abs(bench.velocity) > 0.1 * SPEED or abs(bench.force) > 0.1 * FORCE:
        seen = f"{bench.velocity:g} m/s and {bench.force:g} N before the first command"
        raise Violation("still", seen)


def check_clean_frames(case: Case) -> Iterator[tuple[str, str]]:
    """Check the samples of a device that works."""
    bench = case.bench()
    device = bench.device
    units = device.signals()
    if device.samples != dict.fromkeys(units, NO_SAMPLE):
        yield "silence", f"samples before the first frame: {device.samples}"
    bench.start()
    await_samples(bench)
    rejected = dict(device.rejected)
    bench.read(RUN)
    if dict(device.rejected) != rejected:
        yield "finite", f"rejected {dict(device.rejected)}"
    bench.read(max(0.0, OLDEST - RUN))
    for signal in units:
        value, then = device.samples[signal]
        if not isinstance(value, float | int) or not math.isfinite(value):
            yield "finite", f"{signal} is {value!r}"
        elif signal in case.values and signal in bench.sensed:
            true = case.values[signal]
            if not math.isclose(value, true, rel_tol=0.01):
                yield "values", f"{signal} is {value:g} {units[signal]}, expected {true:g}"
        if bench.time - then > OLDEST:
            seen = f"the newest sample of {signal} is {bench.time - then:.3g} s old"
            yield "clock", f"{seen}, although frames arrive"
    device.error = "an error that the check has set"
    with bench.during("rearm"):
        device.rearm()
    if device.error:
        yield "rearm", f"after rearm, the error is {device.error!r}"


def check_silence(case: Case) -> Iterator[tuple[str, str]]:
    """Check that samples grow old if no frame arrives."""
    bench = case.started()
    bench.read(RUN)
    bench.is_deaf = True
    bench.read(2 * TICK)
    before = dict(bench.device.samples)
    bench.read(RUN)
    for signal, sample in bench.device.samples.items():
        if sample.time > before[signal].time:
            newer = sample.time - before[signal].time
            seen = f"the time of {signal} advanced by {newer * 1e3:.3g} ms in {RUN:g} s of silence"
            yield "silence", seen
        elif sample.value == sample.value != before[signal].value:
            yield "silence", f"the value of {signal} changed in silence"


class Cutter:
    """Delivers each byte, or all bytes but the last few of a tick, in a call of its own."""

    def __init__(self, by_byte: bool) -> None:
        self._by_byte = by_byte
        self._rest = b""
        self._held = 0

    def __call__(self, frames: Sequence[bytes]) -> list[bytes]:
        """Return the pieces for this tick."""
        data, self._rest = self._rest + b"".join(frames), b""
        if self._by_byte:
            return [data[i : i + 1] for i in range(len(data))]
        self._held = self._held % 40 + 1
        end = max(len(data) - self._held, 0) if frames else len(data)
        self._rest = data[end:]
        return [data[:end]] if end else []


def check_cut_frames(case: Case) -> Iterator[tuple[str, str]]:
    """Check that a stream may be cut anywhere, and that other frames that are cut give no sample.

    The frames on a CAN bus and on a network are not parts of a stream.
    """
    if isinstance(case.make_device(), SerialDevice | SharedSerialDevice):
        for by_byte, how in ((True, "byte by byte"), (False, "cut between two ticks")):
            bench = case.started()
            bench.pieces = Cutter(by_byte)
            rejected, begin = dict(bench.device.rejected), bench.time
            try:
                bench.read(RUN)
                bench.read(OLDEST - RUN)
            except Violation as violation:
                yield violation.rule, f"{violation.seen}, with frames {how}"
                continue
            if bench.newest() < begin + 0.5 * OLDEST:
                yield "cut", f"no sample of every signal, with frames {how}"
            elif dict(bench.device.rejected) != rejected:
                yield "cut", f"rejected {dict(bench.device.rejected)}, with valid frames {how}"
        return
    bench = case.started()
    bench.read(RUN)
    frames = list({content(frame): frame for frame in bench.emitted[-50:]}.values())
    bench.is_deaf = True
    bench.read(2 * TICK)
    for frame in frames:
        data = content(frame)
        for length in {0, len(data) // 2, len(data) - 1} - {len(data), -1}:
            before = dict(bench.device.samples)
            try:
                bench.read(TICK, with_data(frame, data[:length]))
            except Violation as violation:
                seen = f"{violation.seen}, after {length} of {len(data)} bytes of a frame"
                yield violation.rule, seen
                return
            if bench.device.samples != before:
                yield "truncated", f"{length} of {len(data)} bytes of a frame gave a sample"
                return


def content(frame: Frame) -> bytes:
    """Return the data of a frame."""
    return bytes(frame.data) if isinstance(frame, can.Message) else bytes(frame)


def with_data(frame: Frame, data: bytes) -> Frame:
    """Return a frame with other data."""
    if not isinstance(frame, can.Message):
        return data
    return can.Message(
        arbitration_id=frame.arbitration_id,
        is_extended_id=frame.is_extended_id,
        is_fd=frame.is_fd,
        data=data,
        check=False,
    )


NOISE = bytes.fromhex("00ff 0d0a 5aa5 7f80 c3c3 fe01 2020 00")
"""Bytes between frames."""


def check_noise(case: Case) -> Iterator[tuple[str, str]]:
    """Check that the driver finds the frames after noise on a serial line."""
    if not isinstance(case.make_device(), SerialDevice | SharedSerialDevice):
        return
    bench = case.started()
    count = 0

    def noisy(frames: Sequence[bytes]) -> list[bytes]:
        nonlocal count
        count += len(frames)
        noise = NOISE[count % len(NOISE) :]
        return [b"".join(noise + frame for frame in frames)] if frames else [noise]

    bench.pieces = noisy
    bench.read(RUN)
    bench.pieces = lambda frames: [b"".join(frames)]
    before = bench.time
    bench.read(OLDEST)
    if bench.newest() < before:
        yield "noise", f"no sample of every signal in {OLDEST:g} s after noise"


def check_old_frames(case: Case) -> Iterator[tuple[str, str]]:
    """Check that a repeated frame is harmless, and that old or repeated datagrams give no sample.

    Only datagrams arrive in another order. Datagrams that are equal have no counter.
    """
    bench = case.started()
    bench.read(RUN)
    bench.is_deaf = True
    bench.read(2 * TICK)
    is_datagram = isinstance(bench.device, DatagramDevice)
    recent = bench.emitted[-10:]
    for which, frame in (("an old", recent[:1]), ("a repeated", recent[-1:])):
        if which == "an old" and not is_datagram:
            continue
        if is_datagram and len({*map(content, recent)}) < len(recent):
            return
        before = dict(bench.device.samples)
        bench.read(TICK, *frame)
        if is_datagram and bench.device.samples != before:
            yield "repeated", f"{which} datagram gave a sample: {content(frame[0]).hex(' ')}"


def check_nan(case: Case) -> Iterator[tuple[str, str]]:
    """Check the samples if the sensor sends NaN, which only some protocols can."""
    bench = case.started()
    bench.emitted.clear()
    bench.sensed.clear()
    bench.values = dict.fromkeys(bench.device.signals(), math.nan)
    before = bench.time
    try:
        bench.read(RUN)
    except Violation as violation:
        if violation.rule != "emulated":  # of a protocol without NaN
            raise
        return
    if not any(nan in content(frame) for frame in bench.emitted for nan in NANS):
        return
    for signal in bench.sensed & bench.device.signals().keys():
        value, then = bench.device.samples[signal]
        if then > before + 0.5 * RUN and math.isfinite(value):
            yield "nan", f"{signal} is {value:g}, although the sensor sends NaN"


def check_second_start(case: Case) -> Iterator[tuple[str, str]]:
    """Check that the driver works again after the rig was closed and opened."""
    bench = case.started()
    bench.read(RUN)
    first = bench.device.rejected.total()
    if isinstance(bench.device, SerialDevice):
        frame = next((f for f in reversed(bench.emitted) if len(f) > 1), b"")
        bench.is_deaf = True
        bench.read(TICK, frame[: len(frame) // 2])
        bench.is_deaf = False
    with bench.during("stop"):
        bench.device.stop()
    bench.advance(5.0)
    bench.restart_emulated()
    before, permitted = bench.time, bench.device.rejected.total() + first
    try:
        bench.start()
        bench.read(RUN)
        bench.read(OLDEST)
    except Violation as violation:
        yield "reset", f"{violation.seen}, after the second start"
        return
    if bench.newest() < before:
        yield "reset", f"no sample of every signal in {OLDEST:g} s after the second start"
    elif bench.device.rejected.total() > permitted:
        seen = f"rejected {dict(bench.device.rejected)}"
        yield "reset", f"{seen} after the second start: data of the session before are left"


def check_stop(case: Case) -> Iterator[tuple[str, str]]:
    """Check that `stop` works without a port, and before and after the port was removed."""
    bench = case.bench()
    with bench.during("stop"):
        bench.device.stop()
    bench = case.started()
    bench.is_gone = True
    for _ in range(2):
        with bench.during("stop"):
            bench.device.stop()
    yield from ()


def check_random_data(case: Case) -> Iterator[tuple[str, str]]:
    """Check that the driver accepts any data."""
    from hypothesis import HealthCheck, given, settings
    from hypothesis import strategies as st

    bench = case.started()
    bench.read(RUN)
    valid = bench.emitted[-20:]
    contents = st.one_of(st.binary(max_size=64), *map(nearly, filter(None, map(content, valid))))
    frames: st.SearchStrategy[Frame] = contents
    if not isinstance(bench.device, SerialDevice | SharedSerialDevice | DatagramDevice):
        identifiers: list[int] = list(bench.device.identifiers())  # type: ignore[attr-defined]
        frames = st.builds(
            any_can_frame, st.sampled_from(identifiers), contents, st.integers(0, 9).map(bool)
        )
    found: list[Violation] = []

    @settings(
        max_examples=EXAMPLES,
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
        report_multiple_bugs=False,
    )
    @given(st.lists(frames, max_size=10))
    def feed(pieces: list[Frame]) -> None:
        bench = case.started()
        try:
            for piece in pieces:
                bench.read(TICK, piece)
        except Violation as violation:
            shown = " | ".join(content(piece).hex(" ") or "(empty)" for piece in pieces)
            found.append(Violation(violation.rule, f"{violation.seen}, after the bytes {shown}"))
            raise AssertionError(violation.rule) from None

    try:
        feed()
    except AssertionError:
        yield found[-1].rule, found[-1].seen


def nearly(data: bytes) -> Any:
    """Return a strategy for frames that differ from a valid one in one byte or in the length."""
    from hypothesis import strategies as st

    def changed(place: int, byte: int, end: int) -> bytes:
        return (data[:place] + bytes([byte]) + data[place + 1 :])[:end]

    place = st.integers(0, len(data) - 1)
    return st.builds(changed, place, st.integers(0, 255), st.integers(1, len(data)))


def any_can_frame(identifier: int, data: bytes, is_data: bool) -> can.Message:
    """Return a CAN frame that a device sends, or a remote frame."""
    return can.Message(
        arbitration_id=identifier & ~EXTENDED,
        is_extended_id=bool(identifier & EXTENDED),
        is_remote_frame=not is_data,
        is_fd=is_data and len(data) > 8,
        data=data if is_data else b"",
        check=False,
    )


def check_enable(case: Case) -> Iterator[tuple[str, str]]:
    """Check that only the drive confirms its operation."""
    for how in ("the request is lost", "no frame of the drive arrives"):
        bench = case.started()
        bench.is_lost = (lambda sent: True) if how.endswith("lost") else (lambda sent: False)
        bench.is_deaf = not how.endswith("lost")
        for _ in range(round(RUN / TICK)):
            if bench.enable():
                yield "confirms", f"enable returned True, although {how}"
                break


def check_command(case: Case) -> Iterator[tuple[str, str]]:
    """Check that the drive gets what `command` returns."""
    bench = case.started()
    operate(bench)
    extreme = () if isinstance(bench.tested, PositionDrive) else (1e6, -1e6)
    for size in (1.0, -1.0, *extreme):
        returned = bench.command(size, 1.0 if not extreme else 0.4)
        does, should = bench.applied(returned)
        if isinstance(bench.tested, PositionDrive):
            is_equal = abs(does - should) < 0.05 * abs(size) * STEP
        else:
            # a drive with a coupling may round the force that it adds to the coupling
            rounding = 0.05 * FORCE if isinstance(bench.tested, ImpedanceDrive) else 1e-9
            is_equal = math.isclose(does, should, rel_tol=1e-4, abs_tol=rounding)
        if not is_equal:
            yield "command", f"command returned {should:g}, but the drive applies {does:g}"
        elif not isinstance(bench.tested, PositionDrive) and does * size <= 0.0:
            yield "command", f"a command of {size:g} times the usual one gives {does:g}"
        if bench.device.error:
            yield "command", f"a command causes the error {bench.device.error!r}"
            return


def requests(bench: Bench) -> Callable[[], int]:
    """Return a function that counts the requests to leave operation from now on."""
    begin = len(bench.sent)
    own = ("receive",) if isinstance(bench.device, SharedSerialDevice) else ("idle",)
    return lambda: sum(sent.method in own for sent in bench.sent[begin:])


def stop(bench: Bench, seconds: float) -> bool:
    """Call `idle` once per tick, as the rig does; return whether the stop was confirmed."""
    for _ in range(round(seconds / TICK)):
        if bench.idle():
            return True
        bench.advance()
        bench.poll()
    return False


def check_idle(case: Case) -> Iterator[tuple[str, str]]:
    """Check a stop and a new start afterwards."""
    bench = case.moving()
    count = requests(bench)
    if bench.idle():
        yield "stopped", "the first call of idle returned True, before a frame could arrive"
    if not count() and not isinstance(bench.device, SharedSerialDevice):
        yield "at once", "the first call of idle sent nothing"
    if not stop(bench, LONGEST_STOP):
        yield "stops", f"idle returned False for {LONGEST_STOP:g} s"
        return
    bench.read(SLACK)  # the drive may decelerate
    if not bench.is_stopped:
        yield "stopped", "idle returned True, but the drive is in operation"
    else:
        operate(bench)
        does = bench.applied(bench.command(1.0, 0.5))[0]
        if not does or bench.is_stopped:
            yield "enables", "after a stop and a new enable, the drive does not follow commands"


def check_unconfirmed_stop(case: Case) -> Iterator[tuple[str, str]]:
    """Check a stop without a connection."""
    bench = case.moving()
    bench.is_deaf, bench.is_lost = True, lambda sent: True
    count = requests(bench)
    if stop(bench, LONGEST_STOP):
        yield "stopped", "idle returned True, although no frame of the drive arrived"
    elif count() < 3:
        yield "repeats", f"{count()} requests in {LONGEST_STOP:g} s without an answer"
    bench.is_deaf, bench.is_lost = False, lambda sent: False
    if not stop(bench, LONGEST_STOP):
        yield "stops", "idle returned False after the connection was restored"


def check_lost_stop(case: Case) -> Iterator[tuple[str, str]]:
    """Check that the watchdog stops the drive if only the requests to stop are lost."""
    bench = case.moving()
    begin, first = len(bench.sent), []

    def is_request(sent: Any) -> bool:
        if not isinstance(bench.device, SharedSerialDevice):
            return bool(sent.method == "idle")
        first.append(content(sent.data))
        return first[0] == content(sent.data)

    bench.is_lost = is_request
    for _ in range(round((case.watchdog + SLACK) / TICK)):
        bench.idle()
        bench.ping()
        bench.advance()
        bench.poll()
    if not bench.is_stopped:
        others = sorted({s.method for s in bench.sent[begin:] if s.method != "idle"})
        by = f", and {', '.join(others)} sent frames" if others else ""
        seen = f"the drive operates {case.watchdog + SLACK:g} s after idle, whose requests are lost"
        yield "feeds", seen + by


def check_watchdog(case: Case) -> Iterator[tuple[str, str]]:
    """Check that the drive stops without commands: if the host does nothing, or only reads."""
    seconds = case.watchdog + SLACK
    bench = case.moving()
    for _ in range(round(seconds / TICK)):
        bench.advance()
    if not bench.is_stopped:
        yield "watchdog", f"the drive operates {seconds:g} s after the last frame"
        return
    bench = case.moving()
    begin = len(bench.sent)
    for _ in range(round(seconds / TICK)):
        bench.advance()
        bench.poll()
        bench.ping()
    if not bench.is_stopped:
        others = sorted({sent.method for sent in bench.sent[begin:]})
        seen = f"the drive operates {seconds:g} s after the last command"
        yield "feeds", f"{seen}, and {', '.join(others)} sent frames"


def check_restart(case: Case) -> Iterator[tuple[str, str]]:
    """Check that a restart of the device in operation is reported, until `rearm`."""
    bench = case.moving()
    if not bench.tested.reports_watchdog:
        return
    bench.restart_emulated()
    end = bench.time + LONGEST_STOP
    while not bench.reported:
        if bench.time > end:
            yield "restart", f"no error in {LONGEST_STOP:g} s after a restart of the device"
            return
        bench.command(1.0, TICK)
    error = bench.reported
    for _ in range(round(RUN / TICK)):
        bench.command(0.0, TICK)
        if not bench.reported:
            yield "latched", f"the error {error!r} ended without rearm"
            return


DEVICE_CHECKS: tuple[Check, ...] = (
    check_clean_frames,
    check_silence,
    check_cut_frames,
    check_noise,
    check_old_frames,
    check_nan,
    check_second_start,
    check_stop,
    check_random_data,
)
DRIVE_CHECKS: tuple[Check, ...] = (
    check_enable,
    check_command,
    check_idle,
    check_unconfirmed_stop,
    check_lost_stop,
    check_watchdog,
    check_restart,
)


def check_device(
    device: Callable[..., Device],
    settings: Mapping[str, Any] | DeviceSettings,
    emulated: Callable[..., Any],
    values: Mapping[str, float] | None = None,
) -> None:
    """Check that a driver follows the rules of a device.

    Parameters
    ----------
    device
        Class of the device.
    settings
        Section of the device in a rig file.
    emulated
        Class of the emulated device; or a function of the time [s] that returns the frames which
        the device sends then, for a device that needs no requests. The time starts at 1000 s and
        advances by at most 1 ms per call.
    values
        Value of some signals that the emulated device measures, in the unit of the signal. The
        driver must report these values, to 1 %.

    Raises
    ------
    AssertionError
        A rule is violated. The message has one line per rule: the rule, what was seen, and the
        section of the documentation.
    """
    run_checks(DEVICE_CHECKS, make_case(device, settings, emulated, values or {}))


def check_drive(
    device: Callable[..., Device],
    settings: Mapping[str, Any] | DeviceSettings,
    emulated: type,
    watchdog: float,
    drive: str = "",
) -> None:
    """Check that a driver follows the rules of a drive.

    Parameters
    ----------
    device
        Class of the device.
    settings
        Section of the device in a rig file.
    emulated
        Class of the emulated device. It must restart with its constructor.
    watchdog
        Watchdog time of the drive [s].
    drive
        Name of the drive. It can be omitted if the device has one drive.

    Raises
    ------
    AssertionError
        A rule is violated. The message has one line per rule, as for `check_device`.
    """
    case = make_case(device, settings, emulated, {}, watchdog)
    found = case.make_device()
    name = sole_drive(found, drive)
    if not name:
        names = ", ".join(found.drives) or "it has none"
        raise AssertionError(f"drive {drive!r}: expected a drive of the device: {names}")
    run_checks(DRIVE_CHECKS, Case(case.make_device, case.make_emulated, {}, name, watchdog))


def make_case(
    device: Callable[..., Device],
    settings: Mapping[str, Any] | DeviceSettings,
    emulated: Callable[..., Any],
    values: Mapping[str, float],
    watchdog: float = math.nan,
) -> Case:
    """Return the driver that is checked, and its emulated device."""
    checked = settings
    if not isinstance(checked, DeviceSettings):
        checked = device.Settings.model_validate(settings)  # type: ignore[attr-defined]
    make_emulated: Callable[[Bench], Emulated] = (
        partial(emulated, "device", checked)
        if isinstance(emulated, type)
        else lambda bench: Sender(emulated)
    )
    return Case(lambda: device("device", checked), make_emulated, values, "", watchdog)


def run_checks(checks: Sequence[Check], case: Case) -> None:
    """Run all checks; raise one AssertionError with all violated rules."""
    problems: dict[str, None] = {}
    for check in checks:
        for name, seen in sleepless(check, case):
            rule = RULES[name]
            problems[f'{rule.text}: {seen} ({PAGE}, "{rule.section}")'] = None
    if problems:
        raise AssertionError("\n".join(problems))


def sleepless(check: Check, case: Case) -> list[tuple[str, str]]:
    """Run a check. A driver that calls `time.sleep` waits in virtual time, or violates a rule."""
    benches: list[Bench] = []
    sleep, thread = time.sleep, get_ident()

    def nap(seconds: float) -> None:
        if get_ident() == thread and benches:
            benches[-1].nap(seconds)
        else:
            sleep(seconds)

    class Watched(Case):
        def bench(self) -> Bench:
            benches.append(super().bench())
            return benches[-1]

    watched = Watched(case.make_device, case.make_emulated, case.values, case.drive, case.watchdog)
    problems: list[tuple[str, str]] = []
    with mock.patch("time.sleep", nap):
        try:
            problems.extend(check(watched))
        except Violation as violation:
            problems.append((violation.rule, violation.seen))
    return problems
