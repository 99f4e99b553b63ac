"""Commands of teleop in processes of their own, which do not import all modules again.

A new `python -m teleop` needs about 1 s of processor time for its imports. A server in another
process has done these imports, and forks for each command. The command has its own process id,
signals, terminal, folder and environment, as after `python -m teleop`.

A test of the start or of the imports themselves starts a new Python.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import io
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
from pathlib import Path
from subprocess import DEVNULL, PIPE, STDOUT, CompletedProcess, TimeoutExpired

STATUS = struct.Struct("i")
"""The exit status of a command, as `os.waitpid` returns it."""
IMPORTED = (
    "matplotlib.figure",
    "sim_backend.wire.emulator",
    "sim_backend.wire.registry",
    "teleop.evaluation.evaluate",
    "teleop.live.trial_feed",
    "teleop.rig.emulation",
    "teleop.station.connection",
    "teleop.studies.series.conduct",
    "teleop.trial.repeated",
    "teleop.trial.run",
    "teleop.trial.station_waiting",
    "teleop.trial.trial_result",
)
"""Modules that commands import only when they need them."""


# The side of the test


@functools.cache
def server() -> tuple[socket.socket, threading.Lock, subprocess.Popen]:
    """Start the server of this process. It ends when this process ends."""
    ours, its = socket.socketpair()
    with its:
        # -P: the folder of this file also has a folder `drivers`
        command = [sys.executable, "-P", __file__, str(its.fileno())]
        process = subprocess.Popen(command, pass_fds=[its.fileno()], stdin=DEVNULL)
    return ours, threading.Lock(), process


class ForkedCommand:
    """A command that runs, with the methods of `subprocess.Popen` that tests need.

    The default of the streams are those of this process. `terminal` is the file descriptor of a
    terminal, which becomes the streams and the controlling terminal of the command.
    """

    def __init__(
        self,
        *arguments: object,
        stdin=None,
        stdout=None,
        stderr=None,
        terminal=None,
        cwd=None,
        env=None,
        text=True,
    ) -> None:
        self.args = [str(one) for one in arguments]
        self.returncode: int | None = None
        with contextlib.ExitStack() as opened:
            chosen = (stdin, stdout, stderr) if terminal is None else (terminal,) * 3
            streams: list[int] = []
            pipes = []
            for number, stream in enumerate(chosen):
                pipe = None
                if stream == PIPE:
                    read, write = os.pipe()
                    its, ours = (write, read) if number else (read, write)
                    opened.callback(os.close, its)
                    pipe = os.fdopen(ours, ("r" if number else "w") + "b" * (not text))
                elif stream == DEVNULL:
                    its = os.open(os.devnull, os.O_RDWR)
                    opened.callback(os.close, its)
                elif stream == STDOUT:
                    its = streams[1]
                elif stream is None:
                    its = number
                else:
                    its = stream if isinstance(stream, int) else stream.fileno()
                streams.append(its)
                pipes.append(pipe)
            self.stdin, self.stdout, self.stderr = pipes
            self._status, status = os.pipe()
            opened.callback(os.close, status)
            request = {
                "arguments": self.args,
                "folder": str(cwd or Path.cwd()),
                "environment": {**(os.environ if env is None else env)},
                "has_terminal": terminal is not None,
                "nice": os.nice(0),
            }
            connection, lock, _ = server()
            with lock:
                data = json.dumps(request).encode() + b"\n"
                sent = socket.send_fds(connection, [data], [*streams, status])
                connection.sendall(data[sent:])
                self.pid = int(connection.recv(100))

    def __enter__(self):
        return self

    def __exit__(self, *error):
        for stream in (self.stdin, self.stdout, self.stderr):
            if stream:
                stream.close()
        self.wait()

    def poll(self):
        """Return the exit code; None while the command runs."""
        with contextlib.suppress(TimeoutExpired):
            self.wait(0.0)
        return self.returncode

    def wait(self, timeout=None):
        """Wait until the command has ended, and return its exit code."""
        if self.returncode is None:
            if not select.select([self._status], [], [], timeout)[0]:
                raise TimeoutExpired(self.args, timeout)
            (status,) = STATUS.unpack(os.read(self._status, STATUS.size))
            os.close(self._status)
            self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def communicate(self, timeout=None):
        """Wait until the command has ended, and return its output and its errors."""
        found = {}

        def read(name, stream):
            found[name] = stream.read()

        pipes = [(name, getattr(self, name)) for name in ("stdout", "stderr")]
        pipes = [(name, stream) for name, stream in pipes if stream and not stream.closed]
        if self.stdin:
            self.stdin.close()
        threads = [threading.Thread(target=read, args=pipe, daemon=True) for pipe in pipes]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(timeout)
            if thread.is_alive():
                raise TimeoutExpired(self.args, timeout)
        for _, stream in pipes:
            stream.close()
        self.wait(timeout)
        return found.get("stdout"), found.get("stderr")

    def send_signal(self, number):
        """Send a signal, unless the command has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def terminate(self):
        """Send SIGTERM."""
        self.send_signal(signal.SIGTERM)

    def kill(self):
        """Send SIGKILL."""
        self.send_signal(signal.SIGKILL)


