"""`teleop sweep`: run trials, or estimate from recordings, with many settings in parallel."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from teleop.commands.options import Json, OutputFile, Overwrite, Width

if TYPE_CHECKING:
    from teleop.studies.sweep.conduct import SweepProgress
    from teleop.studies.sweep.executors import Execute
    from teleop.studies.sweep.plan import SweepPlan


def sweep(
    plan: Path,
    /,
    *,
    out: OutputFile = None,
    seeds: int | None = None,
    workers: int | None = None,
    dask: str | None = None,
    plot: OutputFile = None,
    plot_map: OutputFile = None,
    map_factors: str | None = None,
    response: Literal["k", "b", "k_end", "b_end", "e_f", "one_step_rms", "rise_time_s"] = "k",
    width: Width = "screen",
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Run trials with many settings and seeds, in parallel, and write one table of the results.

    The settings vary over a grid, a list, random values or a Latin hypercube. A point of the sweep
    is one combination of values. At each point, a trial is run on the simulated rig, or estimates
    are computed from a recording. If a point fails, its row of the table contains an error instead
    of results, and the exit code is 1. To resume a sweep that was interrupted or killed, or to run
    the failed points again, enter the same command again.

    Example: `teleop sweep paper --seeds 20 --out paper-sweep`

    Parameters
    ----------
    plan
        File with the plan of the sweep (TOML), or the word `paper` for the paper's nine trials.
    out
        Folder for the tables results.csv and results.parquet, with a row for each point and
        estimator, and for the journal. Default: sweep-NAME, where NAME is the name of the plan.
    seeds
        Number of times that each point is run, each time with another seed. Default: the number in
        the plan.
    workers
        Number of processes. Default: one per processor.
    dask
        Run on a Dask cluster: the address of its scheduler, such as tcp://10.0.0.1:8786, or local
        for a cluster on this machine. Needs the extra `sweep`.
    plot
        Plot the mean of the --response for each level of each factor, without the effects of the
        other factors, to a .png, .svg or .pdf file.
    plot_map
        Plot a map of the mean of the --response over two factors to a .png, .svg or .pdf file.
    map_factors
        The two factors of the map, separated by a comma. Default: the first two of the plan.
    response
        Result that the figures show: average stiffness (k) or damping (b), stiffness or damping at
        the end (k_end, b_end), force error (e_f), one-step force error (one_step_rms), or rise
        time (rise_time_s).
    """
    from teleop.errors import InputError
    from teleop.files import check_outputs
    from teleop.printable import print_error
    from teleop.studies.sweep.executors import in_processes
    from teleop.studies.sweep.plan import read_plan
    from teleop.studies.sweep.tables import CSV

    for name, count in (("workers", workers), ("seeds", seeds)):
        if count is not None and count < 1:
            raise InputError(f"{name} {count}: expected at least 1")
    read = read_plan(plan, seeds)
    axes = [name.strip() for name in map_factors.split(",")] if map_factors else [*read.factors][:2]
    if plot_map and (len(axes) != 2 or not set(axes) <= set(read.factors)):
        raise InputError(
            f"map: expected two of the factors {', '.join(read.factors)}, separated by a comma"
        )
    check_outputs(pictures=(plot, plot_map), sources=(plan,), overwrite=overwrite)
    folder = out or Path(f"sweep-{read.name}")
    if dask is not None:
        from teleop.studies.sweep.dask_cluster import on_dask

        execute = on_dask(dask, workers)
    else:
        execute = in_processes(workers)
    ended = conducted(folder, read, plan.parent, execute)
    print_end(folder, ended, json)
    if plot or plot_map:
        from estimation.figure_style import figure_style
        from teleop.output.figure_files import save
        from teleop.output.sweep_figures import main_effects_figure, map_figure
        from teleop.studies.sweep.tables import read_rows

        rows = read_rows(folder / CSV, [*read.factors], response)
        with figure_style(width):
            if plot:
                save(main_effects_figure(rows), plot, overwrite)
            if plot_map:
                save(map_figure(rows, *axes), plot_map, overwrite)
    if ended.failed:
        print_error(
            f"{ended.failed} of {ended.total} points failed: see the column error of "
            f"{folder / CSV}; to run them again, enter the same command again"
        )
    return 1 if ended.failed else 0


def conducted(folder: Path, plan: SweepPlan, plan_folder: Path, execute: Execute) -> SweepProgress:
    """Run the points of a plan with a progress bar; its paths are relative to `plan_folder`."""
    from teleop.output.progress_bar import progress_bar
    from teleop.studies.sweep.conduct import conduct
    from teleop.studies.sweep.points import points_of
    from teleop.studies.sweep.tasks import task_of

    task, points = task_of(plan, plan_folder), points_of(plan)
    with progress_bar("points", len(points)) as show:
        return conduct(folder, plan, task, points, execute, lambda progress: show(progress.done))


def print_end(folder: Path, ended: SweepProgress, json: bool) -> None:
    """Print how many points were run, and the files of the results."""
    from rich.console import Console

    from teleop.output.console import plain_console, print_json
    from teleop.studies.sweep.tables import CSV, PARQUET
    from telepalpation import needs

    files = [str(folder / CSV), *([str(folder / PARQUET)] if ended.parquet else [])]
    if json:
        print_json(
            {
                "folder": str(folder),
                "points": ended.total,
                "stopped": ended.stopped,
                "failed": ended.failed,
                "resumed": ended.resumed,
                "files": files,
            }
        )
        return
    text = f"{ended.total} points"
    if ended.resumed:
        text += f", {ended.resumed} of them from an earlier run"
    if ended.stopped:
        text += f", {ended.stopped} stopped for safety: see the column error"
    plain_console().print(f"{text}\n{' '.join(files)}", soft_wrap=True)
    if not ended.parquet:
        Console(stderr=True).print(needs(PARQUET, "pyarrow", "sweep"), soft_wrap=True, markup=False)
