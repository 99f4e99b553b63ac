"""Tests never time: hypothesis has no deadline on a shared machine, and half its examples."""

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
    if ending and signal.getsignal(ending) is signal.SIG_IGN:  # as nohup and scripts leave them
        signal.signal(ending, signal.default_int_handler)

REAL_TIME = (
    "test_readme.py",
    "test_third_party.py",
    "test_site.py",
    "teleop/commands/test_stopping_commands.py",
    "teleop/control/test_clock.py",
    "teleop/live/",
    "teleop/recording/test_black_box.py",
    "teleop/recording/test_recorder.py",
    "teleop/recording/test_gaps.py",
    "teleop/test_cli.py",
    "teleop/trial/test_faults.py",
    "teleop/trial/test_realtime.py",
    "teleop/trial/test_run_outcome.py",
    "teleop/trial/test_stop_key.py",
    "teleop/trial/test_stop_switch.py",
    "teleop/wire/test_commands.py",
)
"""Tests with trials in real time: one worker of pytest-xdist runs them one after the other."""

COMPILER = pytest.StashKey[subprocess.Popen]()


def pytest_collection_modifyitems(items):
    """Run tests in real time in one worker, and tests of compiled code last."""
    here = Path(__file__).parent
    for item in items:
        if item.path.relative_to(here).as_posix().startswith(REAL_TIME):
            item.add_marker(pytest.mark.xdist_group("real time"))
    items.sort(key=lambda item: "compiled_estimators" in item.fixturenames)


def pytest_collection_finish(session):
    """Compile the estimators on the other processor until their tests come."""
    wanted = any(item.path.name == "test_contract.py" for item in session.items)
    if wanted and find_spec("numba") and not session.config.option.collectonly:
        script = Path(__file__).parent / "estimation" / "compile_all.py"
        session.config.stash[COMPILER] = subprocess.Popen([sys.executable, script])


def pytest_sessionfinish(session):
    """Leave nothing behind."""
    if process := session.config.stash.get(COMPILER, None):
        process.terminate()
        process.wait()


@pytest.fixture(scope="session")
def compiled_estimators(request):
    """Waits until every estimator has been compiled."""
    if process := request.config.stash.get(COMPILER, None):
        assert process.wait() == 0
