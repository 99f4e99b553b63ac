"""Describe an exception of a tick by a text, and choose the exception that the trial raises."""

from __future__ import annotations

from teleop.printable import one_line


def failure(error: BaseException) -> tuple[str, Exception]:
    """Return an exception as one line of text, and the exception to raise after the trial.

    An exception that does not derive from `Exception`, for example SystemExit, is replaced by a
    RuntimeError. It would end the program without a message, and SystemExit even with exit code 0
    (success).
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
