"""Compilation with numba, whose result is stored on disk for later processes.

numba stores compiled code in the folder `NUMBA_CACHE_DIR` if that variable is set, else beside the
source, else, if the installation cannot be written, in the user's cache folder.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from types import FunctionType
from typing import Any


def machine_code(function: FunctionType) -> Callable[..., Any]:
    """Return a compiled function; it is compiled in every process if no cache can be written.

    Parameters
    ----------
    function
        The function. Its qualified name identifies it in the cache, and therefore has to change
        with the source of the function and of all functions that it calls.
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
    """Return a compiled function that only compiled functions call.

    It has no wrappers for other callers, which take a quarter of the time of the compilation.
    """
    import numba

    njit: Any = numba.njit
    return njit(error_model="numpy", no_cfunc_wrapper=True, no_cpython_wrapper=True)(function)


def is_stored(compiled: Any) -> bool:
    """Return whether the machine code of a compiled function is in the cache."""
    folder = compiled.stats.cache_path
    return bool(folder) and any(Path(folder).glob(f"*{compiled.__qualname__}*.nbi"))


@cache
def announce() -> None:
    """Print that code is compiled, once per process and only to a terminal."""
    if sys.stderr and sys.stderr.isatty():
        print("compiling estimators; later runs use the compiled code", file=sys.stderr)
