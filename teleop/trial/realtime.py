"""Apply the real-time settings of a process step by step, and revert them at the end.

Several control loops on one machine must not disturb each other. Each process with a control loop
claims one processor for itself, if a processor is free. At least one processor remains unclaimed,
for recorders, kernel drivers and other programs. If no processor is free, the process shares the
unclaimed processors with other programs, and has a lower priority. Control loops that share
processors have different priorities.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
from collections.abc import Callable, Iterable, Iterator
from typing import Self, get_args

from drivers.claims import claim, is_claimed
from teleop.errors import InputError
from teleop.names import RealtimeName

PRIORITY = 80
"""Priority of SCHED_FIFO for a control loop on a claimed processor.

The priority is above that of the interrupt threads (50) and below that of the kernel's watchdogs
(99).
"""
SHARED_PRIORITIES = range(60, 50, -1)
"""Priorities of SCHED_FIFO for control loops on shared processors, one for each process."""
LIVE_PRIORITY = 20
"""Priority of SCHED_FIFO for the live process, which passes STOP and heartbeats to the loop.

The priority is above that of all normal processes, so that a busy machine does not delay STOP, and
does not end a trial because the heartbeat is late. The server limits what it processes.
"""
ESTIMATION_PRIORITY = 10
"""Priority of SCHED_FIFO for the process of the estimation, so that its results are not late on a
busy machine. The process leaves a tenth of its processor to others (`run_reader`)."""
MCL_CURRENT, MCL_FUTURE = 1, 2
"""Flags of mlockall on Linux."""
DONE = "done"
"""Result of a step that was applied."""
FIFO = "SCHED_FIFO"
"""Name of the step that sets the real-time priority."""
PROCESSOR = "one processor"
"""Name of the step that claims a processor."""


def set_priority(process: int, priority: int) -> None:
    """Set the scheduling policy of a process to SCHED_FIFO; child processes do not inherit it."""
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    os.sched_setscheduler(process, policy, os.sched_param(priority))


def set_normal_priority(process: int) -> None:
    """Set the normal scheduling policy of a process, if the process exists."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(process, os.SCHED_OTHER, os.sched_param(0))


def set_fifo_priority(priority: int = PRIORITY) -> Callable[[], object]:
    """Set the scheduling policy of this process to SCHED_FIFO, with the given priority.

    The result is a function that restores the earlier policy.
    """
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    set_priority(0, priority)
    return lambda: os.sched_setscheduler(0, *before)


def set_shared_fifo_priority() -> Callable[[], object]:
    """Set SCHED_FIFO with the highest of the `SHARED_PRIORITIES` that no process has claimed.

    A process calls this function if it shares its processor with other control loops. It claims the
    priority, so that each of these loops has a different priority.
    """
    for priority in SHARED_PRIORITIES:
        if not (taken := claim(f"priority {priority}")):
            continue
        with contextlib.ExitStack() as undo:
            undo.callback(taken.close)
            undo.callback(set_fifo_priority(priority))
            return undo.pop_all().close
    raise OSError("no free priority")


def processor_name(processor: int) -> str:
    """Return the name that a process claims to reserve a processor for itself, see `claim`."""
    return f"processor {processor}"


def claim_processor() -> Callable[[], object]:
    """Claim the free processor with the highest number, and run this process on it only.

    No other teleop process runs on this processor, so that the caches of the processor keep the
    data of the control loop. The processor with the lowest number is never claimed, so that other
    programs can use it.
    """
    before = os.sched_getaffinity(0)
    for processor in sorted(before)[:0:-1]:
        if taken := claim(processor_name(processor)):
            os.sched_setaffinity(0, {processor})
            break
    else:
        raise OSError("no free processor, lower priority on the shared ones")

    def revert() -> None:
        os.sched_setaffinity(0, before)
        taken.close()

    return revert


