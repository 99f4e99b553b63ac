"""Files of the trials of a session that the live page offers: report, recording and CSV."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from teleop.live.security import new_token

LARGEST = 1 << 26
"""Size of the largest file that is sent [bytes]. It is sent from memory."""
LOW_PRIORITY = 10
"""Priority of a process that writes a file, so that it does not delay the other processes."""
TEXT = "text/plain; charset=utf-8"
HTML = "text/html; charset=utf-8"
REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'; sandbox allow-downloads"
)
"""Content security policy of a report: it runs no script, and loads nothing."""
WAITING = (
    b"<!doctype html><html lang='en'><meta charset='utf-8'><title>teleop</title>"
    b"<link rel='stylesheet' href='/page.css'><p>The file is being written. This page shows or "
    b"downloads it as soon as it is ready.</p>"
)
"""Page that a browser loads again until the file is ready."""


class Page(NamedTuple):
    """A file that the server sends to browsers."""

    kind: str
    """Media type of the file."""
    content: bytes
    """Content of the file."""
    headers: tuple[tuple[str, str], ...] = ()
    """Headers of the response that only this file has, or that replace the usual ones."""


@dataclass
class Download:
    """A file that is offered. `command` has the words of the command of teleop that writes it."""

    path: Path
    kind: str
    headers: tuple[tuple[str, str], ...]
    command: tuple[str, ...] = ()
    making: asyncio.Task[str] | None = field(default=None)
    """Task that runs the command, and returns its problem; None before the first request."""


class Downloads:
    """The files of the trials of a session.

    Files that must be made are written to `folder` when a browser first requests them, by another
    process. Each trial has URLs with its own random number, which only the pages receive that have
    sent the token. The token itself permits to control the rig, and is in no URL that is requested.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files: dict[str, Download] = {}

    def offer(self, recording: Path) -> dict[str, str]:
        """Offer the files of a trial, and return the path of the URL of each file, by its name."""
        secret = new_token()
        folder = self._folder / secret
        folder.mkdir(mode=0o700)
        link = folder / recording.name
        link.symlink_to(recording.resolve())
        page, csv = link.with_suffix(".html"), link.with_suffix(".csv")
        offered = {
            "report": Download(
                page,
                HTML,
                (("Content-Security-Policy", REPORT_POLICY),),
                ("report", str(link), "--out", str(page)),
            ),
            "recording": Download(link, "application/octet-stream", attached(link)),
            "csv": Download(csv, TEXT, attached(csv), ("export", str(link), "--out", str(csv))),
        }
        paths = {}
        for name, one in offered.items():
            paths[name] = f"/files/{secret}/{quote(one.path.name, errors='surrogateescape')}"
            self._files[paths[name]] = one
        return paths

    async def page(self, path: str) -> Page | None:
        """Return the file at the path of a URL, or a page that waits for it; None without one."""
        one = self._files.get(path)
        if one is None:
            return None
        if one.command:
            one.making = one.making or asyncio.create_task(made(one.command))
            if not one.making.done():
                return Page(HTML, WAITING, (("Refresh", "1"),))
            if problem := one.making.result():
                return Page(TEXT, f"{problem}\n".encode(errors="replace"))
        try:
            if one.path.stat().st_size > LARGEST:
                text = f"{one.path.name} is larger than {LARGEST >> 20} MB, and must be copied"
                return Page(TEXT, f"{text} from {one.path.resolve()}\n".encode(errors="replace"))
            return Page(one.kind, await asyncio.to_thread(one.path.read_bytes), one.headers)
        except OSError as error:
            return Page(TEXT, f"{one.path.name}: {error.strerror}\n".encode(errors="replace"))


def attached(path: Path) -> tuple[tuple[str, str], ...]:
    """Return the header with which a browser stores a file instead of showing it."""
    name = quote(path.name, errors="surrogateescape")
    return (("Content-Disposition", f"attachment; filename*=UTF-8''{name}"),)


async def made(command: tuple[str, ...]) -> str:
    """Run a command of teleop in another process; return its problem, empty after success."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        *("-P", "-m", "teleop", *command),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, process.pid, LOW_PRIORITY)
        _, problem = await process.communicate()
    finally:
        if process.returncode is None:
            process.kill()
    lines = problem.decode(errors="replace").strip().splitlines() or ["no file was written"]
    return lines[-1] if process.returncode else ""
