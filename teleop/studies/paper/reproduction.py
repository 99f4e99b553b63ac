"""Reproduce the paper: simulate its trials, check its claims, and write the result files."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any

from markupsafe import Markup

from estimation.figures import estimates_figure
from sim_backend import CUBES
from teleop.errors import InputError
from teleop.files import check_outputs, unwritable, write_text
from teleop.output.figure_files import save
from teleop.output.trial_figures import stiffness_figure
from teleop.output.web_page import svg
from teleop.software import software
from teleop.studies.anova import Effect, check_available
from teleop.studies.paper.claims import Claim, check_claims
from teleop.studies.paper.methods import FurtherMethods, MethodResult, averages
from teleop.studies.paper.page import reproduction_page
from teleop.studies.paper.study import RESPONSES, effects_on
from teleop.studies.paper.table1 import CONDITIONS, table1
from teleop.studies.paper.trials import (
    NO_METHODS,
    PaperTrial,
    SlowTrial,
    as_rows,
    lag_and_damping,
    palpate,
)
from teleop.studies.workers import workers

SLOW_FREQUENCIES = (0.1, 1.0)
"""Frequencies of the motion in additional trials [Hz]. The lag of the force channel and the damping
are both estimated from each of these trials."""
TABLE, PAGE = "table1.csv", "index.html"
"""Names of the files with Table I and with the page."""
CAPTIONS = {
    "figure3": "Figure 3. Free palpation of the soft cube: estimated stiffness with the "
    "displacement profile (grey), estimated damping with the velocity profile (grey).",
    "figure4": "Figure 4. Estimated stiffness of the three cubes under free palpation.",
    "figure5": "Figure 5. Estimated stiffness of the soft cube under the three conditions.",
}
"""Captions of the figures, by the name of the figure."""


@dataclass(frozen=True)
class Reproduction:
    """Results of the reproduction of the paper in simulation."""

    outcomes: list[PaperTrial]
    """Results of the nine trials for every seed."""
    slow: list[SlowTrial]
    """Lag of the force channel and damping, both estimated from one trial for each frequency."""
    claims: list[Claim]
    """Claims of the paper, checked against the trials of the first seed."""
    study: dict[str, list[Effect]]
    """Effects from an analysis of variance, by the name of the response; empty for one seed."""

    @property
    def first(self) -> list[PaperTrial]:
        """Results of the paper's nine trials with the first seed."""
        return self.outcomes[: len(CONDITIONS) * len(CUBES)]

    @property
    def seeds(self) -> int:
        """Number of times that the paper's nine trials were run, each time with another seed."""
        return len(self.outcomes) // (len(CONDITIONS) * len(CUBES))

    @property
    def methods(self) -> dict[str, MethodResult]:
        """Results of further estimators, averaged over all trials, by the name of the estimator.

        Further estimators are those that were requested in addition to the three of the paper. The
        dictionary is empty if none were requested.
        """
        return averages([outcome.methods for outcome in self.outcomes])

    def summary(self) -> dict[str, Any]:
        """Return the results as a dictionary, for output as JSON by `teleop reproduce --json`."""
        return {
            "seeds": self.seeds,
            "trials": as_rows(self.first),
            "claims": [claim._asdict() for claim in self.claims],
            "damping": [
                {"condition": o.condition, "cube": o.cube, **o.damping._asdict()}
                for o in self.first
            ],
            "methods": {name: row._asdict() for name, row in self.methods.items()},
            "methods_by_trial": [
                {"condition": o.condition, "cube": o.cube, "estimator": name, **row._asdict()}
                for o in self.first
                for name, row in o.methods.items()
            ],
            "study": {
                name: [effect._asdict() for effect in effects]
                for name, effects in self.study.items()
            },
        }


