"""Common fixtures; hypothesis runs without deadlines, because the machine may be shared."""

from __future__ import annotations

import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("shared machine", deadline=None, max_examples=50)
settings.load_profile("shared machine")

for ending in (signal.SIGINT, getattr(signal, "SIGHUP", None)):
    if ending and signal.getsignal(ending) is signal.SIG_IGN:  # as set by nohup and scripts
        signal.signal(ending, signal.default_int_handler)

COMPILER = pytest.StashKey[subprocess.Popen]()


def pytest_collection_modifyitems(items):
    """Run the tests of compiled code last, when it has been compiled."""
    items.sort(key=lambda item: "compiled_estimators" in item.fixturenames)


def pytest_collection_finish(session):
    """Compile the estimators in another process during the other tests."""
    wanted = any(item.path.name == "test_contract.py" for item in session.items)
    if wanted and find_spec("numba") and not session.config.option.collectonly:
        script = Path(__file__).parent / "estimation" / "compile_all.py"
        session.config.stash[COMPILER] = subprocess.Popen([sys.executable, script])


def pytest_sessionfinish(session):
    """End the process that compiles."""
    if process := session.config.stash.get(COMPILER, None):
        process.terminate()
        process.wait()


@pytest.fixture(scope="session")
def compiled_estimators(request):
    """Wait until every estimator has been compiled."""
    if process := request.config.stash.get(COMPILER, None):
        assert process.wait() == 0
