"""A copy of a step, with copies of all functions that it calls, of its own.

Several methods call the same functions, such as `correct`, with states of different classes. Both
the interpreter and numba learn the class of an argument from the calls so far, and are slowed or
misled where it changes from call to call: the interpreter repeats the search for each field, and
numba takes a record for another that it begins with. So every step has functions of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


def own_copy(function: F, finish: Callable[[FunctionType], Any] = lambda copy: copy) -> F:
    """A copy of a function that calls copies of the functions that it calls.

    Parameters
    ----------
    function
        A function that calls others by names of its module.
    finish
        What to make of each copy, such as a compiled function.
    """
    done: dict[Callable[..., Any], Any] = {}

    def copied(original: Any) -> Any:
        if original not in done:
            called = {name: copied(value) for name, value in calls(original).items()}
            copy = FunctionType(
                original.__code__.replace(),  # what the interpreter learns is kept with the code
                {**original.__globals__, **called},
                original.__name__,
                original.__defaults__,
                original.__closure__,
            )
            done[original] = finish(copy)
        return done[original]

    made: F = copied(function)
    return made


def calls(function: Callable[..., Any]) -> dict[str, FunctionType]:
    """The functions that a function calls, by the names that it has for them."""
    found = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    return {name: value for name, value in found.items() if isinstance(value, FunctionType)}


def called_functions(function: Callable[..., Any]) -> set[Callable[..., Any]]:
    """A function and all that it calls, directly or not."""
    return {function}.union(*(called_functions(value) for value in calls(function).values()))
