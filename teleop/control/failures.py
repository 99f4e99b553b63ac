"""Exceptions of a tick, as a fault for the supervisor and for the report after the trial."""

from __future__ import annotations

from teleop.printable import one_line


def failure(error: BaseException) -> tuple[str, Exception]:
    """Return the text of a failure on one line, and the exception to report.

    SystemExit and other exceptions that are not an `Exception` would end the program before the
    failure is reported; SystemExit could even give exit code 0. They are reported as
    RuntimeError.

    Parameters
    ----------
    error
        The exception that was raised.
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
