"""The files of a trial, which the server of the live page sends to the pages of its session."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path

import pytest

from teleop.live import downloads as module
from teleop.live.downloads import REPORT_POLICY, Downloads
from teleop.live.security import HEADERS

from .live_client import served
from .test_attacks import Quiet, answer, run

SIZE = 40_000_000
"""Size of a recording that no system takes from the server at once [bytes]."""


pytestmark = pytest.mark.real_time


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "größe.mcap"
    path.write_bytes(bytes(range(250)) * (SIZE // 250))
    return path


@pytest.fixture
def offered(tmp_path, recording):
    """The files of a session, and the paths of those of one trial."""
    folder = tmp_path / "files"
    folder.mkdir()
    found = Downloads(folder)
    return found, found.offer(recording)


def get(offered, path, **changes):
    """Return head and body of the response to a request."""
    files, _ = offered

    async def scenario():
        async with served(Quiet(), downloads=files) as (_, address):
            host = changes.get("host", address)
            reader, writer = await asyncio.open_connection(*address.split(":"))
            writer.write(f"GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
            await asyncio.sleep(changes.get("pause", 0.0))
            data = await reader.read()
            writer.close()
            return data

    head, _, body = run(scenario()).partition(b"\r\n\r\n")
    return head.decode(), body


def replaced(monkeypatch, result):
    """Write no file, but return `result`, the problem of a command."""

    async def made(command):
        if not result:
            Path(command[-1]).write_text("<p>a report</p>")
        return result

    monkeypatch.setattr(module, "made", made)


def test_a_recording_arrives_complete_also_if_the_client_reads_late(
    offered, recording, monkeypatch
):
    monkeypatch.setattr("teleop.live.server.GREETING", 0.3)
    head, body = get(offered, offered[1]["recording"], pause=1.0)
    assert head.startswith("HTTP/1.1 200")
    assert "attachment; filename*=UTF-8''gr%C3%B6%C3%9Fe.mcap" in head
    assert body == recording.read_bytes()


def test_each_trial_has_addresses_that_cannot_be_guessed(offered, recording):
    files, paths = offered
    other = files.offer(recording)
    secrets = {re.fullmatch(r"/files/([0-9a-f]{32})/.*", path)[1] for path in paths.values()}
    secrets |= {path.split("/")[2] for path in other.values()}
    assert len(secrets) == 2


def test_without_the_number_of_the_trial_there_is_no_file(offered):
    path = offered[1]["recording"]
    secret, name = path.split("/")[2:]
    for other in (f"/files/{name}", f"/files/{'0' * 32}/{name}", f"/files/{secret}/../{name}"):
        assert get(offered, other)[0].startswith("HTTP/1.1 404")
    assert get(offered, f"/files/{secret}/")[0].startswith("HTTP/1.1 404")
    assert get(offered, path, host="evil.example")[0].startswith("HTTP/1.1 403")


def test_a_report_is_awaited_and_then_shown_without_scripts(offered, monkeypatch):
    replaced(monkeypatch, "")
    files, paths = offered

    async def scenario():
        async with served(Quiet(), downloads=files) as (_, address):
            line = f"Host: {address}"
            first = await answer(address, line, path=paths["report"])
            return first, await answer(address, line, path=paths["report"])

    waiting, report = run(scenario())
    assert "Refresh: 1\r\n" in waiting
    assert "Refresh" not in report
    assert report.endswith("<p>a report</p>")
    assert f"Content-Security-Policy: {REPORT_POLICY}\r\n" in report
    for name, value in HEADERS.items():
        assert f"{name}: {value}\r\n" in waiting
        assert f"{name}: {value}\r\n" in report or name == "Content-Security-Policy"


@pytest.mark.parametrize("name", ["report", "csv"])
def test_the_reason_why_a_file_cannot_be_written_is_sent_as_text(offered, name):
    files, paths = offered

    async def scenario():
        while (page := await files.page(paths[name])).headers == (("Refresh", "1"),):
            await asyncio.sleep(0.05)
        return page

    page = run(scenario())  # the recording is none
    assert page.kind.startswith("text/plain")
    assert b"teleop: " in page.content


def test_a_file_that_is_too_large_is_named(offered, monkeypatch, recording):
    monkeypatch.setattr(module, "LARGEST", SIZE - 1)
    head, body = get(offered, offered[1]["recording"])
    assert "text/plain" in head
    assert str(recording).encode() in body


def test_the_folder_of_a_trial_is_private(offered):
    (folder,) = (offered[0]._folder).iterdir()
    assert folder.stat().st_mode & 0o077 == 0
