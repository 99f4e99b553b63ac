"""Compile functions with numba, and store the compiled code on disk for later processes.

The environment variable `NUMBA_CACHE_DIR` sets the folder of the compiled code. If it is not set,
numba stores the compiled code in the folder of the source code. If the folder of the source code is
read-only, numba uses the user's cache folder.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from types import FunctionType
from typing import Any


def machine_code(function: FunctionType) -> Callable[..., Any]:
    """Compile a function with numba, or load its compiled code from disk; return it.

    If numba finds no folder in which it can store the compiled code, each process compiles the
    function again.

    Parameters
    ----------
    function
        The function. On disk, numba finds the compiled code by the qualified name of the function.
        If the source of the function changes, or of a function that it calls, the caller must
        therefore give the function a new name. Otherwise numba may load the old code.
    """
    import numba

    njit: Any = partial(numba.njit, error_model="numpy", no_cfunc_wrapper=True)
    try:
        compiled = njit(cache=True)(function)
    except RuntimeError:  # numba has found no folder for its cache
        compiled = njit()(function)
    if not is_stored(compiled):
        announce()
    result: Callable[..., Any] = compiled
    return result


def called_by_machine_code(function: FunctionType) -> Any:
    """Compile a function that only other compiled functions call; return it.

    Usually numba also compiles wrappers, which are needed for calls from Python or C. They would
    need a quarter of the compilation time, so they are left out.
    """
    import numba

    njit: Any = numba.njit
    return njit(error_model="numpy", no_cfunc_wrapper=True, no_cpython_wrapper=True)(function)


def is_stored(compiled: Any) -> bool:
    """Return whether an earlier process has stored the machine code of this function on disk."""
    folder = compiled.stats.cache_path
    return bool(folder) and any(Path(folder).glob(f"*{compiled.__qualname__}*.nbi"))


@cache
def announce() -> None:
    """Print a message that functions are being compiled, at most once per process.

    The message is printed to standard error, and only if this is a terminal.
    """
    if sys.stderr and sys.stderr.isatty():
        print("compiling estimators; later runs use the compiled code", file=sys.stderr)
