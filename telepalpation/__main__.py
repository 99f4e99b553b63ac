"""Entry point of the commands `teleop` and `telepalpation`."""

from __future__ import annotations

import sys

from telepalpation import package_problem


def main() -> int:
    """Run the command line of `teleop`, if its packages are those of this distribution."""
    if problem := package_problem():
        print(f"teleop: {problem}", file=sys.stderr)
        return 2
    from teleop.__main__ import main as command_line

    return command_line()


if __name__ == "__main__":
    raise SystemExit(main())
