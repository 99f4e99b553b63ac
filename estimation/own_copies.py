"""Copy a function, and all functions that it calls, so that the copies run faster.

A step is the function with which an estimation method processes one sample. The steps of several
methods call the same functions, for example `correct`, but with objects of different classes. Two
problems would occur if all steps shared these functions:

- Python optimises a function for the classes of the arguments in previous calls. If the class
  changes from call to call, the function becomes slower.
- numba compiles a function for the types of its arguments. It confuses two record types if one
  record starts with the same fields as the other.

So each step has its own copies of the functions that it calls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import CodeType, FunctionType
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


def own_copy(
    function: F,
    finish: Callable[[FunctionType], Any] = lambda copy: copy,
    replaced: Sequence[tuple[Any, Any]] = (),
) -> F:
    """Return a copy of a function. The functions that the copy calls are also copies.

    Parameters
    ----------
    function
        The function to copy. It must call other functions by global names of its module.
    finish
        Function that is applied to each copy, for example a compiler. The result of `finish` is
        used instead of the copy.
    replaced
        Pairs (old, new). If the function uses the global object `old`, its copy uses `new` instead.
    """
    done: dict[Callable[..., Any], Any] = {}

    def copied(original: Any) -> Any:
        if original not in done:
            names = used_globals(original)  # few globals fit into the processor's cache
            called = {name: copied(value) for name, value in calls(original).items()}
            constants = {name: new for old, new in replaced for name in names if names[name] is old}
            copy = FunctionType(
                original.__code__.replace(),  # the interpreter specialises this copy only
                {"__name__": original.__module__, **names, **called, **constants},
                original.__name__,
                original.__defaults__,
                original.__closure__,
            )
            done[original] = finish(copy)
        return done[original]

    made: F = copied(function)
    return made


def used_globals(function: Callable[..., Any]) -> dict[str, Any]:
    """Return the objects that a function uses as globals of its module, by their global names."""
    known = function.__globals__
    return {name: known[name] for name in names_in(function.__code__) if name in known}


def names_in(code: CodeType) -> set[str]:
    """Return the names of all globals and attributes in a code object.

    The result includes the names in functions that are defined inside this code.
    """
    inner = (value for value in code.co_consts if isinstance(value, CodeType))
    return set(code.co_names).union(*map(names_in, inner))


def calls(function: Callable[..., Any]) -> dict[str, FunctionType]:
    """Return the functions that a function uses as globals of its module, by their global names."""
    used = used_globals(function)
    return {name: value for name, value in used.items() if isinstance(value, FunctionType)}


def called_functions(function: Callable[..., Any]) -> set[Callable[..., Any]]:
    """Return a set: the function itself, and all functions that it calls directly or indirectly."""
    return {function}.union(*(called_functions(value) for value in calls(function).values()))
