"""Real-time set-up of the control process, step by step, and back again."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
from collections.abc import Callable, Iterable, Iterator
from typing import get_args

from teleop.errors import InputError
from teleop.names import RealtimeName

PRIORITY = 80
"""Of SCHED_FIFO: above interrupt threads (50), below the kernel's watchdogs (99)."""
MCL_CURRENT, MCL_FUTURE = 1, 2
"""Linux's flags of mlockall."""
DONE = "done"


def first_in_first_out() -> Callable[[], object]:
    """SCHED_FIFO: nothing of ordinary priority keeps the loop waiting."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    os.sched_setscheduler(0, policy, os.sched_param(PRIORITY))
    return lambda: os.sched_setscheduler(0, *before)


def one_processor() -> Callable[[], object]:
    """The last processor alone: caches stay warm, the recorder gets the others."""
    before = os.sched_getaffinity(0)
    if len(before) < 2:
        raise OSError("only one processor")
    os.sched_setaffinity(0, {max(before)})
    return lambda: os.sched_setaffinity(0, before)


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


STEPS = {
    "SCHED_FIFO": first_in_first_out,
    "one processor": one_processor,
    "locked memory": locked_memory,
    "no garbage collection": frozen_collector,
}
"""Each takes its effect, and returns what takes it back."""


@contextlib.contextmanager
def realtime(mode: RealtimeName, steps: Iterable[str] = tuple(STEPS)) -> Iterator[dict[str, str]]:
    """Set the process up for real time, and back on exit.

    Parameters
    ----------
    mode
        Whether to insist on every step, to take what can be had, or to leave all as it is.
    steps
        Names of the steps to take.

    Yields
    ------
    dict
        What became of each step: `done`, or why not.

    Raises
    ------
    InputError
        The mode is unknown, or a required step could not be taken.
    """
    if mode not in get_args(RealtimeName):
        raise InputError(f"realtime {mode!r}: expected one of {', '.join(get_args(RealtimeName))}")
    report: dict[str, str] = {}
    with contextlib.ExitStack() as stack:
        for name in steps if mode != "off" else ():
            try:
                stack.callback(STEPS[name]())
                report[name] = DONE
            except PermissionError:
                report[name] = "not permitted"
            except OSError as error:
                report[name] = str(error.strerror or error).lower()
            except (AttributeError, TypeError):
                report[name] = "not there on this system"
        missing = [f"{name} ({why})" for name, why in report.items() if why != DONE]
        if mode == "require" and missing:
            raise InputError(
                f"realtime: {', '.join(missing)}: expected every step to be taken; run as root, "
                "grant rtprio and memlock in /etc/security/limits.conf, or take --realtime try"
            )
        yield report