def reproduce(
    seeds: int, methods: FurtherMethods = NO_METHODS, on_done: Callable[[], None] = lambda: None
) -> Reproduction:
    """Run the paper's nine trials in simulation for several seeds, on all processor cores."""
    if seeds < 1:
        raise InputError(f"seeds {seeds}: expected at least 1")
    if seeds > 1:
        check_available()
    trials = [(c, q, seed) for seed in range(seeds) for c in CONDITIONS for q in CUBES]
    outcomes = []
    with workers() as pool:
        slow = pool.map(lag_and_damping, SLOW_FREQUENCIES)
        for outcome in pool.map(partial(palpate, methods=methods), trials):
            outcomes.append(outcome)
            on_done()
        slow_trials = list(slow)
    study = {}
    if seeds > 1:
        study = {name: effects_on(outcomes, name) for name in RESPONSES}
    return Reproduction(outcomes, slow_trials, check_claims(outcomes[:9]), study)


def check_folder(folder: Path, overwrite: bool) -> None:
    """Create the folder of the results, and check that the result files can be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise InputError(f"{folder}: is a file: expected a folder") from error
    except OSError as error:
        raise unwritable(folder, error) from error
    drawings = (f"{name}{ending}" for name in CAPTIONS for ending in (".png", ".svg"))
    names = (TABLE, PAGE, *drawings)
    check_outputs(*(folder / name for name in names), overwrite=overwrite)


def write(reproduction: Reproduction, folder: Path, overwrite: bool = False) -> Path:
    """Write a table (CSV), figures (SVG, PNG) and a page (HTML); return the path of the page."""
    write_text(folder / TABLE, csv_table(as_rows(reproduction.first)), overwrite)
    with workers() as pool:
        drawn = pool.map(draw, CAPTIONS, [reproduction.first] * 3, [folder] * 3, [overwrite] * 3)
        drawings = dict(zip(CAPTIONS.values(), drawn, strict=True))
    text = reproduction_page(
        reproduction.first,
        reproduction.claims,
        drawings,
        reproduction.slow,
        reproduction.study,
        reproduction.seeds,
        reproduction.methods,
    )
    write_text(folder / PAGE, text, overwrite)
    return folder / PAGE


def csv_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return a CSV text with the simulated Table I and the paper's Table I.

    The table has one row for each trial and estimator.
    """
    text = StringIO(newline="")
    writer = csv.writer(text)
    by = f"teleop {software()}"
    ours = ["condition", "cube", "estimator", "b", "k", "e_f", "rise_time_s"]
    writer.writerow([*ours, "paper b", "paper k", "paper e_f", "calibrated", "software"])
    for row in rows:
        writer.writerow(
            [*(row[name] for name in ours), *row["paper"].values(), row["calibrated"], by]
        )
    return text.getvalue()


def draw(name: str, outcomes: Sequence[PaperTrial], folder: Path, overwrite: bool) -> Markup:
    """Draw a figure of the paper with simulated results, and write it to a PNG and an SVG file.

    The figure is returned as an SVG element.
    """
    trial = {(outcome.condition, outcome.cube): outcome for outcome in outcomes}
    if name == "figure3":
        soft = trial["free", "soft"]
        figure = estimates_figure("free, soft cube", soft.t, soft.x, soft.v, soft.series)
    elif name == "figure4":
        figure = stiffness_figure(
            {f"{q} cube": (trial["free", q].t, trial["free", q].series) for q in CUBES},
            {f"{q} cube": table1()["free", q, "rls"].k for q in CUBES},
        )
    else:
        figure = stiffness_figure(
            {c: (trial[c, "soft"].t, trial[c, "soft"].series) for c in CONDITIONS},
            {c: table1()[c, "soft", "rls"].k for c in CONDITIONS},
            same_scale=True,
        )
    save(figure, folder / f"{name}.png", overwrite)
    figure.set_layout_engine("none")  # keep the layout of the PNG file
    drawing = svg(figure)
    write_text(folder / f"{name}.svg", drawing, overwrite)
    return drawing
