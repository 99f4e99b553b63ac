"""The reproduction as one self-contained HTML page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from string import Template

from sim_backend import CUBES
from teleop.control.conditions import CONDITIONS
from teleop.output.web_page import captioned, table, web_page
from teleop.studies.paper.claims import Claim
from teleop.studies.paper.methods import MethodResult
from teleop.studies.paper.study import RESPONSES, Effect, finding
from teleop.studies.paper.table1 import ESTIMATORS, is_calibrated, table1
from teleop.studies.paper.trials import Outcome, SlowTrial

ABOUT = """
<p>Yamamoto, Bernhardt, Peer, Buss and Okamura palpated three silicone cubes through a 1-DOF
telemanipulator under three control conditions, and estimated stiffness and damping by recursive
least squares (RLS), adaptive identification (AI) and the multi-estimator (ME). This page runs the
same nine trials of 10 s at 1 kHz on the simulated rig, with the paper's estimator settings, through
the same loop as <code>teleop run</code>.</p>
<p>The rig is calibrated against 12 of the paper's 81 numbers: b and k of RLS under the conditions
free and autonomous (shaded in the table), by
<code>python -m teleop.studies.paper.calibrate</code>. Fitted
are each cube's stiffness and stiffening and the lag of the force channel in its trials, which
stands in for whatever else differed between them. Depths, the frequency of the autonomous sine and
the cubes' true damping are assumptions; depth and frequency were chosen such that AI rises as fast
as the paper's figures show, so its rise time is no independent
prediction. All other numbers are predictions.</p>
"""

DAMPING = """
<p>The paper leaves its negative damping to "limitations of the model or noise". In simulation the
true damping is known, and two causes explain it. A force channel that lags by &tau; turns b into
b &minus; k&tau;. And a stiffening body has, about a point, the slope of the tangent but the offset
of the secant, which a Kelvin-Voigt fit puts into b. Passing position through the force channel's
own lag and all signals through one filter (matched) removes the first, a regressor x&sup3; the
second.</p>
"""

SLOW = """
<p>The lag has to be known: declared, or measured on a reference spring by <code>teleop lag</code>.
To first order b and &tau; enter a trial only as b &minus; k&tau;. These are the 95 % intervals of
both when each is fitted together with k and k<sub>3</sub> to one autonomous trial on the medium
cube, whose true damping is $b N s/m and true lag $lag ms. The slower the motion, the less one trial
tells them apart. At higher frequencies it does so only as far as the body really is one of this
model, which is certain in simulation alone.</p>
"""


def table_one(outcomes: Sequence[Outcome]) -> str:
    """The paper's Table I, its numbers below ours."""
    by_trial = {(outcome.condition, outcome.cube): outcome for outcome in outcomes}
    rows = []
    for condition in CONDITIONS:
        for estimator in ESTIMATORS:
            row = [f"{condition} {estimator.upper()}"]
            for cube in CUBES:
                ours = by_trial[condition, cube].estimates[estimator]
                paper = table1()[condition, cube, estimator]
                for name, digits in (("b", 1), ("k", 0), ("e_f", 2)):
                    calibrated = is_calibrated(condition, estimator) and name != "e_f"
                    row.append(
                        f"<td{' class=calibrated' if calibrated else ''}>{ours[name]:.{digits}f}"
                        f"<br><span class=paper>{getattr(paper, name):.{digits}f}</span></td>"
                    )
            rows.append(row)
    header = [""] + [
        f"{cube}<br>{unit}" for cube in CUBES for unit in ("b [N s/m]", "k [N/m]", "e_f [N]")
    ]
    return table(header, rows)


def claims_table(claims: Sequence[Claim]) -> str:
    """Each claim with what became of it."""
    return table(
        ["claim", "here", "evidence"],
        [
            [
                escape(claim.claim),
                "<td class=holds>holds</td>" if claim.holds else "<td class=fails>does not</td>",
                f"<td class=left>{escape(claim.evidence)}</td>",
            ]
            for claim in claims
        ],
    )


def damping_table(outcomes: Sequence[Outcome]) -> str:
    """Damping of each trial, its causes of error removed one by one."""
    return table(
        [
            "b [N s/m]",
            "paper, RLS",
            "RLS the paper's way",
            "matched",
            "matched, with x&sup3;",
            "true",
        ],
        [
            [
                f"{outcome.condition} {outcome.cube}",
                f"<td class=paper>{outcome.damping.paper:.1f}</td>",
                f"{outcome.damping.rls:.1f}",
                f"{outcome.damping.matched:.1f}",
                f"{outcome.damping.stiffening:.2f}",
                f"{outcome.damping.true:g}",
            ]
            for outcome in outcomes
        ],
    )