def lock_memory() -> Callable[[], object]:
    """Lock the memory of the process in RAM, and return a function that unlocks the memory."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE):
        raise PermissionError("the limit of locked memory, memlock, is too low")
    return lambda: libc.munlockall()


def disable_garbage_collection() -> Callable[[], object]:
    """Disable Python's garbage collection, and return a function that enables it again.

    Garbage collection is needed only for objects that refer to each other in a cycle. A tick
    creates no such objects, so that the memory does not grow.
    """
    was_enabled = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()

    def revert() -> None:
        gc.unfreeze()
        if was_enabled:
            gc.enable()

    return revert


SET_UP = {
    "locked memory": lock_memory,
    "no garbage collection": disable_garbage_collection,
    PROCESSOR: claim_processor,
}
"""Slow steps, which are applied at normal priority. The function of a step applies the step, and
returns a function that reverts the step."""
STEPS = (*SET_UP, FIFO)
"""Names of all steps."""


class RealTime:
    """Context manager that applies real-time settings to this process, see `realtime`.

    Attributes
    ----------
    report
        Result of each setting by its name in `STEPS`: `done`, or the reason why it was not applied.
    """

    def __init__(self, mode: RealtimeName, steps: Iterable[str]) -> None:
        self.report: dict[str, str] = {}
        self._mode = mode
        self._steps = tuple(steps) if mode != "off" else ()
        self._undo = contextlib.ExitStack()

    def start(self, live: int | None = None, estimation: int | None = None) -> None:
        """Set the real-time priorities, directly before the control loop starts.

        They are those of this process, and of the live process and the estimation, if they exist.
        """
        if FIFO in self._steps:
            own = self.report.get(PROCESSOR) == DONE
            self._take(FIFO, set_fifo_priority if own else set_shared_fifo_priority)
        if self.report.get(FIFO) == DONE:
            for process, priority in ((live, LIVE_PRIORITY), (estimation, ESTIMATION_PRIORITY)):
                with contextlib.suppress(OSError):
                    if process:
                        set_priority(process, priority)
                        self._undo.callback(set_normal_priority, process)
        missing = [f"{name} ({why})" for name, why in self.report.items() if why != DONE]
        if self._mode == "require" and missing:
            raise InputError(
                f"realtime: {', '.join(missing)}: expected every step to succeed; run as root, "
                "grant rtprio and memlock in /etc/security/limits.conf, end other teleop "
                "processes, or use --realtime try"
            )

    def _take(self, name: str, step: Callable[[], Callable[[], object]]) -> None:
        try:
            self._undo.callback(step())
            self.report[name] = DONE
        except PermissionError:
            self.report[name] = "not permitted"
        except OSError as error:
            self.report[name] = str(error.strerror or error).lower()
        except (AttributeError, TypeError):
            self.report[name] = "not available on this system"

    def __enter__(self) -> Self:
        for name in self._steps:
            if name in SET_UP:
                self._take(name, SET_UP[name])
        return self

    def __exit__(self, *_: object) -> None:
        self._undo.close()


def realtime(mode: RealtimeName, steps: Iterable[str] = STEPS) -> RealTime:
    """Return a context manager that applies real-time settings and reverts them on exit.

    Each setting is one step. On entry, the context manager locks the memory, disables garbage
    collection and claims a processor. These steps are slow. Directly before the control loop, the
    caller sets the real-time priority with `RealTime.start`.
    """
    if mode not in get_args(RealtimeName):
        raise InputError(f"realtime {mode!r}: expected one of {', '.join(get_args(RealtimeName))}")
    return RealTime(mode, steps)


@contextlib.contextmanager
def avoid_claimed_processors() -> Iterator[None]:
    """Within a `with` block, run this process only on processors that no process has claimed.

    A process claims a processor for its control loop. This process then does not disturb the loop,
    even if the loop has no real-time priority. If all processors are claimed, nothing changes.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    free = {number for number in before if not is_claimed(processor_name(number))}
    os.sched_setaffinity(0, free or before)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)
