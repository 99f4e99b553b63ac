"""Run trials on a rig from Python and from notebooks: `teleop.Rig`.

`Rig.run` runs a trial in this process, and returns its result. `Rig.start` runs it in another
process, so that a notebook can show live samples, call functions and stop the trial without
delaying the control loop.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from importlib import import_module
from multiprocessing.connection import Connection
from multiprocessing.util import Finalize
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drivers import RigError
from teleop.control.conditions import Condition
from teleop.errors import InputError
from teleop.names import RealtimeName
from teleop.recording.new_recording import new_recording
from teleop.recording.recording import Recording, load
from teleop.settings.custom_class import CustomClass, described, stated_part
from teleop.settings.plug_ins import is_plug_in
from teleop.settings.protocol_files import load_protocol
from teleop.settings.rig_loading import load_rig_file
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.stream import Stream, StreamReader, columns_of
from teleop.trial.arming import arming_text
from teleop.trial.assembly import make_layout
from teleop.trial.result import Trial
from teleop.trial.run import run_trial

if TYPE_CHECKING:
    from estimation.arrays import Floats

Ask = Callable[[str], bool]
"""Function that shows a text to a person and returns whether the person arms the drives."""
POLL = 0.05
"""Time between two looks for new samples [s]."""
GUARD = 'in a script, expected trials within `if __name__ == "__main__":`'
NOT_ARMED = "expected arm=teleop.ask, or another function that asks a person to arm the drives"


def ask(text: str) -> bool:
    """Show a text and ask a person to arm the drives, in a terminal or in a notebook.

    Parameters
    ----------
    text
        What will move, and how it is stopped.

    Returns
    -------
    bool
        Whether the person has typed `arm`.
    """
    print(text)
    return input("Type arm to arm the drives, anything else to cancel: ").strip() == "arm"


class Rig:
    """A rig on which trials are run: a hardware rig, a rig of another package, or a simulated one.

    `Rig()` is the simulated rig. See `load` and `named` for the others.
    """

    def __init__(self, **settings: Any) -> None:
        self._settings = settings

    @classmethod
    def load(cls, path: Path | str) -> Rig:
        """Return the rig that a rig file (TOML) describes.

        Parameters
        ----------
        path
            Path of the rig file.

        Raises
        ------
        InputError
            The file cannot be read, or is not a valid rig file.
        """
        return cls(rig=load_rig_file(Path(path)))

    @classmethod
    def named(cls, name: str, **parameters: Any) -> Rig:
        """Return the rig that an installed package provides under a name.

        Parameters
        ----------
        name
            Name of the rig, see `teleop list rigs`.
        **parameters
            Parameters of the rig.

        Raises
        ------
        InputError
            No installed package has this rig, or a parameter is invalid.
        """
        return cls(custom_rig=stated_part("rig", CustomClass(name, parameters=parameters)))

    def settings(
        self,
        condition: str | None = None,
        protocol: str | None = None,
        parameters: Mapping[str, Any] | None = None,
        **settings: Any,
    ) -> TrialSettings:
        """Return the settings of a trial on this rig.

        Parameters
        ----------
        condition
            Name of the control condition, of this package or of another one.
        protocol
            Name or file of a protocol that replaces the condition.
        parameters
            Parameters of a condition of another package.
        **settings
            Other settings, see `TrialSettings`. The rate is that of the rig file by default.

        Raises
        ------
        InputError
            A setting is unknown or invalid. The message has one line for each problem.
        """
        if protocol:
            read = load_protocol(protocol)
            settings = {"duration": read.longest, **settings, "protocol": read}
        if not (condition is None or isinstance(condition, str)):
            raise InputError(
                f"condition {condition!r}: expected the name of a condition, or in Rig.run an "
                "object of a class derived from teleop.Condition"
            )
        if condition and is_plug_in("condition", condition):
            if "custom_condition" in settings:
                raise InputError("custom_condition: beside a name: expected parameters={...}")
            stated = CustomClass(condition, parameters=parameters or {})
            settings["custom_condition"] = stated_part("condition", stated)
        elif parameters:
            raise InputError(
                "parameters: expected the name of a condition of another package, got "
                f"{condition!r}"
            )
        elif condition:
            settings["condition"] = condition
        return TrialSettings(**{**self._settings, **settings})

    def run(
        self,
        condition: str | Condition | None = None,
        *,
        arm: Ask | None = None,
        record: Path | str | None = None,
        realtime: RealtimeName = "off",
        show: bool = False,
        **settings: Any,
    ) -> Trial:
        """Run a trial in this process until its end, and return its result.

        In a notebook, interrupting the kernel stops the drives, as Ctrl-C does in a terminal.

        Parameters
        ----------
        condition
            Name of the control condition, or an object of a class derived from `Condition`.
        arm
            Function that asks a person to arm the drives, such as `teleop.ask`. Needed unless
            nothing real moves.
        record
            File of the recording (.mcap); None to keep the samples in memory.
        realtime
            Real-time settings of the process: require, try or off.
        show
            Whether to show a progress line.
        **settings
            Settings of the trial, see `settings`.

        Returns
        -------
        Trial
            Result of the trial.

        Raises
        ------
        InputError
            A setting is invalid, or nobody has armed the drives.
        RigError
            The rig cannot be opened, or a device fails before the drives are armed.
        """
        check_main()
        custom = condition if isinstance(condition, Condition) else None
        name: Any = None if custom else condition
        if custom is not None and custom.moved_by == "injector":
            name = "autonomous"  # no simulated hand
        stated = self.settings(name, **settings)
        shown = replace(stated, custom_condition=described(custom)) if custom else stated
        return run_trial(
            stated,
            Path(record) if record else None,
            show=show,
            real=realtime,
            condition=custom,
            arm=is_armed(shown, arm),
        )

    def start(
        self,
        condition: str | Condition | None = None,
        *,
        arm: Ask | None = None,
        record: Path | str | None = None,
        realtime: RealtimeName = "try",
        **settings: Any,
    ) -> RunningTrial:
        """Start a trial in another process, and return at once.

        A script must call this function within `if __name__ == "__main__":`, because the other
        process imports the script. A notebook needs nothing.

        Parameters
        ----------
        condition
            Name of the control condition. An object cannot be sent to another process.
        arm
            Function that asks a person to arm the drives, such as `teleop.ask`. Needed unless
            nothing real moves.
        record
            File of the recording (.mcap). Default: a new file in the folder `recordings`.
        realtime
            Real-time settings of the other process: require, try or off.
        **settings
            Settings of the trial, see `settings`.

        Returns
        -------
        RunningTrial
            The running trial. In a notebook, it is displayed with a button that stops the drives.

        Raises
        ------
        InputError
            A setting is invalid, the condition is an object, or nobody has armed the drives.
        """
        check_main()
        if isinstance(condition, Condition):
            raise InputError(
                f"condition {type(condition).__name__}: an object is not sent to another process: "
                "expected the name of a condition, or Rig.run"
            )
        stated = self.settings(condition, **settings)
        armed = is_armed(stated, arm)
        path = Path(record) if record else new_recording(stated.condition_name, stated.palpated)
        return RunningTrial(stated, path, armed, realtime, overwrite=record is None)


def check_main() -> None:
    """Check that this process does not import the script that has started it.

    It would run the trials of the script again.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise InputError(f"the process of a trial imports this script: {GUARD}")


