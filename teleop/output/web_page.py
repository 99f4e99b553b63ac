"""Self-contained HTML pages: text, tables and figures in one file that opens offline."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.resources import files
from io import StringIO
from string import Template

from matplotlib.figure import Figure

from teleop.output.figures import render


def web_page(title: str, body: str) -> str:
    """A page of this title around a body that is HTML already."""
    template = Template(files(__package__).joinpath("web_page.html").read_text(encoding="utf-8"))
    return template.substitute(title=escape(title), body=body)


def svg(figure: Figure) -> str:
    """A figure as an SVG element."""
    text = StringIO()
    render(figure, text, format="svg")
    drawing = text.getvalue()
    return drawing[drawing.index("<svg") :]


def captioned(drawing: str, caption: str) -> str:
    """An SVG element with a caption below."""
    return f"<figure>{drawing}<figcaption>{escape(caption)}</figcaption></figure>"


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of cells that are HTML already; a cell may bring its own <td>."""
    head = "".join(f"<th>{cell}</th>" for cell in header)
    body = ""
    for row in rows:
        cells = (cell if cell.startswith("<td") else f"<td>{cell}</td>" for cell in row)
        body += "<tr>" + "".join(cells) + "</tr>"
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
