"""Real-time set-up of a process, step by step, and back again.

Several processes on one machine must not disturb each other. Each takes a processor of its own
while there are free ones, and one processor always remains for everything else: recorders,
drivers of the kernel, other programs. A process that finds no free processor shares the remaining
ones at a lower priority, the lower the later it came.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
from collections.abc import Callable, Iterable, Iterator
from typing import Self, get_args

from teleop.errors import InputError
from teleop.names import RealtimeName
from teleop.trial.processor_claims import claim, is_claimed

PRIORITY = 80
"""Of SCHED_FIFO on a processor of its own: above interrupt threads (50), below the kernel's
watchdogs (99)."""
SHARED_PRIORITIES = range(60, 50, -1)
"""Of SCHED_FIFO on shared processors, each for one process."""
RECORDER_PRIORITY = 40
"""Of the process that reads the loop's pipe: above all of ordinary priority. The kernel locks a
pipe while it is read: a reader that waits for a processor meanwhile would hold up the loop. Below
all loops, since compressing takes longer than their periods."""
MCL_CURRENT, MCL_FUTURE = 1, 2
"""Linux's flags of mlockall."""
DONE = "done"
FIFO = "SCHED_FIFO"
PROCESSOR = "one processor"


def set_priority(process: int, priority: int) -> None:
    """Give a process, 0 for this one, a priority of SCHED_FIFO that its children do not inherit."""
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    os.sched_setscheduler(process, policy, os.sched_param(priority))


def first_in_first_out(priority: int = PRIORITY) -> Callable[[], object]:
    """SCHED_FIFO: nothing of ordinary priority keeps the loop waiting."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    set_priority(0, priority)
    return lambda: os.sched_setscheduler(0, *before)


def shared_first_in_first_out() -> Callable[[], object]:
    """SCHED_FIFO at the highest priority that no process on the shared processors has."""
    for priority in SHARED_PRIORITIES:
        if not (taken := claim(f"priority {priority}")):
            continue
        with contextlib.ExitStack() as undo:
            undo.callback(taken.close)
            undo.callback(first_in_first_out(priority))
            return undo.pop_all().close
    raise OSError("no free priority")


def processor_name(processor: int) -> str:
    """The name under which a process claims a processor."""
    return f"processor {processor}"


def own_processor() -> Callable[[], object]:
    """The last free processor alone: caches stay warm, and no other process of ours uses it."""
    before = os.sched_getaffinity(0)
    for processor in sorted(before)[:0:-1]:
        if taken := claim(processor_name(processor)):
            os.sched_setaffinity(0, {processor})
            break
    else:
        raise OSError("no free processor, lower priority on the shared ones")

    def back() -> None:
        os.sched_setaffinity(0, before)
        taken.close()

    return back


def locked_memory() -> Callable[[], object]:
    """Memory that is never paged out."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE):
        raise PermissionError("the limit of locked memory, memlock, is too low")
    return lambda: libc.munlockall()


def frozen_collector() -> Callable[[], object]:
    """No garbage collection: what is there is set aside, and a tick leaves no cycles."""
    was_enabled = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()

    def back() -> None:
        gc.unfreeze()
        if was_enabled:
            gc.enable()

    return back


SET_UP = {
    "locked memory": locked_memory,
    "no garbage collection": frozen_collector,
    PROCESSOR: own_processor,
}
"""Steps that are taken at once: slow, at ordinary priority. Each returns what takes it back."""
STEPS = (*SET_UP, FIFO)


class RealTime:
    """The real-time set-up of this process; see `realtime`.

    Attributes
    ----------
    report
        For each step taken so far: `done`, or why not.
    """

    def __init__(self, mode: RealtimeName, steps: Iterable[str]) -> None:
        self.report: dict[str, str] = {}
        self._mode = mode
        self._steps = tuple(steps) if mode != "off" else ()
        self._undo = contextlib.ExitStack()

    def start(self, recorder: int | None = None) -> None:
        """Take the real-time priority: from here on only the loop is to run.

        Parameters
        ----------
        recorder
            Process that reads what the loop writes to its pipe; it gets `RECORDER_PRIORITY`.

        Raises
        ------
        InputError
            A required step could not be taken.
        """
        if FIFO in self._steps:
            own = self.report.get(PROCESSOR) == DONE
            self._take(FIFO, first_in_first_out if own else shared_first_in_first_out)
        if recorder and self.report.get(FIFO) == DONE:
            with contextlib.suppress(OSError):
                set_priority(recorder, RECORDER_PRIORITY)
        missing = [f"{name} ({why})" for name, why in self.report.items() if why != DONE]
        if self._mode == "require" and missing:
            raise InputError(
                f"realtime: {', '.join(missing)}: expected every step to be taken; run as root, "
                "grant rtprio and memlock in /etc/security/limits.conf, end other teleop "
                "processes, or take --realtime try"
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
            self.report[name] = "not there on this system"

    def __enter__(self) -> Self:
        for name in self._steps:
            if name in SET_UP:
                self._take(name, SET_UP[name])
        return self

    def __exit__(self, *_: object) -> None:
        self._undo.close()


def realtime(mode: RealtimeName, steps: Iterable[str] = STEPS) -> RealTime:
    """Set the process up for real time, and back on exit.

    Used as a context manager. On entry the slow steps are taken at ordinary priority; `start`
    takes the real-time priority, once everything is ready for the loop.

    Parameters
    ----------
    mode
        Whether to insist on every step, to take those that the system permits, or to leave all
        as it is.
    steps
        Names of the steps to take, of `STEPS`.

    Raises
    ------
    InputError
        The mode is unknown.
    """
    if mode not in get_args(RealtimeName):
        raise InputError(f"realtime {mode!r}: expected one of {', '.join(get_args(RealtimeName))}")
    return RealTime(mode, steps)


@contextlib.contextmanager
def clear_of_claimed_processors() -> Iterator[None]:
    """Keep this process off the processors that other processes have claimed, within the block.

    Where the real-time priority is not permitted, nothing else protects their loops.
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