def is_armed(settings: TrialSettings, arm: Ask | None) -> bool:
    """Return whether the drives may move: a person was asked, or nothing real moves."""
    if not settings.needs_arming:
        return True
    if not callable(arm):
        raise InputError(f"rig {settings.rig_name!r}: nobody has armed the drives: {NOT_ARMED}")
    if arm(arming_text(settings)) is not True:
        raise InputError(f"rig {settings.rig_name!r}: not armed: nothing was moved")
    return True


class Announcement:
    """Sends the description of the stream of a trial to the process that has started it."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def begin(self, settings: TrialSettings, stream: Stream) -> None:
        """Send the description, before the first tick."""
        self._connection.send(("stream", stream.document))

    def end_trial(self) -> None:
        """Send nothing: the result follows."""


def perform(
    settings: TrialSettings,
    path: Path,
    armed: bool,
    realtime: RealtimeName,
    overwrite: bool,
    connection: Connection,
) -> None:
    """Run a trial in this process, and send its summary or its error to the other process.

    Any message of the other process stops the drives, and so does its end.
    """
    # a process that a script starts in the background ignores SIGINT, and so would this one
    signal.signal(signal.SIGINT, signal.default_int_handler)
    thread = threading.Thread(target=stop_on_message, args=(connection,), daemon=True)
    thread.start()
    viewers = [Announcement(connection)]
    real = realtime if settings.clock == "real" else "off"
    try:
        trial = run_trial(
            settings, path, real=real, overwrite=overwrite, arm=armed, viewers=viewers
        )
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # nothing moves any more
        summary = {**trial.summary(), **trial.result.summary}
        connection.send(("done", summary))
    except KeyboardInterrupt:
        connection.send(("failed", "interrupted before the drives were armed"))
    except (InputError, RigError) as error:
        connection.send(("failed", str(error)))
    except Exception as error:
        connection.send(("failed", f"{type(error).__name__}: {error}"))


def stop_on_message(connection: Connection) -> None:
    """Stop as Ctrl-C does, at each message and at the end of the other process."""
    is_open = True
    while is_open:
        try:
            connection.recv()
        except (EOFError, OSError):
            is_open = False
        signal.raise_signal(signal.SIGINT)


RUNNING: set[RunningTrial] = set()
"""Trials that run in other processes."""


class RunningTrial:
    """A trial that runs in another process.

    Attributes
    ----------
    settings
        Settings of the trial.
    path
        File of the recording.
    """

    def __init__(
        self,
        settings: TrialSettings,
        path: Path,
        armed: bool,
        realtime: RealtimeName,
        overwrite: bool,
    ) -> None:
        self.settings, self.path = settings, path
        bank = settings.estimation_preset.bank()
        self._names = [column.name for column in make_layout(settings, bank).schema.columns]
        self._stream: StreamReader | None = None
        self._connection, other = multiprocessing.Pipe()
        arguments = (settings, path, armed, realtime, overwrite, other)
        context = multiprocessing.get_context("spawn")
        self._process = context.Process(target=perform, args=arguments, daemon=False)
        self._answer: tuple[str, Any] | None = None
        self._callbacks: list[threading.Thread] = []
        self._lock = threading.Lock()
        self._process.start()
        other.close()
        # the end of this process, or of the last reference to this object, must stop the drives
        RUNNING.add(self)
        self._at_exit = Finalize(None, self.stop, exitpriority=100)

    @property
    def is_running(self) -> bool:
        """Whether the trial is running."""
        self._receive(0.0)
        return self._answer is None and self._process.is_alive()

    def stop(self) -> None:
        """Stop the drives: the slave decelerates to rest, and the trial ends."""
        with contextlib.suppress(OSError):
            self._connection.send("stop")

    def samples(self, seconds: float = 2.0) -> dict[str, Floats]:
        """Return the latest samples, without waiting.

        Parameters
        ----------
        seconds
            Length of the part before the newest sample [s], at most 40 s.

        Returns
        -------
        samples
            Columns of the recording by name, each of shape (n,). n is 0 before the first tick.
        """
        stream = self._opened()
        if not stream:
            return {name: np.empty(0) for name in self._names}
        newest = stream.ticks.newest
        count = max(int(seconds * self.settings.loop_rate), 1)
        return stream.columns(max(newest - count + 1, 1), newest + 1)

    def on_samples(
        self, function: Callable[[dict[str, Floats]], object], period: float = 0.1
    ) -> None:
        """Call a function with the new samples, again and again while the trial runs.

        The function runs in a thread of this process. If it is slow, it misses samples; it cannot
        delay the control loop. An exception ends the calls, and is raised by `wait`.

        Parameters
        ----------
        function
            Receives the columns of the recording by name, each of shape (n,).
        period
            Time between two calls [s].
        """
        thread = Caller(self, function, period)
        self._callbacks.append(thread)
        thread.start()

    def wait(self, timeout: float | None = None) -> FinishedTrial:
        """Wait for the end of the trial, and return its result.

        Parameters
        ----------
        timeout
            Longest time to wait [s]; None to wait until the end.

        Raises
        ------
        TimeoutError
            The trial is still running.
        InputError
            The trial could not run. The message states why.
        """
        if not self._receive(timeout):
            raise TimeoutError(f"the trial is still running after {timeout:g} s")
        self._process.join()
        for thread in self._callbacks:
            thread.join()
            if isinstance(thread, Caller) and (error := thread.error):
                thread.error = None  # the next call returns the result
                raise error
        assert self._answer
        kind, value = self._answer
        if kind == "failed":
            raise InputError(value)
        return FinishedTrial(self.path, value)

    def _receive(self, timeout: float | None) -> bool:
        """Wait for the answer of the other process; return whether it has answered."""
        with self._lock:
            end = math.inf if timeout is None else time.monotonic() + timeout
            while self._answer is None:
                try:
                    left = None if math.isinf(end) else max(end - time.monotonic(), 0.0)
                    if not self._connection.poll(left):
                        break
                    kind, value = self._connection.recv()
                except (EOFError, OSError):
                    self._process.join()
                    code = self._process.exitcode
                    text = f"the process of the trial ended with code {code}; {GUARD}"
                    kind, value = "failed", text
                if kind == "stream":
                    with contextlib.suppress(OSError):  # the trial has ended already
                        self._stream = StreamReader.open(value, "python")
                else:
                    self._answer = kind, value
            if self._answer is not None:
                RUNNING.discard(self)
                self._at_exit.cancel()
            return self._answer is not None

    def _opened(self) -> StreamReader | None:
        """Return the reader of the trial's stream; None before the trial has begun."""
        if self._stream is None and self._lock.acquire(blocking=False):
            self._lock.release()
            self._receive(0.0)
        return self._stream

    def _ipython_display_(self) -> None:
        """Show the trial in a notebook, with a button that stops the drives."""
        show_with_button(self)

    def __repr__(self) -> str:
        state = "running" if self.is_running else "ended"
        return f"<trial, {self.settings.condition_name}, {self.path}, {state}>"


