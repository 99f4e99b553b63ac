"""`teleop`, and `python -m teleop`."""

from __future__ import annotations


def main() -> int:
    """Run the command line; Ctrl-C while it is still being loaded ends it quietly too."""
    try:
        from teleop.cli import main as command_line

        return command_line()
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    raise SystemExit(main())
