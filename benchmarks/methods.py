"""Run every method on the paper's nine trials, with two models: `python benchmarks/methods.py`.

The script runs `teleop reproduce --estimators all` with the models kelvin-voigt and stiffening. It
writes the averages over the nine trials to `benchmarks/results/methods.csv`, and the damping as
estimated in the paper, beside the true damping, to `damping.csv`. The documentation shows both.
Position and force pass through matched filters, and the lag of the force channel is compensated.
The errors are root mean squares from the end of the first second on. The reference is the stiffness
of the cube at the depth of each sample or, for the stiffening model, at the surface. The coverage
is the fraction of the samples whose 95 % interval contains this stiffness.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import tempfile
from pathlib import Path
from typing import Any

from teleop.cli import main

RESULTS = Path(__file__).parent / "results"
COLUMNS = ("k_error", "k_coverage", "b_error", "e_f", "rise_time_s", "held")


def reproduction(model: str) -> dict[str, Any]:
    """Return the document that `teleop reproduce --json` prints."""
    printed = io.StringIO()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(printed):
        command = ["reproduce", "--estimators", "all", "--model", model, "--out", f"{folder}/out"]
        if code := main([*command, "--json"]):
            raise SystemExit(code)
    document: dict[str, Any] = json.loads(printed.getvalue())
    return document


def write() -> None:
    """Run the trials with both models, and write the files."""
    documents = {model: reproduction(model) for model in ("kelvin-voigt", "stiffening")}
    with (RESULTS / "methods.csv").open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("model", "method", *COLUMNS))
        for model, document in documents.items():
            for name, row in document["methods"].items():
                numbers = ["" if row[c] is None else f"{row[c]:.4g}" for c in COLUMNS]
                table.writerow((model, name, *numbers))
    rows = documents["kelvin-voigt"]["damping"]
    with (RESULTS / "damping.csv").open("w", encoding="utf-8", newline="") as file:
        damping = csv.DictWriter(file, rows[0], lineterminator="\n")
        damping.writeheader()
        for row in rows:
            damping.writerow({k: v if isinstance(v, str) else f"{v:.4g}" for k, v in row.items()})


if __name__ == "__main__":
    write()
