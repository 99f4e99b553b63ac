"""Check that two versions record the same numbers: `python benchmarks/same_recordings.py PATH`.

PATH is the folder with the source of another version. Both versions run the same trials in virtual
time: all conditions and cubes, all estimators, models, feedback laws with and without a channel,
other bodies, conditioners, and trials that the supervisor limits or stops. Each trial whose
recordings are not identical to the bit is printed, and the exit code is then 1.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import get_args

from feedback_bodies import body

from estimation import MODELS
from estimation.registry import BUILT_IN
from sim_backend import CUBES
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.settings import FeedbackSettings
from teleop.names import ConditioningName, ConditionName, FeedbackName
from teleop.safety.tightened_limits import TightenedLimits
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

ROOT = Path(__file__).parents[1]
SECONDS = 3.0
BODIES = ("loose", "relaxing", "hunt-crossley", "inclusion", "soft to hard")
CHANNEL = ChannelSettings(delay=10e-3, jitter=5e-3, loss=0.02)


def trials() -> Iterator[tuple[str, TrialSettings]]:
    """Yield the name and the settings of each trial."""
    plain = TrialSettings(clock="virtual", duration=SECONDS)
    for condition, cube in product(get_args(ConditionName), CUBES):
        yield f"{condition}, {cube}", replace(plain, condition=condition, cube=cube)
    yield "all estimators", replace(plain, estimators=tuple(BUILT_IN))
    for name, model in MODELS.items():
        yield f"model {name}", replace(plain, estimators=("rls_conditional",), model=model)
    for law, channel in product(get_args(FeedbackName), (None, CHANNEL)):
        feedback = FeedbackSettings(law, 0.3)
        title = f"feedback {law}, {'channel' if channel else 'no channel'}"
        yield title, replace(plain, feedback=feedback, channel=channel)
    for name in BODIES:
        setup = replace(plain.setup, cube=body(name, CUBES["soft"]))
        yield f"body {name}", replace(plain, custom_setup=setup)
    for conditioning in get_args(ConditioningName):
        yield f"conditioning {conditioning}", replace(plain, conditioning=conditioning)
    limited = TightenedLimits(soft_force=4.0, hard_force=5.0)
    yield "limited by the supervisor", replace(plain, tightened_limits=limited)
    stopped = TightenedLimits(following_error=1e-4)
    yield "stopped by a fault", replace(plain, tightened_limits=stopped)


def digests() -> dict[str, str]:
    """Return a digest of the recording of each trial."""
    found = {}
    for name, settings in trials():
        recording = run_trial(settings).recording
        digest = hashlib.sha256(json.dumps(recording.events).encode())
        for column in sorted(recording.columns):
            digest.update(column.encode() + recording[column].tobytes())
        found[name] = digest.hexdigest()
    return found


def in_process(tree: Path) -> subprocess.Popen[str]:
    """Start the trials of a version in another process, by its own copy of this program.

    Modules can have other names in another version. Trials are compared by their names.
    """
    return subprocess.Popen(
        [sys.executable, tree / "benchmarks" / "same_recordings.py", "--digests", "-"],
        env=os.environ | {"PYTHONPATH": str(tree)},
        cwd=tree,
        stdout=subprocess.PIPE,
        text=True,
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("path", type=Path)
    parser.add_argument("--digests", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.digests:
        print(json.dumps(digests()))
        return 0
    processes = [in_process(tree) for tree in (ROOT, options.path.absolute())]
    this, other = (json.loads(process.communicate()[0]) for process in processes)
    different = [name for name in this if this[name] != other.get(name)]
    for name in different:
        print(f"different: {name}")
    print(f"{len(this) - len(different)} of {len(this)} recordings are identical to the bit")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