class Caller(threading.Thread):
    """Calls a function with the new samples of a running trial."""

    def __init__(
        self, trial: RunningTrial, function: Callable[[dict[str, Floats]], object], period: float
    ) -> None:
        super().__init__(daemon=True)
        self._trial, self._function, self._period = trial, function, period
        self.error: Exception | None = None

    def run(self) -> None:
        """Call the function until the trial has ended."""
        for samples in self._blocks():
            try:
                self._function(samples)
            except Exception as error:
                self.error = error
                return

    def _blocks(self) -> Iterator[dict[str, Floats]]:
        """Yield the samples since the last call; older ones than the ring holds are missed."""
        while True:
            running = self._trial._process.is_alive()
            if stream := self._trial._opened():
                while batch := stream.read():
                    if len(batch.rows):
                        yield columns_of(stream.schema, batch.rows)
            if not running:
                return
            time.sleep(max(self._period, POLL))


class FinishedTrial:
    """Result of a trial that ran in another process.

    Attributes
    ----------
    path
        File of the recording.
    summary
        The document that `teleop run --json` prints.
    """

    def __init__(self, path: Path, summary: dict[str, Any]) -> None:
        self.path, self.summary = path, summary

    @property
    def recording(self) -> Recording:
        """All samples, read from the file."""
        return load(self.path)

    @property
    def result(self) -> dict[str, Any]:
        """Stiffness and damping for publication, with their intervals or the reasons against."""
        found: dict[str, Any] = self.summary["result"]
        return found

    def __repr__(self) -> str:
        k, b = (self.result[name] for name in ("k", "b"))
        texts = [
            "k not determined" if k is None else f"k = {k:.4g} N/m",
            "b not determined" if b is None else f"b = {b:.3g} N s/m",
        ]
        return f"<trial, {', '.join(texts)}, {self.path}>"


def show_with_button(trial: RunningTrial) -> None:
    """Display a running trial in a notebook: with ipywidgets a button, otherwise a text."""
    display = import_module("IPython.display").display  # only a notebook calls this function
    try:
        ipywidgets = import_module("ipywidgets")
    except ImportError:
        print(f"{trial!r}: stop() stops the drives (a button needs the package ipywidgets)")
        return
    button = ipywidgets.Button(description="STOP", button_style="danger")
    button.on_click(lambda _: trial.stop())
    display(ipywidgets.HBox([button, ipywidgets.Label(repr(trial))]))
