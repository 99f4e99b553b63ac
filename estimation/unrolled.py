"""A step function with its loops over the regressors unrolled.

A step is written once, for any number of regressors, as loops over `range(len(phi))`. Run as it
stands, the interpreter spends most of a sample on counting. Here each such loop becomes its
passes, one after the other, and each index that only depends on the number of regressors becomes
a number: the same operations in the same order, in half the time, interpreted and compiled.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable
from copy import deepcopy
from functools import cache
from types import FunctionType
from typing import Any

Helpers = tuple[Callable[..., Any], ...]
Constants = dict[str, int]


@cache
def unrolled(
    step: Callable[..., Any], helpers: Helpers, regressors: int
) -> tuple[FunctionType, tuple[FunctionType, ...]]:
    """A step and the functions that it calls, unrolled for a number of regressors.

    Parameters
    ----------
    step
        A function of a module, with an argument `phi`.
    helpers
        Functions that it calls, each after those that it calls itself. Those without an
        argument `phi` stay as they are.
    regressors
        Length of `phi`.
    """
    known: dict[str, Any] = {}
    for function in (*helpers, step):
        known[function.__name__] = _unroll(function, known, regressors)
    return known[step.__name__], tuple(known[helper.__name__] for helper in helpers)


def _unroll(
    function: Callable[..., Any], known: dict[str, Any], regressors: int
) -> Callable[..., Any]:
    if "phi" not in inspect.signature(function).parameters:
        return function
    lines, first = inspect.getsourcelines(function)
    tree = ast.parse(textwrap.dedent("".join(lines)))
    ast.increment_lineno(tree, first - 1)  # a traceback shows the line that was written
    definition = tree.body[0]
    assert isinstance(definition, ast.FunctionDef)
    definition.returns = None
    for argument in definition.args.args:
        argument.annotation = None
    names = [
        node.id
        for node in ast.walk(definition)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    ]
    once = frozenset(name for name in names if names.count(name) == 1)
    definition.body = _block(definition.body, {}, once, regressors)
    code = compile(tree, inspect.getsourcefile(function) or "<step>", "exec")
    namespace = {**inspect.unwrap(function).__globals__, **known}
    exec(code, namespace)
    made: Callable[..., Any] = namespace[function.__name__]
    return made


def _block(
    statements: list[ast.stmt], constants: Constants, once: frozenset[str], regressors: int
) -> list[ast.stmt]:
    """The statements with constants put in their places and counted loops written out."""
    out: list[ast.stmt] = []
    put_in = _PutIn(constants, regressors)
    for statement in deepcopy(statements):
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if name in once:
                statement.value = put_in.visit(value)
                number = _integer(statement.value)
                if number is None:
                    out.append(statement)
                else:
                    constants[name] = number
            case ast.For(target=ast.Name(id=name), iter=ast.Call(ast.Name("range"), arguments)):
                bounds = [_integer(put_in.visit(bound)) for bound in arguments]
                counted = [bound for bound in bounds if bound is not None]
                assert len(counted) == len(bounds), f"line {statement.lineno}: no constant range"
                for count in range(*counted):
                    out += _block(statement.body, {**constants, name: count}, once, regressors)
            case ast.If() | ast.While():
                statement.test = put_in.visit(statement.test)
                statement.body = _block(statement.body, constants, once, regressors)
                statement.orelse = _block(statement.orelse, constants, once, regressors)
                if statement.body:
                    out.append(statement)
            case _:
                out.append(put_in.visit(statement))
    return out


class _PutIn(ast.NodeTransformer):
    """Puts constants and the number of regressors in their places."""

    def __init__(self, constants: Constants, regressors: int) -> None:
        self._constants = constants
        self._regressors = regressors

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """A name that stands for a number."""
        if isinstance(node.ctx, ast.Load) and node.id in self._constants:
            return ast.copy_location(ast.Constant(self._constants[node.id]), node)
        return node

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """`len(phi)`."""
        if ast.unparse(node) == "len(phi)":
            return ast.copy_location(ast.Constant(self._regressors), node)
        self.generic_visit(node)
        return node


def _integer(expression: ast.expr) -> int | None:
    """The value of an expression of integers; None for any other."""
    allowed = ast.Constant | ast.BinOp | ast.operator
    nodes = list(ast.walk(expression))
    if not all(isinstance(node, allowed) for node in nodes):
        return None
    if not all(isinstance(node.value, int) for node in nodes if isinstance(node, ast.Constant)):
        return None
    value: int = eval(compile(ast.Expression(expression), "<index>", "eval"), {})
    return value if isinstance(value, int) else None
