"""`teleop compare`: compare the results of several recordings, and of groups of recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from teleop.commands.column_options import BY_USUAL_NAMES, ColumnOptions, Columns
from teleop.commands.estimation_options import AS_RECORDED, FileEstimation, file_settings
from teleop.commands.options import FACTORS, Json, OutputFile, Overwrite, Width

if TYPE_CHECKING:
    from teleop.evaluation.across.comparison import Compared
    from teleop.studies.recordings import Source


def compare(
    file: Path,
    /,
    *more: Path,
    by: Annotated[str | None, Parameter(group=FACTORS)] = None,
    columns: Columns = BY_USUAL_NAMES,
    estimation: FileEstimation = AS_RECORDED,
    anova: Annotated[
        Literal["k", "b", "e_f", "rise_time_s"] | None, Parameter(group=FACTORS)
    ] = None,
    out: OutputFile = None,
    plot: OutputFile = None,
    width: Width = "screen",
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Compare the results of several recordings, and the mean results of groups of recordings.

    A file that cannot be evaluated is reported and left out. If no file can be evaluated, the exit
    code is 2.

    Example: `teleop compare paper-series --out table.tex --plot figure.pdf`

    Parameters
    ----------
    file
        A recording, a file of another program, the folder of a series, or a folder with
        recordings.
    more
        Further files and folders.
    by
        Names of the factors by which the recordings are grouped, separated by commas. Each is a
        factor of the series; a setting of the recordings, such as condition, cube, rig or seed; or
        the word folder, to group the recordings by their folders. Default: the factors of the
        series that have two or more levels, except subject and repetition.
    anova
        Print an analysis of variance of one result of the estimators: the average stiffness (k),
        damping (b) or force error (e_f), or the rise time (rise_time_s). The fixed factors are
        the factors of --by and the estimator. If there are several subjects, the subject is a
        random factor. Needs the extra `stats`.
    out
        Write the table to a .csv, .tex or .md file. A CSV file has, for each recording, a row for
        the result and a row for each estimator. A LaTeX or Markdown file contains the means of the
        groups, notes, and the analysis of variance. The LaTeX file needs the packages booktabs and
        threeparttable. With --out table.csv, the analysis of variance is written to a second file,
        table-anova.csv.
    plot
        Plot the stiffness and damping of each recording, and the mean of each group, to a .png,
        .svg or .pdf file. If the largest stiffness or damping is more than ten times the smallest,
        each level of one factor has its own row of panels.
    """
    from teleop.evaluation.across.comparison import check_factors, tidy_rows
    from teleop.evaluation.across.groups import grouped
    from teleop.files import check_outputs
    from teleop.output.comparison_tables import (
        print_comparison,
        print_text_table,
        published_table,
        tracking_table,
    )
    from teleop.output.console import print_json
    from teleop.output.effects_table import effects_table
    from teleop.output.table_files import check_table_ending, write_table_file
    from teleop.studies.anova import check_available, effects_of
    from teleop.studies.recordings import planned_levels, sources, usual_factors

    if anova:
        check_available()
    found = sources((file, *more))
    effects_file = None
    if out:
        check_table_ending(out)
        if anova and out.suffix.lower() == ".csv":
            effects_file = out.with_stem(f"{out.stem}-anova")
    inputs = tuple(source.path for source in found)
    check_outputs(out, effects_file, pictures=(plot,), sources=inputs, overwrite=overwrite)
    rows, left_out = evaluated(found, columns, estimation.changes(columns.datum))
    factors = usual_factors(found) if by is None else [name.strip() for name in by.split(",")]
    check_factors(rows, factors)
    groups = grouped(rows, factors, planned_levels(found))
    planned = [*dict.fromkeys(name for source in found for name in source.levels)]
    effects, design = effects_of(rows, factors, planned, anova) if anova else ([], "")
    if out:
        tables = [published_table(groups, factors), tracking_table(groups, factors)]
        if anova:
            tables.append(effects_table(effects, anova, design))
        shown = [table for table in tables if table]
        named = [*dict.fromkeys([*planned, *factors])]
        write_table_file(out, tidy_rows(rows, named), shown, overwrite)
    if effects_file:
        tidy = [{"response": anova, **effect, "design": design} for effect in effects]
        write_table_file(effects_file, tidy, (), overwrite)
    if plot:
        from estimation.figure_style import figure_style
        from teleop.output.comparison_figure import comparison_figure
        from teleop.output.figure_files import save

        with figure_style(width):
            save(comparison_figure(rows, groups, factors), plot, overwrite)
    if json:
        print_json(
            {
                "by": factors,
                "recordings": [summary_of(row) for row in rows],
                "groups": [asdict(group) for group in groups],
                "anova": effects,
                "anova_design": design,
                "left_out": left_out,
            }
        )
    else:
        print_comparison(rows, groups, factors)
        if anova:
            print_text_table("analysis of variance", effects_table(effects, anova, design))
    return 0


def evaluated(
    found: Sequence[Source], columns: ColumnOptions, changes: Mapping[str, Any]
) -> tuple[list[Compared], list[dict[str, str]]]:
    """Evaluate each file; return the results, and the problems of the files that are left out."""
    from teleop.errors import InputError
    from teleop.evaluation.across.comparison import compared
    from teleop.evaluation.evaluate import KEPT, evaluate
    from teleop.evaluation.reading.samples import is_replayed
    from teleop.printable import print_error
    from teleop.studies.recordings import known_factors
    from teleop.trial.recorded_trial import recorded_tracking

    rows: list[Compared] = []
    left_out = []
    for source in found:
        file = str(source.path)
        try:
            samples, recording = columns.read(source.path, is_replayed)
            evaluation = evaluate(samples, file_settings(recording, changes), KEPT)
        except InputError as error:
            text = str(error).removeprefix(f"{file}: ").replace("\n", "; ")
            left_out.append({"file": file, "problem": text})
            print_error(f"{file}: left out: {text}")
            continue
        known = recording.settings | {"rig": recording.session.get("rig")} if recording else {}
        tracking = recorded_tracking(recording) if recording else None
        rows.append(compared(file, known_factors(source, known), evaluation, tracking))
    if not rows:
        raise InputError("no file can be evaluated")
    return rows, left_out


def summary_of(row: Compared) -> dict[str, Any]:
    """The results of one recording for the JSON document."""
    return {
        "file": row.file,
        "factors": row.factors,
        "result": row.result.summary(),
        "estimates": {name: one._asdict() for name, one in row.estimates.items()},
        "tracking": row.tracking and row.tracking._asdict(),
    }
