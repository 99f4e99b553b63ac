"""Common fixtures; hypothesis runs without deadlines, because the machine may be shared."""

from __future__ import annotations

import compileall
import contextlib
import gc
import hashlib
import os
import pickle
import re
import signal
import subprocess
import sys
from copy import deepcopy
from pathlib import Path

import pytest
from hypothesis import settings

try:
    import fcntl
except ImportError:
    fcntl = None

settings.register_profile("shared machine", deadline=None, max_examples=25)
settings.load_profile("shared machine")

for name in ("SIGINT", "SIGHUP", "SIGQUIT"):
    ending = getattr(signal, name, None)
    if ending and signal.getsignal(ending) is signal.SIG_IGN:  # as set by nohup and scripts
        quits = name == "SIGQUIT"
        signal.signal(ending, signal.SIG_DFL if quits else signal.default_int_handler)

os.environ.pop("COLUMNS", None)  # set by readline for the workers of pytest-xdist
# Threads of a linear-algebra library would compete with the other workers for the two cores.
os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).parents[1]
PARTS = ("condition", "signal", "link", "rig")
# The tests start hundreds of processes, which read this bytecode instead of compiling all modules.
# They write none, since a process whose disk is full would leave a truncated file. Pytest itself
# writes that of the test files, which the next run reads.
if "PYTEST_XDIST_WORKER" not in os.environ:
    for package in ("estimation", "drivers", "sim_backend", "teleop", "telepalpation"):
        compileall.compile_dir(ROOT / package, quiet=1)
os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
sys.dont_write_bytecode = False
gc.set_threshold(50_000)  # the modules and tests of a worker are many objects, and no garbage
gc.unfreeze = lambda: None  # a trial in real time would end what `quick_garbage_collection` does


def pytest_configure(config):
    """Rewrite the assertions of all test files once, before each worker does it for itself.

    In a clean checkout, this takes longer than the rest of the collection.
    """
    if "PYTEST_XDIST_WORKER" in os.environ or not config.getoption("numprocesses", None):
        return
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    child = os.fork() if hasattr(os, "fork") else None
    try:
        rewrite_assertions(config, files if child is None else files[bool(child) :: 2])
    finally:
        if child == 0:
            os._exit(0)
    if child:
        os.waitpid(child, 0)


def rewrite_assertions(config, files):
    """Store the code of test files as pytest does; a pytest without these functions does it."""
    with contextlib.suppress(ImportError, AttributeError, OSError):
        from _pytest.assertion import rewrite

        state = config.stash[rewrite.assertstate_key]
        for file in files:
            stored = rewrite.get_cache_dir(file) / (file.stem + rewrite.PYC_TAIL)
            stored.parent.mkdir(exist_ok=True)
            if rewrite._read_pyc(file, stored) is None:
                source, code = rewrite._rewrite_test(file, config)
                rewrite._write_pyc(state, code, source, stored)


def pytest_collection_modifyitems(items):
    """Begin with the tests in real time: one worker runs them all while the others compute."""
    items.sort(key=computes)


def pytest_runtest_setup(item):
    """Lower the priority of a worker that computes: tests in real time get a processor at once.

    A lower priority than this one would starve the tests beside other programs of the machine.
    """
    if computes(item) and hasattr(os, "nice") and not os.nice(0):
        os.nice(5)


def computes(item):
    """Whether a test does not wait for devices and processes in real time."""
    return item.get_closest_marker("real_time") is None


