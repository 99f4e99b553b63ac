"""`teleop live`: replay a recording in a page of the browser."""

from __future__ import annotations

from pathlib import Path


def live(
    file: Path,
    /,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    open: bool = False,  # noqa: A002
) -> int:
    """Replay a recording in a web page, until the command is stopped with Ctrl-C.

    The command prints the address of the page. By default, only a browser on this machine can open
    the page. `teleop run --live` shows a running trial in such a page.

    Example: `teleop live trial.mcap --open`

    Parameters
    ----------
    file
        Recording of teleop run (.mcap).
    host
        Network address at which the page is served. With an address other than the default, other
        machines can connect, without encryption.
    port
        Port of the page; 0 for any free port.
    open
        Open the page in the browser.
    """
    import asyncio
    from threading import Thread

    from teleop.commands.live_options import check_installed, show_address
    from teleop.errors import InputError
    from teleop.interruption import stop_signals
    from teleop.recording.recording import load
    from teleop.trial.live_documents import (
        column_documents,
        recorded_document,
        recorded_result,
    )

    check_installed()
    from teleop.live.replay import Replay
    from teleop.live.server import serve

    recording = load(file)
    if not len(recording):
        raise InputError(f"{file}: expected a recording with at least one tick")
    replay = Replay(
        recording.columns,
        column_documents(recording.units),
        recording.estimators,
        recording.events,
        recorded_document(recording),
    )
    # The page is open before the evaluation, which can take some seconds, has ended.
    Thread(target=lambda: replay.publish(recorded_result(recording, file)), daemon=True).start()
    with stop_signals() as stopped:
        asyncio.run(serve(stopped, replay, host, port, lambda url: show_address(url, host, open)))
    return 0
