"""Show a progress bar on standard error."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def progress_bar(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a progress bar while the `with` block runs, if standard error is a terminal.

    Yield the function to call with the number of things (`what`) that are done, of `total`.
    """
    import rich.progress as bars
    from rich.console import Console

    columns = (
        bars.TextColumn(what),
        bars.BarColumn(),
        bars.MofNCompleteColumn(),
        bars.TimeRemainingColumn(),
    )
    shown, hidden = Console(stderr=True), not sys.stderr.isatty()
    with bars.Progress(*columns, console=shown, transient=True, disable=hidden) as bar:
        line = bar.add_task(what, total=total)
        yield lambda done: bar.update(line, completed=done)
