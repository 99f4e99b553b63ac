"""Convert an exception in a tick to the text of a fault and to the exception that is reported."""

from __future__ import annotations

from teleop.printable import one_line


def failure(error: BaseException) -> tuple[str, Exception]:
    """Return a text that describes an exception, and the exception to raise after the trial.

    SystemExit and other exceptions that do not derive from `Exception` would end the program
    without a message. SystemExit could even cause exit code 0. A RuntimeError therefore replaces
    each such exception.

    Parameters
    ----------
    error
        The exception that was raised in a tick.

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
