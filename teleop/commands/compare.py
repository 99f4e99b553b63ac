"""`teleop compare`: compare the results of several recordings, and of groups of recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from teleop.commands.column_options import BY_USUAL_NAMES, ColumnOptions, Columns
from teleop.commands.comparison_options import (
    ONLINE,
    WITHOUT_STATISTICS,
    Comparison,
    repeatability_statistics,
)
from teleop.commands.estimation_options import (
    AS_RECORDED,
    FileEstimation,
    FileOptions,
    file_settings,
)
from teleop.commands.options import IN_OUTPUT, Json, OutputFile, Overwrite, Width

if TYPE_CHECKING:
    from teleop.evaluation.across.comparison import Compared
    from teleop.studies.batch import Evaluated
    from teleop.studies.recordings import ComparedFile

NAMED = 3
"""Largest number of files that a message lists."""


def compare(
    file: Path,
    /,
    *more: Path,
    comparison: Comparison = WITHOUT_STATISTICS,
    columns: Columns = BY_USUAL_NAMES,
    estimation: FileEstimation = AS_RECORDED,
    out: OutputFile = None,
    plot: OutputFile = None,
    plot_agreement: OutputFile = None,
    width: Width = "screen",
    workers: Annotated[int | None, IN_OUTPUT] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Compare the results of several recordings, and the mean results of groups of recordings.

    A file that cannot be evaluated is reported and left out. If no file can be evaluated, the exit
    code is 2. With an output file, each result is stored in the folder .teleop-compare beside it:
    the same command, or one with other statistics, then only evaluates files that are new or have
    changed. To continue after an interruption, enter the same command again.

    Example: `teleop compare data --factors "{subject}/{specimen}_rep{n}.csv"`

    Parameters
    ----------
    file
        A recording, a file of another program, the folder of a series, or a folder, which is
        searched for measurement files in all its subfolders.
    more
        Further files and folders.
    out
        Write the table to a .csv, .tex or .md file. A CSV file has a row with the result of each
        recording; the averages of the online estimators are written to a second file,
        table-estimators.csv. A LaTeX or Markdown file contains the means of the groups, notes, and
        the statistics. With --out table.csv, the statistics are written to the files
        table-anova.csv and table-repeatability.csv.
    plot
        Plot the stiffness and damping of each recording, and the mean of each group, to a .png,
        .svg or .pdf file. If the largest stiffness or damping is more than ten times the smallest,
        each level of one factor has its own row of panels.
    plot_agreement
        Plot the differences between the two levels of --repeatability over their means
        (Bland-Altman) to a .png, .svg or .pdf file.
    workers
        Number of processes. Default: one per processor, if there are many files.
    """
    from teleop.errors import InputError
    from teleop.evaluation.across.comparison import check_factors, tidy_rows
    from teleop.evaluation.across.groups import grouped
    from teleop.files import check_outputs
    from teleop.output.comparison_tables import (
        print_comparison,
        print_text_table,
        published_table,
        tracking_table,
    )
    from teleop.output.console import plain_console, print_json
    from teleop.output.table_files import check_table_ending, write_table_file
    from teleop.software import software
    from teleop.studies.anova import check_available
    from teleop.studies.factors import read_factors
    from teleop.studies.recordings import planned_levels, sources, stated_factors, usual_factors
    from teleop.studies.stored_results import NAME as STORE

    if workers is not None and workers < 1:
        raise InputError(f"workers {workers}: expected at least 1")
    comparison.check()
    if comparison.anova in ONLINE:
        check_available()
    if plot_agreement and not comparison.repeatability:
        raise InputError("--plot-agreement: expected with --repeatability")
    tables: dict[str, Path] = {}
    if out:
        check_table_ending(out)
        if out.suffix.lower() == ".csv":
            names = {
                "estimators": True,
                "anova": comparison.anova,
                "repeatability": comparison.repeatability,
            }
            tables = {name: out.with_stem(f"{out.stem}-{name}") for name in names if names[name]}
    factors = None if comparison.factors is None else read_factors(comparison.factors)
    found = sources((file, *more), factors)
    inputs = (*found.measurements, *(factors.files if factors else ()))
    pictures = (plot, plot_agreement)
    check_outputs(out, *tables.values(), pictures=pictures, sources=inputs, overwrite=overwrite)
    written = [path for path in (out, *pictures) if path]
    store = written[0].parent / STORE if written else None
    ended = evaluated(found.files, columns, estimation, store, workers)
    left_out = reported(found.left_out, ended)
    rows = ended.rows
    if not rows:
        raise InputError("no file can be evaluated")
    stated = stated_factors(found.files)
    by = usual_factors(found.files, rows)
    if comparison.by is not None:
        by = [name.strip() for name in comparison.by.split(",")]
    check_factors(rows, by)
    planned = planned_levels(found.files)
    groups = grouped(rows, by, planned, stated)
    repeated = comparison.repeated(rows, stated, planned)
    drawn = repeated.drawn if repeated else None
    if plot_agreement and drawn is None:
        raise InputError("--plot-agreement: expected two levels, such as --over n=1,2")
    statistics = [
        *filter(None, [comparison.anova_of(rows, by, [*stated, *repetitions(found.files)])]),
        *([repeatability_statistics(repeated)] if repeated else []),
    ]
    if out:
        shown = [published_table(groups, by), tracking_table(groups, by)]
        shown += [one.table for one in statistics]
        named = [*dict.fromkeys([*(name for one in found.files for name in one.levels), *by])]
        results = tidy_rows(rows, named)
        write_table_file(out, results, [table for table in shown if table], overwrite)
        if tables:
            estimates = tidy_rows(rows, named, of_estimators=True)
            write_table_file(tables["estimators"], estimates, (), overwrite)
            for one in statistics:
                write_table_file(tables[one.name], one.rows, (), overwrite)
    if plot or plot_agreement:
        from estimation.figure_style import figure_style
        from teleop.output.agreement_figure import agreement_figure
        from teleop.output.comparison_figure import comparison_figure
        from teleop.output.figure_files import save

        with figure_style(width):
            if plot:
                save(comparison_figure(rows, groups, by), plot, overwrite)
            if plot_agreement and repeated and drawn:
                agreed = agreement_figure(drawn, repeated.symbol, repeated.over, repeated.logarithm)
                save(agreed, plot_agreement, overwrite)
    if json:
        document = {
            "software": f"teleop {software()}",
            "by": by,
            "recordings": [summary_of(row) for row in rows],
            "groups": [asdict(group) for group in groups],
            "anova": [],
            "anova_design": "",
            "left_out": left_out,
            "reused": ended.reused,
        }
        for one in statistics:
            document |= one.document
        print_json(document)
        return 0
    print_comparison(rows, groups, by)
    for one in statistics:
        print_text_table(one.title, one.table)
    if store and ended.reused:
        text = f"{ended.reused} of {len(rows)} results from an earlier command ({store})"
        plain_console().print(f"\n{text}")
    return 0


