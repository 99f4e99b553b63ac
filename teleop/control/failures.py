"""Describe an exception of a tick by a text, and choose the exception that the trial raises."""

from __future__ import annotations

from teleop.printable import one_line


def failure(error: BaseException) -> tuple[str, Exception]:
    """Return a text that describes an exception, and the exception to raise after the trial.

    Some exceptions do not derive from `Exception`, for example SystemExit. They would end the
    program without a message, and SystemExit could even cause exit code 0 (success). Such an
    exception is therefore replaced by a RuntimeError.

    Parameters
    ----------
    error
        The exception that was raised in a tick of the control loop.

    Returns
    -------
    text
        Type and message of the exception, on one line.
    exception
        `error` itself, or a RuntimeError if `error` does not derive from `Exception`.
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
