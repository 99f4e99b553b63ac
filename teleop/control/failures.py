"""What a tick raised, for a fault of the supervisor and for the report at the end."""

from __future__ import annotations

from teleop.printable import one_line


def failure(error: BaseException) -> tuple[str, Exception]:
    """The text of a failure on one line, and the exception to report.

    SystemExit and other exceptions outside `Exception` would end the program before anything is
    reported, SystemExit even with the exit code of a success. They are reported as RuntimeError.

    Parameters
    ----------
    error
        What was raised.
    """
    name = type(error).__name__
    try:
        message = one_line(str(error))
    except Exception:
        message = "its message cannot be shown"
    text = f"{name}: {message}" if message else name
    if isinstance(error, Exception):
        return text, error
    exception = RuntimeError(f"unexpected {text}")
    exception.__cause__ = error
    return text, exception
