"""Directives for the commands and the Python code of a page, which the build runs.

    {run}          commands, each after `$ `, with a backslash before a line that continues one;
                   runs them and shows what they print
    {run-python}   Python code; runs it and shows what it prints
    {computed}     Python code that is not shown; what it prints becomes part of the page
    {commands} KIND    commands that the build does not run: KIND is `hardware` (needs a rig),
                   `emulator` (run in real time by tests/test_site.py), `setup` or `long`

The blocks of a page run in order, in a folder of the page's own that has links to `rigs` and to
the measured data, and the Python blocks of a page share their names. A command or a block that
fails is a warning, which ends a build with `-W`.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

from teleop.cli import main

ROOT = Path(__file__).parents[2]
LINKS = {"rigs": "rigs", "data": "examples/data/mach1"}
"""Links in the folder of a page, and the folders of the repository that they lead to."""
WIDTH = 88
"""Columns for the output of commands."""
CONTINUATION = re.compile(r" \\\n *")
"""Break within a command: a backslash at the end of a line."""
CONTINUED = re.compile(r"(?<! \\)\n")
"""Break between two commands."""
KINDS = ("hardware", "emulator", "setup", "long")


class Failure(ExtensionError):
    """A block of a page failed."""


class Page:
    """Where the blocks of one page run, and what they share."""

    def __init__(self, folder: Path) -> None:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for name, target in LINKS.items():
            (folder / name).symlink_to(ROOT / target)
        self.folder = folder
        self.names: dict[str, Any] = {"__name__": "__page__"}

    @contextlib.contextmanager
    def entered(self) -> Iterator[tuple[io.StringIO, io.StringIO]]:
        """Run in the folder of the page, with standard output and error caught."""
        out, err = io.StringIO(), io.StringIO()
        columns = os.environ.get("COLUMNS")
        os.environ["COLUMNS"] = str(WIDTH)
        try:
            with (
                contextlib.chdir(self.folder),
                contextlib.redirect_stdout(out),
                contextlib.redirect_stderr(err),
            ):
                yield out, err
        finally:
            os.environ.pop("COLUMNS")
            if columns is not None:
                os.environ["COLUMNS"] = columns

    def command(self, line: str, further: list[str], expected: int) -> str:
        """Run a command; return what it printed.

        Raises
        ------
        Failure
            Its exit code is not the expected one.
        """
        name, *arguments = shlex.split(line)
        with self.entered() as (out, err):
            if name == "teleop":
                code = main([*arguments, *further])
            else:
                done = subprocess.run(line, shell=True, capture_output=True, text=True, check=False)
                code = done.returncode
                out.write(done.stdout)
                err.write(done.stderr)
        if code != expected:
            raise Failure(f"{line}: exit code {code}, expected {expected}: {err.getvalue()}")
        printed = out.getvalue() if code == 0 else out.getvalue() + err.getvalue()
        lines = [text.rstrip() for text in printed.splitlines()]
        return "\n".join(lines).strip("\n")

    def python(self, code: str, source: str) -> str:
        """Run Python code; return what it printed.

        Raises
        ------
        Failure
            It raised an exception.
        """
        with self.entered() as (out, _):
            try:
                exec(compile(code, source, "exec"), self.names)
            except Exception as error:
                raise Failure(f"{source}: {traceback.format_exc(limit=-2)}") from error
        return out.getvalue().rstrip("\n")


PAGES: dict[str, Page] = {}


def forget(app: Sphinx, env: Any, docname: str) -> None:
    """Let the page run from its start when it is read again."""
    PAGES.pop(docname, None)


class Block(SphinxDirective):
    """What the directives share: the page, its figures, and how a failure is reported."""

    has_content = True

    def page(self) -> Page:
        """Return the page that the block stands on."""
        name = self.env.docname
        if name not in PAGES:
            PAGES[name] = Page(Path(self.env.app.doctreedir) / "pages" / name)
        return PAGES[name]

    def failed(self, failure: Failure) -> list[nodes.Node]:
        """Return the warning."""
        return [self.state.document.reporter.warning(str(failure), line=self.lineno)]

    def figure(self) -> list[nodes.Node]:
        """Return the figure that the block drew, as an image of the site."""
        if "figure" not in self.options:
            return []
        drawn = self.page().folder / self.options["figure"]
        name = f"{self.env.docname}-{drawn.name}".replace("/", "-")
        folder = Path(self.env.srcdir) / "generated" / "figures"
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(drawn, folder / name)
        image = nodes.image(uri=f"/generated/figures/{name}", alt=self.options["alt"])
        return [nodes.figure("", image, align="center")]


def code_block(text: str, language: str, *classes: str) -> nodes.literal_block:
    """Return a block of code or of output."""
    return nodes.literal_block(text, text, language=language, classes=list(classes))


class Run(Block):
    """Commands that the build runs."""

    option_spec: ClassVar[dict[str, Any]] = {
        "with": directives.unchanged,
        "exit": directives.nonnegative_int,
        "silent": directives.flag,
        "hidden": directives.flag,
        "head": directives.positive_int,
        "tail": directives.positive_int,
        "figure": directives.unchanged,
        "alt": directives.unchanged,
    }

    def run(self) -> list[nodes.Node]:
        """Run each command and show it with its output."""
        shown: list[str] = []
        further = shlex.split(self.options.get("with", ""))
        for typed in CONTINUED.split("\n".join(self.content)):
            shown.append(typed)
            command = CONTINUATION.sub(" ", typed.removeprefix("$ "))
            try:
                printed = self.page().command(command, further, self.options.get("exit", 0))
            except Failure as failure:
                return self.failed(failure)
            if "silent" not in self.options and printed:
                shown += self.part(printed.splitlines())
        if "hidden" in self.options:
            return self.figure()
        return [code_block("\n".join(shown), "console"), *self.figure()]

    def part(self, lines: list[str]) -> list[str]:
        """Return the first or last lines, if only these are asked for."""
        if "head" in self.options:
            return [*lines[: self.options["head"]], "..."]
        if "tail" in self.options:
            return ["...", *lines[-self.options["tail"] :]]
        return lines


class RunPython(Block):
    """Python code that the build runs."""

    option_spec: ClassVar[dict[str, Any]] = {
        "figure": directives.unchanged,
        "alt": directives.unchanged,
    }

    def run(self) -> list[nodes.Node]:
        """Run the code and show it with its output."""
        code = "\n".join(self.content)
        try:
            printed = self.page().python(code, f"{self.env.docname}.md")
        except Failure as failure:
            return self.failed(failure)
        blocks: list[nodes.Node] = [code_block(code, "python")]
        if printed:
            blocks.append(code_block(printed, "text", "printed"))
        return [*blocks, *self.figure()]


class Computed(Block):
    """Python code that writes a part of the page, in Markdown."""

    def run(self) -> list[nodes.Node]:
        """Run the code and parse what it prints."""
        try:
            printed = self.page().python("\n".join(self.content), f"{self.env.docname}.md")
        except Failure as failure:
            return self.failed(failure)
        container = nodes.container()
        source = self.get_source_info()[0]
        self.state.nested_parse(StringList(printed.splitlines(), source), 0, container)
        return container.children


class Commands(Block):
    """Commands that the build does not run."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Show the commands."""
        kind = self.arguments[0]
        if kind not in KINDS:
            raise self.error(f"kind {kind!r}: expected one of {', '.join(KINDS)}")
        return [code_block("\n".join(self.content), "console")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directives."""
    for name, directive in {
        "run": Run,
        "run-python": RunPython,
        "computed": Computed,
        "commands": Commands,
    }.items():
        app.add_directive(name, directive)
    app.connect("env-purge-doc", forget)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