def start_command(*arguments: object, terminal=None, text=True, **options):
    """Start a command: a `ForkedCommand`, or a new Python where a fork is not safe."""
    if sys.platform == "linux":
        return ForkedCommand(*arguments, terminal=terminal, text=text, **options)
    if terminal is not None:
        streams = dict.fromkeys(("stdin", "stdout", "stderr"), terminal)
        options |= {**streams, "preexec_fn": lambda: os.login_tty(os.dup(terminal))}
    words = [sys.executable, "-m", "teleop", *map(str, arguments)]
    return subprocess.Popen(words, text=text, **options)


def run_command(*arguments: object, timeout=60.0, **options) -> CompletedProcess:
    """Run a command until its end, without input, and return its exit code and what it prints."""
    options = {"stdin": DEVNULL, "stdout": PIPE, "stderr": PIPE, **options}
    with start_command(*arguments, **options) as command:
        try:
            out, error = command.communicate(timeout)
        finally:
            command.kill()
    return CompletedProcess(arguments, command.returncode, out, error)


# The side of the server


def serve(connection: socket.socket) -> dict | None:
    """Fork for each request, and return the request in the new process; None at the end."""
    read, write = os.pipe()
    os.set_blocking(write, False)
    signal.set_wakeup_fd(write)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    running = {}
    while True:
        ready, _, _ = select.select([connection, read], [], [])
        if read in ready:
            os.read(read, 4096)
            report_ended(running)
        if connection not in ready:
            continue
        data, descriptors, _, _ = socket.recv_fds(connection, 1 << 16, 4)
        if not data:
            return None
        *streams, status = descriptors
        while not data.endswith(b"\n"):
            data += connection.recv(1 << 16)
        request = json.loads(data)
        pid = os.fork()
        if not pid:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            for descriptor in (read, write, status, *running.values()):
                os.close(descriptor)
            connection.close()
            set_up(request, streams)
            return request
        running[pid] = status
        for descriptor in streams:
            os.close(descriptor)
        connection.sendall(str(pid).encode())


def report_ended(running: dict[int, int]) -> None:
    """Write the exit status of each command that has ended."""
    with contextlib.suppress(ChildProcessError):
        while True:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if not pid:
                return
            with contextlib.suppress(BrokenPipeError):
                os.write(running[pid], STATUS.pack(status))
            os.close(running.pop(pid))


def set_up(request: dict, streams: list[int]) -> None:
    """Give this process what a new Python has."""
    if request["has_terminal"]:
        os.login_tty(os.dup(streams[0]))
    else:
        for number, descriptor in enumerate(streams):
            os.dup2(descriptor, number)
    for descriptor in streams:
        os.close(descriptor)
    os.environ.clear()
    os.environ.update(request["environment"])
    is_unbuffered = bool(os.environ.get("PYTHONUNBUFFERED"))
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        unbuffered = is_unbuffered and number > 0
        raw = os.fdopen(number, "wb" if number else "rb", 0 if unbuffered else -1, closefd=False)
        stream = io.TextIOWrapper(
            raw,
            "utf-8",
            "backslashreplace" if number == 2 else "strict",
            line_buffering=number == 2 or os.isatty(number),
            write_through=unbuffered,
        )
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    os.nice(max(request["nice"] - os.nice(0), 0))
    os.chdir(request["folder"])
    further = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    sys.path[:0] = [request["folder"], *(path for path in further if path not in sys.path)]
    sys.argv = ["teleop", *request["arguments"]]


def main() -> int:
    """Serve until the other side has closed the connection, or run the command of a request."""
    import importlib

    gc.disable()
    from teleop.__main__ import main as command_line

    for module in ("teleop.cli", *IMPORTED):
        importlib.import_module(module)
    from teleop.trial.realtime import SET_UP

    # It would copy all memory that the commands share with this process.
    SET_UP["locked memory"] = lambda: lambda: None
    gc.freeze()
    gc.enable()
    if serve(socket.socket(fileno=int(sys.argv[1]))) is None:
        return 0
    return command_line()


if __name__ == "__main__":
    raise SystemExit(main())
