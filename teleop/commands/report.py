"""`teleop report`: write the results of a recording to an HTML page."""

from __future__ import annotations

import os
from pathlib import Path

from teleop.commands.column_options import BY_USUAL_NAMES, Columns
from teleop.commands.estimation_options import (
    AS_RECORDED,
    FileEstimation,
    file_settings,
    true_values,
)
from teleop.commands.options import Json, OutputFile, Overwrite


def report(
    file: Path,
    /,
    *,
    out: OutputFile = None,
    columns: Columns = BY_USUAL_NAMES,
    estimation: FileEstimation = AS_RECORDED,
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Write the results and figures of a recording to one HTML page that can be read offline.

    The page begins with the result: stiffness and damping with 95 % intervals, whether they can be
    used, and the force over the depth with the fit. The estimates of each estimator, further
    figures and a link to the recording follow. One figure shows over time which values of stiffness
    and damping fit the data about equally well. For a recording of teleop run, the page also
    contains the true values if the rig was simulated, the safety events and the settings of the
    trial. If a fault stopped the trial, the page begins with the fault, and a figure shows the
    measured signals before and after the fault.

    Example: `teleop report run.mcap --out run.html`

    Parameters
    ----------
    file
        Recording of teleop run (.mcap), or a file of another program: text, .lvm, .mat, .h5,
        .parquet, .tdms, .xlsx, a ROS bag or .mcap.
    out
        HTML file to write. Default: the name of the recording with the ending .html.
    """
    from teleop.files import check_drawing

    check_drawing("a report")
    from teleop.evaluation.evaluate import KEPT, evaluate
    from teleop.evaluation.online.thresholds import FEWEST_SAMPLES
    from teleop.evaluation.reading.samples import is_reported
    from teleop.evaluation.settings import settings_summary
    from teleop.files import check_ending, check_outputs, write_text
    from teleop.output import console
    from teleop.output.report_page import report_page
    from teleop.output.trial_tables import felt_lines
    from teleop.trial.recorded_trial import (
        recorded_motion,
        recorded_tracking,
        true_result,
        with_steps,
    )
    from teleop.trial.trial_statistics import felt, recorded_rendering

    page = out or file.with_suffix(".html")
    check_ending(page, ".html")
    check_outputs(page, sources=(file,), overwrite=overwrite)
    samples, recording = columns.read(file, is_reported)
    evaluation = summary = None
    settings = file_settings(recording, estimation.changes(columns.datum))
    few = settings.averaged.contains(samples.signals.t).sum() < FEWEST_SAMPLES
    if not (recording and recording.fault and few):
        evaluation = evaluate(samples, settings, KEPT)
        summary = {**settings_summary(settings), **evaluation.summary()}
    link = os.path.relpath(file.absolute(), page.absolute().parent)
    truth = true_values(recording) if recording else None
    found = recorded_tracking(recording) if recording else None
    tracking = found and found._asdict()
    motion = recorded_motion(recording) if recording else None
    true = None
    if recording and evaluation:
        true = true_result(recording, evaluation.analysis.result.position)
    rendering = recorded_rendering(recording) if recording else None
    texts: list[str] = []
    if rendering and recording:
        measures = felt(rendering, recording.fault)
        texts = [*felt_lines(measures._asdict()), *measures.remarks]
    summary = summary and with_steps(summary, recording, file)
    steps = summary["steps"] if summary else []
    about = (truth, link, tracking, motion, true, rendering, texts, steps)
    text = report_page(file.name, evaluation, summary, recording, *about)
    write_text(page, text, overwrite)
    if json:
        console.print_json({"page": str(page), "file": str(file), **(summary or {})})
    else:
        console.plain_console().print(str(page), soft_wrap=True)
    return 0
