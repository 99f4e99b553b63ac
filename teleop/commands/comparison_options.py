"""The options of the factors of files, and of the statistics of their results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from cyclopts import Parameter

from teleop.commands.options import FACTORS

if TYPE_CHECKING:
    from teleop.evaluation.across.comparison import Compared
    from teleop.output.table_files import TextTable
    from teleop.studies.result_statistics import RepeatedResults

ONLINE = {"k_online": "k", "b_online": "b", "e_f": "e_f", "rise_time_s": "rise_time_s"}
"""Responses of --anova that are averages of the online estimators, and their names in a summary."""


class Statistics(NamedTuple):
    """A statistical analysis, in the forms of the outputs."""

    name: str
    """End of the name of its CSV file."""
    title: str
    table: TextTable
    rows: list[dict[str, Any]]
    """Rows of the CSV file."""
    document: dict[str, Any]
    """Entries of the JSON document."""


@dataclass(frozen=True)
class ComparisonOptions:
    """Options that state the factors of the files, and the statistics of the results."""

    factors: str | None = None
    """The factors of the files: a pattern of their names, such as {subject}/{specimen}_rep{n}.csv,
    relative to the folder; or a CSV file whose first column names the files, and whose other
    columns are factors. Files whose factors it does not state are reported and left out."""
    by: str | None = None
    """Names of the factors by which the recordings are grouped, separated by commas. Each is a
    factor of --factors or of the series; a setting of the recordings, such as condition, cube, rig
    or seed; or the word folder. Default: the factors of --factors or of the series, and specimen
    and cube, if they have two or more levels; without subject and repetition."""
    anova: Literal["k", "k_tip", "b", "k_online", "b_online", "e_f", "rise_time_s"] | None = None
    """Analysis of variance of the results by the factors of --by, with a mixed model in which each
    recording is weighted by its 95 % interval: of k, the stiffness at the tip (k_tip) or b. Or
    analysis of variance of a result of the online estimators:
    average stiffness (k_online), damping (b_online), force error (e_f) or rise time (rise_time_s).
    These need the extra stats, and the estimator is a further factor."""
    random: str | None = None
    """Random factor of the analysis of variance of results, or none. treatment:specimen is for
    specimens whose numbers begin again in each treatment. Default: subject, specimen or cube, if it
    is not in --by and has repeated recordings."""
    repeatability: Literal["k", "k_tip", "b"] | None = None
    """Repeatability of the results: intraclass correlations, standard deviation within objects, and
    limits of agreement (Bland-Altman) of two levels."""
    over: str | None = None
    """Factor whose levels --repeatability compares, such as operator, or some of its levels, such
    as n=1,2. Default: the factor repetition, n, rep, repeat, replicate or trial."""
    log: bool = False
    """Use the logarithms of the results in these statistics, for a spread that is proportional to
    the value. Differences are then stated as ratios."""

    def check(self) -> None:
        """Raise InputError for an option that has no effect."""
        from teleop.errors import InputError

        on_results = self.anova is not None and self.anova not in ONLINE
        for name, given, useful, needed in (
            ("random", self.random is not None, on_results, "--anova k, k_tip or b"),
            ("over", self.over is not None, self.repeatability, "--repeatability"),
            ("log", self.log, on_results or self.repeatability, "--anova or --repeatability"),
        ):
            if given and not useful:
                raise InputError(f"--{name}: expected with {needed}")

    def anova_of(
        self, rows: Sequence[Compared], by: Sequence[str], stated: Sequence[str]
    ) -> Statistics | None:
        """Return the analysis of variance; None if the option is not given."""
        if not self.anova:
            return None
        from teleop.output.statistics_tables import effects_on_result_table
        from teleop.studies.anova import effects_of, effects_table
        from teleop.studies.result_statistics import effects_on_results

        components: dict[str, float] = {}
        if self.anova in ONLINE:
            effects, design = effects_of(rows, by, stated, ONLINE[self.anova])
            table = effects_table(effects, self.anova, design)
        else:
            tested = effects_on_results(rows, by, self.anova, self.random, stated, self.log)
            effects = [one._asdict() for one in tested.model.effects]
            components = tested.model.components | {"intervals": tested.model.error}
            design = " ".join(tested.notes)
            table = effects_on_result_table(tested.model, self.anova, tested.notes)
        document = {"anova": effects, "anova_design": design, "anova_components": components}
        tidy = [{"response": self.anova, **effect, "design": design} for effect in effects]
        return Statistics("anova", "analysis of variance", table, tidy, document)

    def repeated(
        self,
        rows: Sequence[Compared],
        stated: Sequence[str],
        planned: Mapping[str, Sequence[str]],
    ) -> RepeatedResults | None:
        """Return the repeatability; None if the option is not given."""
        if not self.repeatability:
            return None
        from teleop.studies.result_statistics import repeated_results

        return repeated_results(rows, self.repeatability, stated, self.over, self.log, planned)


def repeatability_statistics(found: RepeatedResults) -> Statistics:
    """Return the repeatability in the forms of the outputs."""
    from teleop.output.statistics_tables import measures_table

    table = measures_table(found.symbol, found.measures, found.notes)
    notes = " ".join(found.notes)
    rows = [
        {
            "response": found.symbol,
            "quantity": one.quantity,
            **one.interval._asdict(),
            "unit": one.unit,
            "notes": notes,
        }
        for one in found.measures
    ]
    document = {"repeatability": found.summary()}
    return Statistics("repeatability", "repeatability", table, rows, document)


Comparison = Annotated[ComparisonOptions, Parameter(name="*", group=FACTORS)]
WITHOUT_STATISTICS = ComparisonOptions()
