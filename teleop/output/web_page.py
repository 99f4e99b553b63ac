"""Create HTML pages that can be read offline: one file contains all texts and figures."""

from __future__ import annotations

import re
from io import StringIO
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from teleop.output.figure_files import render
from teleop.software import software

COLOURS = {
    "#ffffff": "panel",
    "#000000": "text",
    "#444444": "truth",
    "#555555": "muted",
    "#888888": "muted",
    "#8c8c8c": "muted",
    "#bbbbbb": "grey",
    "#b0b0b0": "grey",
    "#0072b2": "e0",
    "#d55e00": "e1",
    "#009e73": "e2",
    "#cc79a7": "e3",
    "#a8628a": "tissue-line",
    "#cc0000": "limit",
}
"""Colours of the figures, and the variables in the style of a page that replace them."""


def web_page(template: str, package: str = __package__, **values: Any) -> str:
    """Return an HTML page that is created from a jinja2 template of a package.

    A value that is a `str` is escaped. A `Markup` is inserted as HTML.
    """
    loaders = [PackageLoader(package), PackageLoader(__package__)]
    environment = Environment(
        loader=ChoiceLoader(loaders),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["themed"] = themed
    return environment.get_template(template).render(values, software=f"teleop {software()}")


def svg(figure: Figure) -> Markup:
    """Return a figure as an SVG element, which can be inserted into an HTML page."""
    text = StringIO()
    render(figure, text, format="svg")
    drawing = text.getvalue()
    return Markup(drawing[drawing.index("<svg") :])


def themed(drawing: str) -> Markup:
    """Return an SVG element whose colours change with the colours of the page."""

    def variable(found: re.Match[str]) -> str:
        name = COLOURS.get(found[0].lower())
        return f"var(--{name})" if name else found[0]

    return Markup(re.sub(r"#[0-9a-fA-F]{6}\b", variable, drawing))
