"""Create HTML pages that can be read offline: one file contains all texts and figures."""

from __future__ import annotations

from io import StringIO
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from teleop.output.figure_files import render


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
    return environment.get_template(template).render(values)


def svg(figure: Figure) -> Markup:
    """Return a figure as an SVG element, which can be inserted into an HTML page."""
    text = StringIO()
    render(figure, text, format="svg")
    drawing = text.getvalue()
    return Markup(drawing[drawing.index("<svg") :])
