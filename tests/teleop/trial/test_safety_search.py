"""A short run of benchmarks/safety_search.py, the random search for violated safety rules."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from teleop.streams import stream

SCRIPT = Path(__file__).parents[3] / "benchmarks" / "safety_search.py"


def test_no_sequence_of_faults_failing_calls_and_requests_violates_a_safety_rule(
    monkeypatch,
):
    # the script sets the clock of all streams: this sets it back for the other tests of the process
    monkeypatch.setattr(stream, "monotonic", stream.monotonic)
    sys.path.insert(0, str(SCRIPT.parent))
    spec = importlib.util.spec_from_file_location("safety_search", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["safety_search"] = module
    spec.loader.exec_module(module)
    module.search(50)
