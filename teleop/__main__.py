"""`teleop`, and `python -m teleop`."""

from __future__ import annotations


def main() -> int:
    """Run the command line; Ctrl-C ends it without a traceback at any time.

    Once the command has ended, Ctrl-C is ignored: its exit code stands.
    """
    import signal

    try:
        from teleop.cli import main as command_line

        code = command_line()
    except KeyboardInterrupt:
        code = 130
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return code


if __name__ == "__main__":
    raise SystemExit(main())