def slow_table(slow: Sequence[SlowTrial]) -> str:
    """What one trial tells of lag and damping together, by the speed of its motion."""
    return table(
        ["frequency [Hz]", "&tau; [ms]", "95 % interval", "b [N s/m]", "95 % interval"],
        [
            [
                f"{trial.frequency:g}",
                f"{trial.lag.value * 1e3:.2f}",
                f"{trial.lag.low * 1e3:.2f} to {trial.lag.high * 1e3:.2f}",
                f"{trial.b.value:.1f}",
                f"{trial.b.low:.1f} to {trial.b.high:.1f}",
            ]
            for trial in slow
        ],
    )


METHODS = """
<h2>Other methods on the same trials</h2>
<p>All had the same signals, matched, with the force channel's lag made up for, and one preset for
all cubes. The truth is the cube's damping, and its stiffness against the displacement of each
sample, or at the surface for a stiffening model. Averages over all trials from the end of the first
second on: root mean square errors (b in N s/m), how often the 95 % interval held the truth, rise
time of the stiffness, force error, the one-step force error over that of batch least squares over
the last second, and how often the estimate was held.</p>
"""
METHOD_HEADINGS = (
    "",
    "k error",
    "b error",
    "k within",
    "b within",
    "rise [s]",
    "e_f [N]",
    "rms/batch",
    "held",
)


def method_cells(methods: Mapping[str, MethodResult]) -> list[list[str]]:
    """The table of methods as text, a row each, below `METHOD_HEADINGS`."""

    def share(value: float, digits: int = 0) -> str:
        return f"{value:.{digits}%}" if math.isfinite(value) else "-"

    return [
        [
            name,
            share(row.k_error, 1),
            f"{row.b_error:.1f}",
            share(row.k_coverage),
            share(row.b_coverage),
            f"{row.rise_time_s:.3f}" if math.isfinite(row.rise_time_s) else "-",
            f"{row.e_f:.3f}",
            f"{row.one_step_ratio:.2f}",
            share(row.held),
        ]
        for name, row in methods.items()
    ]


def methods_section(methods: Mapping[str, MethodResult]) -> str:
    """The table of methods, or how to get it."""
    if not methods:
        return (
            "<h2>Other methods on the same trials</h2><p>Not asked: "
            "<code>teleop reproduce --estimators all</code> compares them.</p>"
        )
    return METHODS + table(METHOD_HEADINGS, method_cells(methods))


def study_section(study: Mapping[str, Sequence[Effect]], seeds: int) -> str:
    """The analysis of variance, or how to get it."""
    text = "<h2>Does only the estimator matter?</h2>"
    if not study:
        return (
            text + "<p>Not asked: <code>teleop reproduce --seeds 20</code> repeats the trials.</p>"
        )
    text += (
        f'<p>The paper finds that "only the choice of the estimation algorithm has an effect on '
        f'estimation performance". Analysis of variance over {seeds} repetitions of the nine '
        "trials; cube and condition vary between trials, the estimator within.</p>"
    )
    for name, effects in study.items():
        text += f"<p><b>{RESPONSES[name]}.</b> {escape(finding(effects))}</p>"
        text += table(
            ["effect", "F", "degrees of freedom", "p", "&eta;&sup2;", "partial &eta;&sup2;"],
            [
                [
                    effect.source.replace(" x ", " &times; "),
                    f"{effect.f:.1f}",
                    f"{effect.degrees}, {effect.error_degrees}",
                    "&lt; 0.001" if effect.p < 0.001 else f"{effect.p:.3f}",
                    f"{effect.eta_squared:.3f}",
                    f"{effect.partial_eta_squared:.3f}",
                ]
                for effect in effects
            ],
        )
    return text


def reproduction_page(
    outcomes: Sequence[Outcome],
    claims: Sequence[Claim],
    figures: Mapping[str, str],
    slow: Sequence[SlowTrial],
    study: Mapping[str, Sequence[Effect]],
    seeds: int,
    methods: Mapping[str, MethodResult],
) -> str:
    """The whole page.

    Parameters
    ----------
    outcomes
        The nine trials of one seed.
    claims
        What became of the paper's claims.
    figures
        SVG elements by caption.
    slow
        What one trial tells of lag and damping.
    study
        Effects by response; empty where there is one seed.
    seeds
        Repetitions of the nine trials.
    methods
        Further methods on average over the trials; empty where none were asked for.
    """
    first = slow[0]
    lag_text = Template(SLOW).substitute(b=f"{first.true_b:g}", lag=f"{first.true_lag * 1e3:g}")
    drawings = "".join(captioned(drawing, caption) for caption, drawing in figures.items())
    title = "Techniques for environment parameter estimation during telemanipulation, reproduced"
    body = f"""<h1>{title}</h1>{ABOUT}
<h2>Table I</h2><p>Ours, and below it <span class=paper>the paper's</span>.
<span class=calibrated>Shaded</span>: calibrated.</p>{table_one(outcomes)}
<h2>What the paper says</h2>{claims_table(claims)}
<h2>Figures</h2>{drawings}
<h2>Why the damping is negative</h2>{DAMPING}{damping_table(outcomes)}{lag_text}{slow_table(slow)}
{methods_section(methods)}{study_section(study, seeds)}"""
    return web_page(title, body)
