"""`teleop reproduce`: reproduce the paper's Table I and Figures 3 to 5."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from teleop.commands.options import IN_OUTPUT, Json, Overwrite
from teleop.names import ModelName


def reproduce(
    *,
    out: Annotated[Path, IN_OUTPUT] = Path("reproduction"),
    seeds: int = 1,
    estimators: str | None = None,
    model: ModelName = "kelvin-voigt",
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Reproduce the paper's Table I and Figures 3 to 5 on the simulated rig.

    The paper is "Techniques for environment parameter estimation during telemanipulation"
    (Yamamoto et al., BioRob 2008). The command runs nine trials (three cubes, three conditions)
    with the settings of the paper. It checks whether the statements of the paper are true for the
    results, and shows why the estimated damping is negative although the true damping is positive.

    Example: `teleop reproduce --seeds 20 --out reproduction`

    Parameters
    ----------
    out
        Folder for the page (index.html), the table (CSV) and the figures (SVG, PNG).
    seeds
        Number of times that the nine trials are run, each time with another seed. With 2 or more,
        an analysis of variance shows the effects of cube, condition and estimator.
    estimators
        Further estimators to compare on the same trials: names such as kalman,rls_sift, or all.
    model
        Model of the environment, for the further estimators that support several models.
    """
    from teleop.files import check_drawing

    check_drawing("the page of the reproduction")
    from rich.console import Console
    from rich.progress import Progress

    from teleop.commands.estimation_options import chosen_estimators, chosen_model
    from teleop.errors import InputError
    from teleop.output import console
    from teleop.output.console import print_table
    from teleop.studies.paper.methods import FurtherMethods
    from teleop.studies.paper.page import METHOD_HEADINGS, method_cells
    from teleop.studies.paper.reproduction import check_folder, write
    from teleop.studies.paper.reproduction import reproduce as run
    from teleop.studies.paper.tables import print_reproduction

    names = () if estimators is None else chosen_estimators(estimators)
    if model != "kelvin-voigt" and not names:
        raise InputError(f"model {model}: expected --estimators, which it applies to")
    methods = FurtherMethods(names, chosen_model(model))
    check_folder(out, overwrite)
    with Progress(
        console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()
    ) as progress:
        task = progress.add_task("palpating", total=9 * max(seeds, 0))
        reproduction = run(seeds, methods, lambda: progress.advance(task))
    page = write(reproduction, out, overwrite)
    if json:
        console.print_json({**reproduction.summary(), "page": str(page)})
    else:
        print_reproduction(reproduction.summary())
        if names:
            print_table(
                console.plain_console(),
                f"{model}, on average over all trials",
                METHOD_HEADINGS,
                method_cells(reproduction.methods),
            )
        console.plain_console().print(str(page))
    return 0
