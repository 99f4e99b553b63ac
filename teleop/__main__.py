"""Entry point of `teleop` and `python -m teleop`."""

from __future__ import annotations

LATER_COLLECTION = 200_000
"""Number of new objects after which the garbage collection starts."""


def main() -> int:
    """Run the command line, and return its exit code.

    Ctrl-C ends the command without a traceback. After the command has ended, Ctrl-C is ignored, so
    that the exit code does not change. Linear algebra uses one thread, unless the environment
    variable OMP_NUM_THREADS sets another number of threads. Because the matrices are small, more
    threads would use more processor time, but would not be faster.

    The garbage collection examines all objects again and again while modules are imported, although
    imports leave no garbage: about 0.15 s of a short command. It therefore starts later.
    """
    import gc
    import os
    import signal
    import sys

    gc.set_threshold(LATER_COLLECTION)
    os.environ.setdefault("OMP_NUM_THREADS", "1")

    try:
        from teleop.cli import main as command_line

        code = command_line()
    except KeyboardInterrupt:
        code = 130
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except OSError:  # a closed terminal: at its exit, Python would change the exit code
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return code


if __name__ == "__main__":
    raise SystemExit(main())
