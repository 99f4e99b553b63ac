"""Read the files that make up the live page, such as HTML and scripts."""

from __future__ import annotations

from importlib.resources import files
from typing import NamedTuple

KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
"""Media types of the files, by the ending of the file name."""


class Page(NamedTuple):
    """A file of the live page, such as HTML or a script, which the server sends to browsers."""

    kind: str
    """Media type of the file."""
    content: bytes
    """Content of the file."""


def read_pages() -> dict[str, Page]:
    """Read all files of the live page, and return them by the path of their URL.

    The server sends only these files. No path in a request can select another file.
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
