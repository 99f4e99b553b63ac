"""The static files of the live page."""

from __future__ import annotations

from importlib.resources import files
from typing import NamedTuple

KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
"""Media types of the files by their ending."""


class Page(NamedTuple):
    """A file that the server sends."""

    kind: str
    """Media type."""
    content: bytes


def read_pages() -> dict[str, Page]:
    """Read all files of the page, and return them by their path on the server.

    No other file can be requested, whatever the path in a request is.
    """
    pages = {}
    folder = files("teleop.live").joinpath("page")
    for file in folder.iterdir() if folder.is_dir() else ():
        ending = "." + file.name.rpartition(".")[2]
        if file.is_file() and ending in KINDS:
            pages[f"/{file.name}"] = Page(KINDS[ending], file.read_bytes())
    for path, name in (("/", "/index.html"), ("/operator", "/operator.html")):
        if name in pages:
            pages[path] = pages[name]
    return pages
