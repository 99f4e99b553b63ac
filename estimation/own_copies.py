"""A copy of a step, with copies of all functions that it calls, of its own.

Several methods call the same functions, such as `correct`, with states of different classes. Both
the interpreter and numba learn the class of an argument from the calls so far, and are slowed or
misled where it changes from call to call: the interpreter repeats the search for each field, and
numba takes a record for another that it begins with. So every step has functions of its own.
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
    """A copy of a function that calls copies of the functions that it calls.

    Parameters
    ----------
    function
        A function that calls others by names of its module.
    finish
        What to make of each copy, such as a compiled function.
    replaced
        Pairs of a global constant and what the copies have in its place.
    """
    done: dict[Callable[..., Any], Any] = {}

    def copied(original: Any) -> Any:
        if original not in done:
            names = used_globals(original)  # few: a small namespace stays in the processor's cache
            called = {name: copied(value) for name, value in calls(original).items()}
            constants = {name: new for old, new in replaced for name in names if names[name] is old}
            copy = FunctionType(
                original.__code__.replace(),  # what the interpreter learns is kept with the code
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
    """The globals that a function uses, by name."""
    known = function.__globals__
    return {name: known[name] for name in names_in(function.__code__) if name in known}


def names_in(code: CodeType) -> set[str]:
    """The names of globals and attributes in a function, and in functions inside of it."""
    inner = (value for value in code.co_consts if isinstance(value, CodeType))
    return set(code.co_names).union(*map(names_in, inner))


def calls(function: Callable[..., Any]) -> dict[str, FunctionType]:
    """The functions that a function calls, by the names that it has for them."""
    used = used_globals(function)
    return {name: value for name, value in used.items() if isinstance(value, FunctionType)}


def called_functions(function: Callable[..., Any]) -> set[Callable[..., Any]]:
    """A function and all that it calls, directly or not."""
    return {function}.union(*(called_functions(value) for value in calls(function).values()))
