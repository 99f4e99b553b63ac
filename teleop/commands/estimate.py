"""`teleop estimate`: estimate stiffness and damping from a file of position and force."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO, Literal

from cyclopts import Parameter

from teleop.commands.column_options import BY_USUAL_NAMES, Columns
from teleop.commands.estimation_options import (
    AS_RECORDED,
    FileEstimation,
    file_settings,
    true_values,
)
from teleop.commands.options import ESTIMATION, MODULUS, OUTPUT, Json, OutputFile, Overwrite, Width
from teleop.commands.quantities import Angle, Length

if TYPE_CHECKING:
    from teleop.evaluation.batch.material import Indenter
    from teleop.evaluation.evaluation import Evaluation
    from teleop.evaluation.online.run import Table
    from teleop.recording.recording import Recording


@dataclass(frozen=True)
class IndenterOptions:
    """Options of the tip and of the specimen, for the elastic modulus."""

    indenter: Literal["flat", "sphere", "cone"] | None = None
    """Shape of the tip. With this option, the elastic modulus is also printed."""
    radius: Length | None = None
    """Radius of a flat punch or a sphere, such as 2.5mm."""
    angle: Angle | None = None
    """Half angle of a cone, between its axis and its side, such as 30deg."""
    thickness: Length | None = None
    """Thickness of the specimen on a rigid base, such as 20mm. Default: infinite (a
    half-space)."""
    poisson: float = 0.5
    """Poisson's ratio of the specimen."""

    def tip(self) -> Indenter | None:
        """The tip; None if no elastic modulus is requested."""
        from teleop.errors import InputError

        if self.indenter:
            from teleop.evaluation.batch.material import Indenter

            return Indenter(self.indenter, self.radius, self.angle, self.thickness, self.poisson)
        if any(one is not None for one in (self.radius, self.angle, self.thickness)):
            raise InputError("--radius, --angle and --thickness need --indenter")
        return None


Modulus = Annotated[IndenterOptions, Parameter(name="*", group=MODULUS)]
NO_MODULUS = IndenterOptions()


@dataclass(frozen=True)
class FigureOptions:
    """Options of the figures of an evaluation."""

    plot: Path | None = None
    """Plot the estimated stiffness and damping with 95 % intervals, as in the paper's Figure 3, and
    the result, to a .png, .svg or .pdf file."""
    plot_force: Path | None = None
    """Plot the measured and the predicted force to a .png, .svg or .pdf file."""
    plot_fit: Path | None = None
    """Plot the force over the displacement, with the phases of the palpation (such as loading and
    hold), the fit of the best model, and the residual of this fit. For several files, plot the
    complex stiffness over frequency."""
    width: Width = "screen"

    @property
    def files(self) -> tuple[Path | None, ...]:
        """The files to be drawn."""
        return self.plot, self.plot_force, self.plot_fit

    def draw(
        self,
        name: str,
        evaluation: Evaluation,
        recording: Recording | None,
        together: dict[str, Any] | None,
        overwrite: bool,
    ) -> None:
        """Draw the requested figures of one file, or of several files evaluated `together`."""
        if not any(self.files):
            return
        from estimation.figure_style import figure_style
        from teleop.errors import InputError
        from teleop.output.figure_files import plain, save
        from teleop.output.fit_figures import complex_stiffness_figure, fit_figure, result_title

        title = plain(name)
        with figure_style(self.width):
            if self.plot:
                truth = true_values(recording) if recording else None
                heading = result_title(title, evaluation.analysis.result.summary())
                figure = evaluation.plot(self.width, heading, truth)
                save(figure, self.plot, overwrite)
            if self.plot_force:
                save(evaluation.plot_force(self.width, title), self.plot_force, overwrite)
            if self.plot_fit:
                if together is None:
                    figure = fit_figure(name, evaluation)
                elif together["complex_stiffness"]:
                    figure = complex_stiffness_figure(together["complex_stiffness"])
                else:
                    raise InputError(
                        "--plot-fit: no file has a complex stiffness: expected periodic palpations"
                    )
                save(figure, self.plot_fit, overwrite)


Figures = Annotated[FigureOptions, Parameter(name="*", group=OUTPUT)]
NO_FIGURES = FigureOptions()


