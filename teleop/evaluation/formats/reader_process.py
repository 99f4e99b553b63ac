"""Read a file with a foreign library in a process of its own, with limits of memory and time.

    python -m teleop.evaluation.formats.reader_process

A damaged or malicious file can crash the library of its format, let it wait forever, or let it
request any amount of memory. Only the reader process then ends, and the file is reported in one
line. The process is started anew instead of forked, so that it behaves the same on every system,
and also in a program with threads. It starts in about 0.15 s, because it imports no estimator.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from drivers.posix import is_posix, posix_module
from teleop.errors import InputError, reason
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.table import Pick, Table, reading
from teleop.recording.mcap_checks import machine_memory

SHORTEST_LIMIT = 60.0
"""Time limit for a small file [s]."""
SLOWEST = 1e5
"""Rate at which the slowest library reads a large file [bytes/s]. It is that of ROS messages."""
LEAST_MEMORY = 2 << 30
"""Smallest memory limit [bytes]. The libraries need up to 1 GB of address space themselves."""
EXPANSION = 1000
"""Bytes of memory per byte of the file. No compression makes measured values smaller than this."""
GRACE = 5.0
"""Time after its time limit at which a reader ends itself, if nothing else has ended it [s]."""


class Request(NamedTuple):
    """What the reader process is to read, and its limits."""

    module: str
    """Name of the module in this package that reads the format."""
    what: str
    """Name of the format, for messages."""
    path: Path
    pick: Pick
    """Function that returns the columns to load. It must be picklable."""
    wanted: Wanted
    memory: int
    """Memory limit [bytes]."""
    seconds: float
    """Time limit [s]."""


def memory_limit(size: int) -> int:
    """Return the memory limit of a reader process [bytes] for a file of a given size [bytes].

    It is at most half of the memory of this machine, because the tables are copied to this process.
    """
    half = max(machine_memory() // 2, LEAST_MEMORY)
    return min(half, LEAST_MEMORY + EXPANSION * size)


def time_limit(size: int) -> float:
    """Return the time limit [s] for a file of a given size [bytes]."""
    return SHORTEST_LIMIT + size / SLOWEST


def size_of(path: Path) -> int:
    """Return the size of a file, or of the files in a folder [bytes]."""
    return sum(f.stat().st_size for f in path.iterdir()) if path.is_dir() else path.stat().st_size


def read_apart(module: str, what: str, path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """Read a file with `module.read` in a process of its own, and return the tables."""
    size = size_of(path)
    request = Request(module, what, path, pick, wanted, memory_limit(size), time_limit(size))
    refused = f"{path}: cannot be read as {what}:"
    try:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # for example, how Rust describes a crash
            start_new_session=is_posix(),  # Ctrl-C reaches it through this process
        )
    except OSError as error:
        raise InputError(
            f"{refused} the reader process cannot be started: {reason(error)}"
        ) from error
    assert process.stdin
    assert process.stdout
    timer = threading.Timer(request.seconds, process.kill)
    timer.daemon = True
    started = time.monotonic()
    try:
        timer.start()
        with contextlib.suppress(BrokenPipeError):
            pickle.dump(request, process.stdin)
            process.stdin.flush()
        result: list[Table] | Exception = pickle.load(process.stdout)
    except (EOFError, pickle.UnpicklingError) as error:
        code = process.wait()
        if time.monotonic() - started >= request.seconds:
            raise InputError(f"{refused} not done after {request.seconds:.0f} s") from error
        raise InputError(
            f"{refused} the reader ended with {ending(code)}; "
            f"it may use {gibibytes(request.memory)} of memory"
        ) from error
    except MemoryError as error:
        raise InputError(f"{refused} its columns need more memory than is available") from error
    finally:
        timer.cancel()
        process.kill()
        with contextlib.suppress(BrokenPipeError):
            process.stdin.close()
        process.stdout.close()
        process.wait()
    if isinstance(result, Exception):
        raise result
    return result


def ending(code: int) -> str:
    """Return how a process ended, from its exit code, such as `SIGABRT`."""
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"exit code {code}"


def gibibytes(size: int) -> str:
    """Return a size [bytes] as text in GiB."""
    return f"{size / (1 << 30):.1f} GiB"


def set_limits(memory: int, seconds: float) -> None:
    """Limit the memory [bytes] and the time [s] of this process, as far as the system can do so."""
    if resource := posix_module("resource"):
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # a crash is expected here
            resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    if hasattr(signal, "alarm"):
        signal.alarm(int(seconds + GRACE))


def end_with_parent() -> None:
    """Wait until standard input ends, because the parent process has ended, and end this process.

    The parent process keeps its end of the pipe open, and the system closes it even after SIGKILL.
    """
    os.read(0, 1)  # not through `sys.stdin`, whose lock would be held when Python ends
    os._exit(1)


def result_of(request: Request) -> list[Table] | Exception:
    """Read the file, and return its tables, or the exception to raise in the parent process."""
    try:
        with reading(request.path, request.what):
            module = import_module(f"{__package__}.{request.module}")
            tables: list[Table] = module.read(request.path, request.pick, request.wanted)
    except MemoryError:
        limit = f"more memory than {gibibytes(request.memory)}"
        return InputError(f"{request.path}: cannot be read as {request.what}: it needs {limit}")
    except (InputError, OSError) as error:
        return error
    return tables


def main() -> None:
    """Run the reader process: read one file, and write the result to standard output."""
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is not part of the result
    request: Request = pickle.load(sys.stdin.buffer)
    threading.Thread(target=end_with_parent, daemon=True).start()
    set_limits(request.memory, request.seconds)
    result: Any = result_of(request)
    with output:
        pickle.dump(result, output, protocol=pickle.HIGHEST_PROTOCOL)


if __name__ == "__main__":
    main()