def evaluated(
    files: Sequence[ComparedFile],
    columns: ColumnOptions,
    estimation: FileOptions,
    store: Path | None,
    workers: int | None,
) -> Evaluated:
    """Evaluate the files with a progress bar, and use the stored results."""
    from teleop.output.progress_bar import progress_bar
    from teleop.studies.batch import evaluate_files
    from teleop.studies.stored_results import StoredResults

    changes = estimation.changes(columns.datum)
    columns.wanted()  # check the options once
    options = [asdict(columns), asdict(estimation), changes.get("transmission")]
    evaluate = partial(result_of, columns, changes)
    with progress_bar("files", len(files)) as show:
        return evaluate_files(files, evaluate, StoredResults(store, options), workers, show)


def result_of(columns: ColumnOptions, changes: Mapping[str, Any], file: Path) -> Compared:
    """Evaluate a file. The factors of the result are the settings of the recording."""
    from teleop.evaluation.across.comparison import compared
    from teleop.evaluation.evaluate import KEPT, evaluate
    from teleop.evaluation.reading.samples import is_replayed
    from teleop.studies.recordings import setting_levels
    from teleop.trial.recorded_trial import recorded_tracking

    samples, recording = columns.read(file, is_replayed)
    evaluation = evaluate(samples, file_settings(recording, changes), KEPT)
    known = recording.settings | {"rig": recording.session.get("rig")} if recording else {}
    tracking = recorded_tracking(recording) if recording else None
    return compared(str(file), setting_levels(known), evaluation, tracking)


def reported(not_compared: Sequence[tuple[str, str]], ended: Evaluated) -> list[dict[str, str]]:
    """Print the files that are left out, and return them with the problems.

    Files that are left out before the evaluation, for the same reason, are counted in one line.
    """
    from teleop.printable import print_error

    by_problem: dict[str, list[str]] = {}
    for file, problem in not_compared:
        by_problem.setdefault(problem, []).append(file)
    for problem, files in by_problem.items():
        more = f" and {len(files) - NAMED} more" if len(files) > NAMED else ""
        print_error(f"{', '.join(files[:NAMED])}{more}: left out: {problem}")
    for file, problem in ended.problems:
        print_error(f"{file}: left out: {problem}")
    return [
        {"file": file, "problem": problem} for file, problem in (*not_compared, *ended.problems)
    ]


def repetitions(files: Sequence[ComparedFile]) -> list[str]:
    """Return the names of the factors that number the repetitions of these files."""
    from teleop.evaluation.across.comparison import REPETITIONS

    return [name for name in REPETITIONS if any(name in file.levels for file in files)]


def summary_of(row: Compared) -> dict[str, Any]:
    """The results of one recording for the JSON document."""
    return {
        "file": row.file,
        "factors": row.factors,
        "result": row.result.summary(),
        "estimates": {name: one._asdict() for name, one in row.estimates.items()},
        "tracking": row.tracking and row.tracking._asdict(),
    }