@pytest.fixture(scope="module", autouse=True)
def quick_garbage_collection():
    """Exempt from garbage collection what earlier files have left: modules, tests, reports."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def pageable_memory():
    """Do not lock the memory of this process, which has mapped much more than a command maps.

    All of it, and everything mapped later, would become resident.
    """
    from teleop.trial.realtime import SET_UP

    SET_UP["locked memory"] = lambda: lambda: None


@pytest.fixture
def interpreted(monkeypatch):
    """Interpret the estimators, where compiling one would take longer than all of its samples."""
    from estimation.compiled import CompilationChoice

    monkeypatch.setattr(CompilationChoice, "is_compiled", lambda choice, samples: False)


class AnalysisByRecord:
    """The function `analyse`, which evaluates a record once although many tests need it.

    The key is the content of the record. The 32 latest results are stored. Each call returns a copy
    of its own, so that a result that a test changes does not reach another test.
    """

    def __init__(self, analyse):
        self._analyse = analyse
        self._results = {}

    def __call__(self, signals, *settings):
        key = hashlib.sha256(pickle.dumps((*signals, *settings))).digest()
        result = self._results.pop(key, None) or self._analyse(signals, *settings)
        self._results[key] = result
        if len(self._results) > 32:
            del self._results[next(iter(self._results))]
        return deepcopy(result)


@pytest.fixture(scope="session", autouse=True)
def analysis_by_record():
    """Store the analyses of commands that run in this process."""
    from teleop.evaluation import evaluate as evaluation

    evaluation.analyse = AnalysisByRecord(evaluation.analyse)


@pytest.fixture(scope="session")
def start_command():
    """Returns `start_command` of forked_command.py, for tests in packages of their own."""
    from .forked_command import start_command

    return start_command


class DocsPage:
    """The blocks of code of a page of the documentation."""

    def __init__(self, name: str) -> None:
        text = (ROOT / "docs" / name).read_text(encoding="utf-8")
        self.python: list[str] = re.findall(r"```python\n(.*?)```", text, re.S)
        self.toml: list[str] = re.findall(r"```toml\n(.*?)```", text, re.S)

    def block(self, *words: str) -> str:
        """The only block of Python with all of these words."""
        (found,) = [code for code in self.python if all(word in code for word in words)]
        return found


@pytest.fixture(scope="session")
def driver_page():
    return DocsPage("writing-a-driver.md")


@pytest.fixture(scope="session")
def estimator_page():
    return DocsPage("writing-an-estimator.md")


@pytest.fixture(scope="session")
def part_pages():
    """The pages that show a package with a part of an experiment, by the name of the part."""
    return {part: DocsPage(f"writing-a-{part}.md") for part in PARTS}


@pytest.fixture(scope="session")
def third_party(estimator_page, part_pages, tmp_path_factory):
    """A folder into which pip has installed a new driver, and the packages of the pages.

    All workers of pytest-xdist use the folder that the first one of them has made.
    """
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    with (folder / "third-party.lock").open("w") as lock:
        if fcntl:
            fcntl.flock(lock, fcntl.LOCK_EX)
        if fcntl and (folder / "third-party").exists():
            return folder / "third-party"
        installed = install_packages(estimator_page, part_pages, tmp_path_factory.mktemp("made"))
        return installed.rename(folder / "third-party") if fcntl else installed


def install_packages(estimator_page, part_pages, folder):
    """Write the packages, and return a folder into which pip has installed them."""
    from teleop.rig.new_driver import write_driver

    write_driver("acme", "serial", "none", folder / "device")
    packages = {
        part: {f"acme_{part}.py": page.python[0], "pyproject.toml": page.toml[0]}
        for part, page in {"estimator": estimator_page, **part_pages}.items()
    }
    for package, files in packages.items():
        (folder / package).mkdir()
        for name, content in files.items():
            (folder / package / name).write_text(content, encoding="utf-8")
    options = "--no-index --no-build-isolation --no-deps --disable-pip-version-check --target"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", *options.split(), folder / "site"]
    done = subprocess.run(
        [*pip, folder / "device", *(folder / package for package in packages)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder / "site"


@contextlib.contextmanager
def packages_found(folder):
    """Let this process find the packages in a folder, as if they were installed."""
    from estimation import registry

    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.syspath_prepend(folder)
        registry.offered.cache_clear()
        yield
    registry.offered.cache_clear()
    for name in ("acme", "acme_emulated", "acme_estimator", *(f"acme_{part}" for part in PARTS)):
        sys.modules.pop(name, None)


@pytest.fixture(scope="session")
def installed():
    """Returns `packages_found`."""
    return packages_found


def undemanding(text: str, rate: int = 125) -> str:
    """Change the text of a rig file for trials in real time on a busy machine.

    The low rate needs less processor time. A pause of up to a tenth of a second stops nothing.
    """
    text = re.sub(r"rate_hz = \d+", f"rate_hz = {rate}", text)
    text = re.sub(r"watchdog_ms = \d+", "watchdog_ms = 100", text)
    text = re.sub(r"max_age_ms = .*\n", "", text)
    return re.sub(r"(\[channels\..*\])", r"\1\nmax_age_ms = 100", text)


@pytest.fixture(scope="session")
def undemanding_rig():
    """Returns a function that copies an example rig file, with `undemanding` content."""

    def copied(name: str, path: Path) -> Path:
        text = (ROOT / "rigs" / f"{name}.toml").read_text(encoding="utf-8")
        path.write_text(undemanding(text), encoding="utf-8")
        return path

    return copied


SENSOR = """\
[buses.tip]
kind = "serial"
port = "/dev/ttyUSB0"
baud_bps = 921600

[devices.tip]
kind = "acme"
bus = "tip"

[channels.contact_force]
device = "tip"
signal = "force"
sign = -1
range_n = [-100, 100]
max_age_ms = 20
frozen_ms = 50
"""
"""Sections of a rig file for the sensor of another package."""


@pytest.fixture(scope="session")
def third_party_rig(tmp_path_factory):
    """The rig file of the serial board with the contact force of another package's sensor.

    The rate is sufficient to measure a lag of 2.7 ms.
    """
    text = (ROOT / "rigs" / "serial-board.toml").read_text(encoding="utf-8")
    head, _, rest = text.partition("[channels.contact_force]")
    _, _, rest = rest.partition("[channels.master_position]")
    path = tmp_path_factory.mktemp("rig") / "rig.toml"
    text = f"{head}{SENSOR}\n[channels.master_position]{rest}"
    path.write_text(undemanding(text, 250))
    return path
