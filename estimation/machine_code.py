"""Compile functions with numba, and store the compiled code on disk for later processes.

If the environment variable `NUMBA_CACHE_DIR` is set, it is the folder of the compiled code.
Otherwise numba stores the compiled code beside the source. If that folder is read-only, numba uses
the user's cache folder.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from types import FunctionType
from typing import Any


def machine_code(function: FunctionType) -> Callable[..., Any]:
    """Return a compiled function. If the cache cannot be written, each process compiles it again.

    Parameters
    ----------
    function
        The function. Its qualified name identifies it in the cache. The name must therefore change
        when the source of the function, or of a function that it calls, changes.
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
    """Return a compiled function that can be called only by other compiled functions.

    It has no wrappers for other callers. Wrappers would need a quarter of the compilation time.
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
    """Print a message about the compilation, once per process and only to a terminal."""
    if sys.stderr and sys.stderr.isatty():
        print("compiling estimators; later runs use the compiled code", file=sys.stderr)