def estimate(
    file: Path,
    /,
    *more: Path,
    columns: Columns = BY_USUAL_NAMES,
    estimation: FileEstimation = AS_RECORDED,
    cost: Annotated[bool, Parameter(group=ESTIMATION)] = False,
    modulus: Modulus = NO_MODULUS,
    out: OutputFile = None,
    details: Annotated[bool, Parameter(group=OUTPUT)] = False,
    figures: Figures = NO_FIGURES,
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Estimate stiffness and damping from a recorded position and force.

    A recording of `teleop run` is evaluated with the settings of the run. The estimates are then
    exactly those of the run. An option such as --bandwidth changes one of the settings.

    First, the result is printed: whether stiffness and damping can be used, their values with 95 %
    intervals, or the reasons why the data are not sufficient. Then the best of the batch models,
    which use all samples at once, is printed, and the estimates of the online estimators, which use
    one sample after another.

    Several files are evaluated one after another. Then a test shows whether a Kelvin-Voigt model
    with the same stiffness and damping fits all files, and the complex stiffness of each file is
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
    cost
        Also measure the computing time of each estimator per sample on this machine.
    out
        Write signals and estimates to this CSV file.
    details
        Also print all batch models, motion, phases, averages of the estimators, datum and filters.
    """
    from teleop.errors import InputError
    from teleop.evaluation.evaluate import KEPT, evaluate
    from teleop.evaluation.reading.samples import is_replayed
    from teleop.evaluation.settings import settings_summary
    from teleop.files import check_outputs, new_file
    from teleop.output.console import print_json
    from teleop.output.estimate_tables import print_evaluation
    from teleop.output.result_tables import print_together

    files = (file, *more)
    if more and (out or figures.plot or figures.plot_force):
        raise InputError("--out, --plot and --plot-force need exactly one file")
    changes = estimation.changes(columns.datum)
    tip = modulus.tip()
    check_outputs(out, pictures=figures.files, sources=files, overwrite=overwrite)
    check_different(files)
    evaluations: dict[str, Evaluation] = {}
    summaries = []
    for path in files:
        samples, recording = columns.read(path, is_replayed)
        try:
            settings = file_settings(recording, changes)
            with new_file(out, overwrite) if out else nullcontext() as table:
                evaluation = evaluate(samples, settings, KEPT, writer(table))
        except InputError as error:
            raise InputError(f"{path}: {error}" if more else str(error)) from error
        summary = {
            "file": str(path),
            "force_filter": samples.signals.force_filter,
            "reading": samples.signals.notes,
            **settings_summary(settings),
            **evaluation.summary(cost),
            **material(evaluation, tip),
            **recorded(evaluation, recording),
            "steps": [],
        }
        if recording:  # a table needs none of the modules of a trial
            from teleop.trial.recorded_trial import with_steps

            summary = with_steps(summary, recording, path)
        if not json:
            print_evaluation(summary, path.name, details)
        evaluations[str(path)] = evaluation
        summaries.append(summary)
    together = None
    if more:
        from teleop.evaluation.across.pooled import evaluate_together

        together = evaluate_together(evaluations)
    if json:
        print_json({"files": summaries, "together": together} if together else summaries[0])
    elif together:
        print_together(together)
    figures.draw(file.name, evaluation, recording, together, overwrite)
    return 0


def check_different(files: Sequence[Path]) -> None:
    """Raise InputError if a file is given twice."""
    from teleop.errors import InputError

    found: set[Path] = set()
    for path in files:
        if path.resolve() in found:
            raise InputError(f"{path} is given twice: expected different recordings")
        found.add(path.resolve())


def writer(file: BinaryIO | None) -> Callable[[Table], None] | None:
    """What writes the blocks of a table to a file; None without a file."""
    if not file:
        return None
    from teleop.recording.export_formats import TableFile

    return TableFile(file).write


def material(evaluation: Evaluation, tip: Indenter | None) -> dict[str, Any]:
    """The elastic modulus for the summary, if there is a tip and the stiffness is identifiable."""
    analysis = evaluation.analysis
    if not (tip and analysis.result.identifiable):
        return {}
    from teleop.evaluation.batch.material import elastic_modulus
    from teleop.evaluation.online.datum import CHOSEN

    datum = evaluation.datum
    stated = (datum.x, datum.f) if datum.source in CHOSEN else None
    return {"material": elastic_modulus(analysis, tip, stated)}


def recorded(evaluation: Evaluation, recording: Recording | None) -> dict[str, Any]:
    """What the summary contains only for a recorded trial."""
    if not recording:
        return {}
    from teleop.recording.gaps import gap_rows

    return {
        "as_online": evaluation.online.as_recorded and not recording.gaps,
        "missing_ticks": gap_rows(recording.gaps),
        "missing_estimates": evaluation.online.unrecorded,
        "estimated_channels": recording.estimated_channels,
    }
