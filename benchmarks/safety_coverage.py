"""Line coverage of `teleop/safety` and `teleop/control` by their tests, and mutants of the former.

    python benchmarks/safety_coverage.py --every 4 --jobs 2

A mutant is the source with one change: a comparison, an operator, a sign, a constant or a truth
value. The tests of `tests/teleop/safety` should fail for each mutant, otherwise it survives: a test
is missing, or the change has no effect (for example `<` and `<=` of floats that are never equal).
Each mutant is run in a fork of this process, which has imported the libraries but not
`teleop.safety`; cosmic-ray would start Python and pytest for each mutant.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib.abc
import importlib.util
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
SAFETY = ROOT / "teleop" / "safety"
TESTS = "tests/teleop/safety"
SECONDS = 120
"""Time after which the tests of a mutant are killed; a loop that does not end is detected."""

SWAPPED: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
NAMES = {"min": "max", "max": "min", "any": "all", "all": "any"}


class Mutant(NamedTuple):
    """A module with one change."""

    path: Path
    line: int
    change: str
    tree: ast.Module

    def __str__(self) -> str:
        return f"{self.path.name}:{self.line}  {self.change}"


def changed(node: ast.AST) -> ast.AST | None:
    """Return the changed copy of a node; None if no change is defined for it."""
    new = copy.deepcopy(node)
    match new:
        case ast.Compare() if type(new.ops[0]) in SWAPPED:
            new.ops[0] = SWAPPED[type(new.ops[0])]()  # type: ignore[assignment]
        case ast.BinOp() | ast.AugAssign() | ast.BoolOp() if type(new.op) in SWAPPED:
            new.op = SWAPPED[type(new.op)]()  # type: ignore[assignment]
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            return new.operand
        case ast.Call(func=ast.Name(id=name)) if name in NAMES:
            new.func = ast.Name(NAMES[name], ast.Load())
        case ast.Constant(value=bool()):
            new.value = not new.value
        case ast.Constant(value=int() | float()):
            new.value = new.value * 2 or 1
        case ast.If() | ast.IfExp():
            new.test = ast.UnaryOp(ast.Not(), new.test)
        case _:
            return None
    return new


def places(node: ast.AST) -> Iterator[tuple[ast.AST, str, int | None]]:
    """Yield the place (parent, field, index) of each node, without annotations and texts."""
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for i, one in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if isinstance(one, ast.AST) and not isinstance(one, ast.JoinedStr):
                yield node, name, i
                yield from places(one)


def child(parent: ast.AST, name: str, i: int | None) -> ast.AST:
    """Return the node at a place of `places`."""
    value = getattr(parent, name)
    node: ast.AST = value if i is None else value[i]
    return node


def mutants(path: Path) -> Iterator[Mutant]:
    """Yield all mutants of a module."""
    source = path.read_text(encoding="utf-8")
    for n, place in enumerate(places(ast.parse(source))):
        if changed(child(*place)) is None:
            continue
        tree = ast.parse(source)
        parent, name, i = [*places(tree)][n]
        node = child(parent, name, i)
        new = changed(node)
        assert new
        shown = [ast.unparse(one).splitlines()[0] for one in (node, new)]
        if i is None:
            setattr(parent, name, new)
        else:
            getattr(parent, name)[i] = new
        yield Mutant(path, node.lineno, " -> ".join(shown), ast.fix_missing_locations(tree))


class Replaced(SourceFileLoader, importlib.abc.MetaPathFinder):
    """Imports the module of a mutant with its changed code."""

    def __init__(self, mutant: Mutant) -> None:
        parts = mutant.path.relative_to(ROOT).with_suffix("").parts
        super().__init__(".".join(parts).removesuffix(".__init__"), str(mutant.path))
        self._tree = mutant.tree

    def find_spec(self, name: str, *_: object) -> ModuleSpec | None:  # type: ignore[override]
        if name != self.name:
            return None
        return importlib.util.spec_from_file_location(name, self.path, loader=self)

    def get_code(self, fullname: str) -> object:  # type: ignore[override]
        return compile(self._tree, self.path, "exec")


def tests_fail(mutant: Mutant | None) -> int:
    """Run the tests of `teleop/safety` in this process, with a mutant; return 1 if one fails."""
    import pytest

    if mutant:
        sys.meta_path.insert(0, Replaced(mutant))
    options = ["-x", "-q", "-n", "0", "--noconftest", "-p", "no:cacheprovider", "--tb=no"]
    # hypothesis is imported before pytest could rewrite its assertions
    options += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
    with Path(os.devnull).open("w") as null, redirect_stdout(null), redirect_stderr(null):
        return int(pytest.main([*options, TESTS]) != 0)


def fork(mutant: Mutant | None) -> int:
    """Start the tests of a mutant in another process, and return its number."""
    pid = os.fork()
    if pid == 0:
        signal.alarm(SECONDS)
        code = 1
        try:
            code = tests_fail(mutant)
        finally:
            os._exit(code)
    return pid


def survivors(chosen: list[Mutant], jobs: int) -> list[Mutant]:
    """Return the mutants with which all tests pass."""
    running: dict[int, Mutant] = {}
    found, waiting = [], [*reversed(chosen)]
    while running or waiting:
        while waiting and len(running) < jobs:
            mutant = waiting.pop()
            running[fork(mutant)] = mutant
        pid, status = os.wait()
        mutant = running.pop(pid)
        if status == 0:
            found.append(mutant)
            print("survived", mutant, file=sys.stderr)
    return sorted(found, key=lambda mutant: mutant.line)


def coverage_lines() -> Iterator[str]:
    """Yield the line coverage of the modules by the tests of the same folder."""
    for folder in ("safety", "control"):
        measured, tests = f"--source=teleop/{folder}", f"tests/teleop/{folder}"
        run = [sys.executable, "-m", "coverage"]
        subprocess.run(
            [*run, "run", "--branch", measured, "-m", "pytest", "-q", "-n", "0", tests],
            cwd=ROOT,
            check=True,
            stdout=subprocess.DEVNULL,
        )
        report = [*run, "report", "--skip-covered"]
        yield subprocess.run(report, cwd=ROOT, check=True, text=True, capture_output=True).stdout


def main() -> None:
    """Print the coverage and the surviving mutants."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--every", type=int, default=1, help="run each Nth mutant")
    parser.add_argument("--jobs", type=int, default=1, help="number of processes")
    parser.add_argument("--no-coverage", action="store_true", help="run the mutants only")
    options = parser.parse_args()
    os.chdir(ROOT)
    if not options.no_coverage:
        for text in coverage_lines():
            print(text)

    import hypothesis
    import numpy  # noqa: F401

    import drivers  # noqa: F401
    import sim_backend  # noqa: F401

    hypothesis.settings.register_profile(
        "mutants", deadline=None, max_examples=50, derandomize=True, database=None
    )
    hypothesis.settings.load_profile("mutants")
    os.waitpid(first := fork(None), 0)[1] == 0 or sys.exit(f"{TESTS} fails, process {first}")
    print(f"{'module':24} mutants  survived")
    remaining: list[Mutant] = []
    for path in sorted(SAFETY.glob("*.py")):
        chosen = [*mutants(path)][:: options.every]
        found = survivors(chosen, options.jobs)
        remaining += found
        print(f"{path.name:24} {len(chosen):7}  {len(found):8}", flush=True)
    print("\nsurviving mutants")
    for mutant in remaining:
        print(" ", mutant)


if __name__ == "__main__":
    main()
