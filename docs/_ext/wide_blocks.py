"""State the number of columns of each code block as a class, which determines the size of its font.

A block of at most 110 columns has the class `columns-N`, with N in steps of 10. A wider block has
the class `long-lines`: its lines are broken. See `docs/_static/site.css`.
"""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

STEP = 10
LEAST, MOST = 60, 110


def add_classes(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Add the class to the code blocks of a page."""
    for block in doctree.findall(nodes.literal_block):
        columns = max((len(line) for line in block.astext().splitlines()), default=0)
        step = max(-(-columns // STEP) * STEP, LEAST)
        block["classes"].append(f"columns-{step}" if step <= MOST else "long-lines")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the step."""
    app.connect("doctree-resolved", add_classes)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
