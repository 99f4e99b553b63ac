"""`teleop compare`: compare the results of several recordings, and of groups of recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from teleop.commands.overwriting import Overwrite
from teleop.commands.quantities import Hertz, Seconds
from teleop.commands.recording import BY_NAME, ColumnOptions
from teleop.names import ConditioningName, CubeName, ModelName, PresetName, WidthName

if TYPE_CHECKING:
    from teleop.evaluation.across.comparison import Compared


def compare(
    file: Path,
    /,
    *more: Path,
    by: str | None = None,
    columns: ColumnOptions = BY_NAME,
    estimators: str | None = None,
    model: ModelName | None = None,
    preset: PresetName | None = None,
    cube: CubeName | None = None,
    conditioning: ConditioningName | None = None,
    bandwidth: Hertz | None = None,
    force_lag: Seconds | None = None,
    anova: Literal["k", "b", "e_f", "rise_time_s"] | None = None,
    out: Path | None = None,
    plot: Path | None = None,
    width: WidthName = "screen",
    overwrite: Overwrite = False,
    json: Annotated[bool, Parameter(negative="")] = False,
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
    columns
        Columns to read, and the zeros of position and force.
    estimators
        Names of estimators, such as rls,kalman, or all. Default: the estimators of the run for a
        recording, and rls,ai,me for a file of another program.
    model
        Model of the environment, for the estimators that support several models.
    preset
        Settings of the estimators: scaled from the data (scaled), or the paper's (paper).
        Default: the settings of the run for a recording, and scaled for a file of another program.
    cube
        Cube of the paper whose adaptation gain is used. Only with the paper's settings. Default:
        the cube of the run for a recording, and soft for other files.
    conditioning
        How velocity is computed from position: see `teleop run --help`.
    bandwidth
        Bandwidth of the conditioning filter [Hz].
    force_lag
        Lag of the force channel [s], which is compensated.
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
    width
        Width of the figure: for a screen (screen), one column (single) or two columns (double) of
        an IEEE paper, or an A4 page (a4).
    json
        Print one JSON document instead of tables.
    """
    from dataclasses import asdict

    from teleop.commands.choices import choose_estimators, choose_model
    from teleop.commands.estimate import chosen
    from teleop.errors import InputError
    from teleop.evaluation.across.comparison import check_factors, compared, tidy_rows
    from teleop.evaluation.across.groups import grouped
    from teleop.evaluation.evaluate import KEPT, evaluate
    from teleop.evaluation.reading.samples import is_replayed
    from teleop.files import check_outputs
    from teleop.output.comparison_tables import (
        print_comparison,
        print_text_table,
        published_table,
        tracking_table,
    )
    from teleop.output.console import print_json
    from teleop.output.table_files import check_table_ending, write_table_file
    from teleop.printable import print_error
    from teleop.studies.anova import check_available, effects_table
    from teleop.studies.recordings import known_factors, planned_levels, sources, usual_factors
    from teleop.trial.tracked import recorded_tracking

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
    given = {
        "preset": preset,
        "cube": cube,
        "conditioning": conditioning,
        "bandwidth": bandwidth,
        "force_lag": force_lag,
        "estimators": None if estimators is None else choose_estimators(estimators),
        "model": choose_model(model) if model else None,
    }
    rows: list[Compared] = []
    skipped = []
    for source in found:
        try:
            samples, recording = columns.read(source.path, is_replayed)
            settings = chosen(recording, columns.datum, given)
            evaluation = evaluate(samples, settings, KEPT)
        except InputError as error:
            text = str(error).removeprefix(f"{source.path}: ").replace("\n", "; ")
            skipped.append({"file": str(source.path), "problem": text})
            print_error(f"{source.path}: left out: {text}")
            continue
        known = recording.settings | {"rig": recording.session.get("rig")} if recording else {}
        tracking = recorded_tracking(recording) if recording else None
        factors_known = known_factors(source, known)
        rows.append(compared(str(source.path), factors_known, evaluation, tracking))
    if not rows:
        raise InputError("no file can be evaluated")
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
        document: dict[str, Any] = {
            "by": factors,
            "recordings": [
                {
                    "file": row.file,
                    "factors": row.factors,
                    "result": row.result.summary(),
                    "estimates": {name: one._asdict() for name, one in row.estimates.items()},
                    "tracking": row.tracking and row.tracking._asdict(),
                }
                for row in rows
            ],
            "groups": [asdict(group) for group in groups],
            "anova": effects,
            "anova_design": design,
            "left_out": skipped,
        }
        print_json(document)
    else:
        print_comparison(rows, groups, factors)
        if anova:
            print_text_table("analysis of variance", effects_table(effects, anova, design))
    return 0


def effects_of(
    rows: list[Compared], factors: list[str], planned: list[str], response: str
) -> tuple[list[dict[str, Any]], str]:
    """Compute the analysis of variance of one result of the estimators.

    Parameters
    ----------
    rows
        Results of the evaluated recordings.
    factors
        Names of the factors by which the recordings are grouped.
    planned
        Names of all factors of the series (planned trials) to which the recordings belong,
        including `repetition`; empty if the recordings belong to no series.
    response
        Result that is analysed: average stiffness (`k`), damping (`b`) or force error (`e_f`), or
        rise time (`rise_time_s`).

    Returns
    -------
    effects
        One dictionary for each factor and each interaction of factors, see `Effect`.
    design
        Text that states which factor is random, and against which variance the effects are tested.
        It can also contain a warning about different depths of palpation.

    Raises
    ------
    InputError
        The analysis is not possible, for example because there are too few recordings.
    """
    from teleop.evaluation.across.comparison import SUBJECT
    from teleop.studies.anova import ESTIMATOR, analysis_of_variance, depth_note, design_text

    table = [
        {
            **dict(zip(factors, row.levels(factors), strict=True)),
            SUBJECT: row.factors.get(SUBJECT),
            "file": row.file,
            ESTIMATOR: name,
            response: getattr(one, response),
        }
        for row in rows
        for name, one in row.estimates.items()
    ]
    subjects = {row.factors.get(SUBJECT) for row in rows}
    random = SUBJECT if len(subjects) > 1 and None not in subjects else None
    between = [name for name in factors if name != SUBJECT]
    found = analysis_of_variance(table, response, between, "file", random)
    pooled = [
        name
        for name in planned
        if name not in (*factors, random) and len({row.factors.get(name) for row in rows}) > 1
    ]
    notes = [design_text(found, pooled, random)]
    if response in ("k", "b") and (note := depth_note(rows, between)):
        notes.append(note)
    return [effect._asdict() for effect in found], " ".join(notes)
