"""The live process, which serves the live page separately from the control process.

    python -m teleop.live.process

Standard input has one JSON document per line: first a description of the session, then messages
about the trials. When it ends, the control process has ended. On standard output, the live process
sends the address of the page, or the text of a problem, and then the requests of the page that the
control process carries out between two trials.
"""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path

from teleop.errors import InputError
from teleop.live.cells import CellWriter
from teleop.live.downloads import Downloads
from teleop.live.server import serve
from teleop.live.trial_feed import TrialFeed
from teleop.streams.control_pipe import FAREWELL, ControlPipe
from teleop.streams.shared_file import SharedFile


async def main(folder: Path) -> None:
    """Serve the live page until the control process has ended.

    The files that the page offers are written to the empty folder `folder`.
    """
    pipe = ControlPipe()
    try:
        session = pipe.read_line()
    except EOFError:  # the control process has ended before the first trial
        return
    cells = SharedFile.open(Path(session["cells"]), writable=True)
    downloads = Downloads(folder)
    feed = TrialFeed(CellWriter(cells.buffer), session["welcome"], pipe.send, downloads.offer)
    pipe.stop_waiting()

    def has_ended() -> bool:
        is_last = pipe.ended > 0.0  # no message arrives after the end: these are the last ones
        for message in pipe.messages():
            feed.receive(message)
        feed.gone = is_last
        return is_last

    try:
        await serve(
            has_ended,
            feed,
            session["host"],
            session["port"],
            lambda url: pipe.send({"url": url}),
            FAREWELL,
            downloads,
        )
    except InputError as error:
        pipe.send({"problem": str(error)})


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="teleop-") as made:
        asyncio.run(main(Path(made)))
