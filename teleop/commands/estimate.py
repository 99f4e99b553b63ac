"""`teleop estimate`: estimate stiffness and damping from a file of position and force."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from teleop.commands.figures import truth_of
from teleop.commands.overwriting import Overwrite
from teleop.commands.quantities import Degrees, Hertz, Millimetres, Seconds
from teleop.commands.recording import BY_NAME, ColumnOptions
from teleop.names import ConditioningName, CubeName, ModelName, PresetName, WidthName

if TYPE_CHECKING:
    from teleop.evaluation.settings import EstimateSettings
    from teleop.recording.recording import Recording


def estimate(
    file: Path,
    /,
    *more: Path,
    columns: ColumnOptions = BY_NAME,
    estimators: str | None = None,
    model: ModelName | None = None,
    preset: PresetName | None = None,
    cube: CubeName | None = None,
    conditioning: ConditioningName | None = None,
    bandwidth: Hertz | None = None,
    force_lag: Seconds | None = None,
    whole: Annotated[bool, Parameter(negative="")] = False,
    cost: Annotated[bool, Parameter(negative="")] = False,
    out: Path | None = None,
    plot: Path | None = None,
    plot_force: Path | None = None,
    plot_fit: Path | None = None,
    width: WidthName = "screen",
    indenter: Literal["flat", "sphere", "cone"] | None = None,
    radius: Millimetres | None = None,
    angle: Degrees | None = None,
    thickness: Millimetres | None = None,
    poisson: float = 0.5,
    overwrite: Overwrite = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Estimate stiffness and damping from a recorded position and force.

    A recording of `teleop run` is evaluated with the settings of the run. The estimates are then
    exactly those of the run. An option such as --bandwidth changes one of the settings.

    First, the result is printed: stiffness and damping with 95 % intervals, or the reasons why the
    data are not sufficient. Then the fits of the batch models, which use all samples at once, are
    printed, and the estimates of the online estimators, which use one sample after another.

    Several files are evaluated one after another. Then a test shows whether a Kelvin-Voigt model
    with the same stiffness and damping fits all files, and the complex modulus of each file is
    printed.

    Example: `teleop estimate indentation.csv --force "Load [N]" --estimators all`

    Parameters
    ----------
    file
        A recording of teleop run (.mcap), or a file of another program: text such as
        `Time [s],Position [mm],Force [gf]`, .lvm, .mat, .h5, .parquet, .tdms, .xlsx, a ROS bag or
        .mcap.
    more
        Further recordings of the same specimen.
    columns
        Columns to read, and the zeros of position and force.
    estimators
        Names of estimators, such as rls,kalman,rls_sift, or all. Default: the estimators of the
        run for a recording, and rls,ai,me for other files.
    model
        Model of the environment, for the estimators that support several models.
    preset
        Settings of the estimators: scaled from the data (scaled), or the paper's (paper).
        Default: the settings of the run for a recording, and scaled for other files.
    cube
        Cube of the paper whose adaptation gain is used. Only with the paper's settings. Default:
        the cube of the run for a recording, and soft for other files.
    conditioning
        How velocity is computed from position: see `teleop run --help`. Default: the conditioning
        of the run for a recording, and matched for other files.
    bandwidth
        Bandwidth of the conditioning filter [Hz]. The default is ten times the highest frequency
        at which force follows displacement, and 20 Hz with the paper's settings.
    force_lag
        Lag of the force channel [s], from `teleop lag`; matched conditioning compensates for it.
        The default is the lag of the run for a recording. For other files it is the delay of the
        force filter, if the file states this filter.
    whole
        Also use the samples at rest before and after the motion.
    cost
        Also measure the computing time of each estimator per sample on this machine.
    out
        Write signals and estimates to this CSV file.
    plot
        Plot the estimated stiffness and damping, as in the paper's Figure 3, to a .png, .svg or
        .pdf file.
    plot_force
        Plot the measured and the predicted force to a .png, .svg or .pdf file.
    plot_fit
        Plot the force over the displacement, with the phases of the palpation (such as loading and
        hold), the fit of the best model, and the residual of this fit. For several files, plot the
        complex modulus over frequency.
    width
        Width of the figures: for a screen (screen), one column (single) or two columns (double) of
        an IEEE paper, or an A4 page (a4).
    indenter
        Shape of the tip. With this option, the elastic modulus is also printed.
    radius
        Radius of a flat punch or a sphere, such as 2.5mm; a number without a unit is in mm.
    angle
        Half angle of a cone, between its axis and its side; a number without a unit is in
        degrees.
    thickness
        Thickness of the specimen on a rigid base; a number without a unit is in mm. Default:
        infinite (a half-space).
    poisson
        Poisson's ratio of the specimen.
    json
        Print one JSON document instead of tables.
    """
    from contextlib import nullcontext

    from teleop.commands.choices import choose_estimators, choose_model
    from teleop.errors import InputError
    from teleop.evaluation.across.pooled import evaluate_together
    from teleop.evaluation.batch.material import Indenter, elastic_modulus
    from teleop.evaluation.evaluate import KEPT, evaluate
    from teleop.evaluation.evaluation import Evaluation
    from teleop.evaluation.reading.samples import is_replayed
    from teleop.evaluation.settings import settings_summary
    from teleop.files import check_outputs, new_file
    from teleop.output import console
    from teleop.output.estimate_tables import print_evaluation
    from teleop.output.result_tables import print_together
    from teleop.recording.gaps import gap_rows

    if more and (out or plot or plot_force):
        raise InputError("--out, --plot and --plot-force need exactly one file")
    tip = None
    if indenter:
        tip = Indenter(indenter, radius, angle, thickness, poisson)
    elif radius is not None or angle is not None or thickness is not None:
        raise InputError("--radius, --angle and --thickness need --indenter")
    pictures = (plot, plot_force, plot_fit)
    check_outputs(out, pictures=pictures, sources=(file, *more), overwrite=overwrite)
    for i, path in enumerate(more):
        if path.resolve() in [other.resolve() for other in (file, *more[:i])]:
            raise InputError(f"{path} is given twice: expected different recordings")
    given = {
        "preset": preset,
        "cube": cube,
        "conditioning": conditioning,
        "bandwidth": bandwidth,
        "force_lag": force_lag,
        "whole": whole or None,
        "estimators": None if estimators is None else choose_estimators(estimators),
        "model": choose_model(model) if model else None,
    }
    evaluations: dict[str, Evaluation] = {}
    summaries = []
    for path in (file, *more):
        samples, recording = columns.read(path, is_replayed)
        signals = samples.signals
        try:
            settings = chosen(recording, columns.datum, given)
            with new_file(out, overwrite) if out else nullcontext() as table:
                write = None
                if table:
                    from teleop.recording.export_formats import TableFile

                    write = TableFile(table).write
                evaluation = evaluate(samples, settings, KEPT, write)
        except InputError as error:
            raise InputError(f"{path}: {error}" if more else str(error)) from error
        summary = {
            "file": str(path),
            "force_filter": signals.force_filter,
            "reading": signals.notes,
            **settings_summary(settings),
            **evaluation.summary(cost),
        }
        if tip:
            result = evaluation.analysis.result
            known = evaluation.analysis.phases.contact_point is not None
            if result.identifiable:
                summary["material"] = elastic_modulus(result, tip, known)
        if recording:
            summary["as_online"] = evaluation.online.as_recorded and not recording.gaps
            summary["missing_ticks"] = gap_rows(recording.gaps)
            summary["estimated_channels"] = recording.estimated_channels
        if not json:
            print_evaluation(summary, path.name)
        evaluations[str(path)] = evaluation
        summaries.append(summary)
    together = evaluate_together(evaluations) if len(evaluations) > 1 else None
    if json:
        document = {"files": summaries, "together": together} if together else summaries[0]
        console.print_json(document)
    elif together:
        print_together(together)
    if not any(pictures):
        return 0
    from estimation.figure_style import figure_style
    from teleop.output.figure_files import plain, save

    title = plain(file.name)
    with figure_style(width):
        if plot:
            save(evaluation.plot(width, title, truth_of(recording)), plot, overwrite)
        if plot_force:
            save(evaluation.plot_force(width, title), plot_force, overwrite)
        if plot_fit:
            from teleop.output.fit_figures import fit_figure, modulus_figure

            if together is None:
                figure = fit_figure(file.name, evaluation)
            elif together["modulus"]:
                figure = modulus_figure(together["modulus"])
            else:
                raise InputError(
                    "--plot-fit: no file has a complex modulus: expected periodic palpations"
                )
            save(figure, plot_fit, overwrite)
    return 0


def chosen(recording: Recording | None, datum: str, given: Mapping[str, Any]) -> EstimateSettings:
    """Return the settings with which a file is evaluated.

    The settings are those of the recorded trial, or the default settings. They are then changed by
    the options of the command.

    Parameters
    ----------
    recording
        The recorded trial; None for a file of another program, which has the default settings.
    datum
        Value of the option --datum, which defines the zeros of position and force. With `auto`,
        the setting is not changed.
    given
        Values of the other options, by the name of the setting. An option that was not given has
        the value None, which does not change the setting.
    """
    from teleop.evaluation.settings import EstimateSettings

    settings = EstimateSettings()
    if recording:
        from teleop.evaluation.reading.recorded import recorded_settings
        from teleop.trial.recorded_trial import recorded_part

        settings = replace(recorded_settings(recording), averaged=recorded_part(recording))
    if datum != "auto":
        settings = replace(settings, datum=datum)
    changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    return replace(settings, **changes)
