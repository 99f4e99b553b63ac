"""`teleop report`: write the results of a recording to an HTML page."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from teleop.commands.overwriting import Overwrite
from teleop.commands.quantities import Seconds
from teleop.commands.recording import BY_NAME, ColumnOptions
from teleop.names import CubeName, ModelName, PresetName


def report(
    file: Path,
    /,
    *,
    out: Path | None = None,
    columns: ColumnOptions = BY_NAME,
    estimators: str | None = None,
    model: ModelName | None = None,
    preset: PresetName | None = None,
    cube: CubeName | None = None,
    force_lag: Seconds | None = None,
    overwrite: Overwrite = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Write the results and figures of a recording to one HTML page that can be read offline.

    The page contains the result (stiffness and damping with 95 % intervals), the estimates of each
    estimator, figures, and a link to the recording. One figure shows over time which values of
    stiffness and damping fit the data about equally well. For a recording of teleop run, the page
    also contains the safety events and the settings of the trial. If a fault stopped the trial, the
    page describes the fault, and a figure shows the measured signals before and after the fault.

    Example: `teleop report run.mcap --out run.html`

    Parameters
    ----------
    file
        Recording of teleop run (.mcap), or a file of another program: text, .lvm, .mat, .h5,
        .parquet, .tdms, .xlsx, a ROS bag or .mcap.
    out
        HTML file to write. Default: the name of the recording with the ending .html.
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
    force_lag
        Lag of the force channel [s], which is compensated.
    json
        Print one JSON document with the results instead of the name of the page.
    """
    from teleop.commands.choices import choose_estimators, choose_model
    from teleop.commands.estimate import chosen
    from teleop.commands.figures import truth_of
    from teleop.evaluation.evaluate import KEPT, evaluate
    from teleop.evaluation.online.thresholds import FEWEST_SAMPLES
    from teleop.evaluation.reading.samples import is_reported
    from teleop.evaluation.settings import settings_summary
    from teleop.files import check_ending, check_outputs, write_text
    from teleop.output import console
    from teleop.output.report_page import report_page
    from teleop.trial.recorded_trial import recorded_motion, recorded_tracking

    page = out or file.with_suffix(".html")
    check_ending(page, ".html")
    check_outputs(page, sources=(file,), overwrite=overwrite)
    given = {
        "preset": preset,
        "cube": cube,
        "force_lag": force_lag,
        "estimators": None if estimators is None else choose_estimators(estimators),
        "model": choose_model(model) if model else None,
    }
    samples, recording = columns.read(file, is_reported)
    evaluation = summary = None
    settings = chosen(recording, columns.datum, given)
    few = settings.averaged.contains(samples.signals.t).sum() < FEWEST_SAMPLES
    if not (recording and recording.fault and few):
        evaluation = evaluate(samples, settings, KEPT)
        summary = {**settings_summary(settings), **evaluation.summary()}
    link = os.path.relpath(file.resolve(), page.resolve().parent)
    truth = truth_of(recording)
    found = recorded_tracking(recording) if recording else None
    tracking = found and found._asdict()
    motion = recorded_motion(recording) if recording else None
    text = report_page(file.name, evaluation, summary, recording, truth, link, tracking, motion)
    write_text(page, text, overwrite)
    if json:
        console.print_json({"page": str(page), "file": str(file), **(summary or {})})
    else:
        console.plain_console().print(str(page), soft_wrap=True)
    return 0
