"""Print results of evaluations: k and b of a file, fitted models, and fits to several files."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from estimation.quantities import DAMPING, STIFFNESS, Quantity, quantity
from teleop.evaluation.batch.kinds import UNDETERMINED
from teleop.output.console import number, plain_console, print_table, small

MOST_DECIMALS = 12
"""Largest number of decimals of a printed value."""


def print_result(summary: Mapping[str, Any], name: str) -> None:
    """Print the result of the evaluation of a file: k and b, or the reasons why there are none.

    The motion in the file, its phases and the contact point are also printed.

    Parameters
    ----------
    summary
        The dictionary that `Evaluation.summary` returned.
    name
        Name of the file.
    """
    console = plain_console()
    result = summary["result"]
    console.print(f"{name}: result", style="bold")
    style = "bold" if result["identifiable"] else "bold red"
    for line in result_lines(summary):
        console.print(f"  {line}", style=style)
    for reason in result["reasons"]:
        style = "yellow" if result["identifiable"] else "red"
        console.print(f"  - {reason}", style=style)
    for hint in result["hints"]:
        console.print(f"  hint: {hint}")
    for line in tangent_lines(result["tangent"]):
        console.print(f"  {line}")
    console.print(f"  {motion_line(summary)}")
    counts = Counter(phase["phase"] for phase in summary["phases"])
    phases = ", ".join(f"{count} {phase}" for phase, count in counts.items())
    console.print(f"  phases: {phases}")
    if summary["contact_point"]:
        position, low, high = summary["contact_point"].values()
        console.print(
            f"  contact point: {position * 1e3:.4g} mm "
            f"(95 % interval {low * 1e3:.4g} to {high * 1e3:.4g})"
        )
    kept = summary["kept_force_variance"]
    console.print(f"  the filter of the online estimators keeps {kept:.0%} of the force variance")
    if summary.get("material"):
        print_material(summary["material"])


def result_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return lines of text with stiffness, damping and their 95 % intervals.

    A further line states how much a lag of the force changes b. If the data are not sufficient for
    stiffness and damping, the only line states that these cannot be given.
    """
    result = summary["result"]
    if not result["identifiable"]:
        return ["no stiffness and no damping can be given:"]
    lines = []
    for one in (STIFFNESS, DAMPING):
        values = [result[f"{one.symbol}{end}"] for end in ("_low", "", "_high")]
        if values[2] - values[0] < UNDETERMINED:
            lines.append(f"{one.name:9} {one.symbol} is not determined")
            continue
        width = one.shown(values[2] - values[0])
        low, value, high = (significant(one.shown(each), width) for each in values)
        lines.append(
            f"{one.name:9} {one.symbol} = {value} {one.unit} (95 % interval {low} to {high})"
        )
    if (frequency := result["damping_at_hz"]) is not None:
        lines.append(f'b is the equivalent viscous damping k"/omega at {frequency:.3g} Hz')
    change = result["b_change_per_ms_of_lag"]
    ratio = change / max(abs(result["b"]), UNDETERMINED)
    times = f" ({ratio:.2g} times b)" if abs(result["b"]) > UNDETERMINED else ""
    lines.append(f"1 ms of lag of the force changes b by {DAMPING.text(change, '.3g')}{times}")
    return lines


def motion_line(summary: Mapping[str, Any]) -> str:
    """Return a line of text with frequency, amplitude and travel of the motion in a file.

    The travel is the largest minus the smallest position. If the file contains too few strokes for
    a frequency, the line states their number instead of frequency and amplitude.
    """
    motion = summary["motion"]
    travel = f"travel {motion['travel_m'] * 1e3:.3g} mm"
    if not math.isfinite(motion["frequency_hz"]):
        from teleop.evaluation.batch.thresholds import (
            FEWEST_STROKES,  # imports scipy, which takes long
        )

        count = motion["strokes"]
        if not count:
            return f"motion: no cycles, {travel}"
        strokes = "1 whole stroke" if count == 1 else f"{count} whole strokes"
        return f"motion: {strokes}, too few for a frequency (expected {FEWEST_STROKES}), {travel}"
    return (
        f"motion: {motion['frequency_hz']:.3g} Hz, amplitude {motion['amplitude_m'] * 1e3:.3g} mm "
        f"(half of a stroke), {travel}"
    )


def tangent_lines(tangent: Mapping[str, Any]) -> list[str]:
    """Return lines of text that state at which force and depth k is the tangent stiffness.

    A second line states the secant stiffness (force divided by depth) at this point, if it is
    known. There are no lines if the data are not sufficient for k.

    Parameters
    ----------
    tangent
        The item `tangent` of the dictionary that `StiffnessResult.summary` returned.
    """
    if tangent["force_n"] is None:
        return []
    lines = [
        f"k is the tangent stiffness at {tangent['force_n']:.3g} N, "
        f"{tangent['depth_m'] * 1e3:.3g} mm from the {tangent['depth_from']}"
    ]
    if tangent["secant_n_per_m"] is not None:
        lines.append(
            f"secant there {STIFFNESS.text(tangent['secant_n_per_m'], '.4g')}; it changes by "
            f"{tangent['secant_change_per_0.1mm']:.1%} for a datum error of 0.1 mm"
        )
    return lines


def print_material(material: Mapping[str, Any]) -> None:
    """Print the elastic modulus of the specimen, its 95 % interval, and how it was computed.

    `material` is the dictionary that `elastic_modulus` returned.
    """
    low, value, high = (material[f"modulus{end}_pa"] for end in ("_low", "", "_high"))
    plain_console().print(
        f"  elastic modulus E = {value / 1e3:.4g} kPa "
        f"(95 % interval {low / 1e3:.4g} to {high / 1e3:.4g})\n    {material['method']}",
        style="bold",
    )


def print_models(summary: Mapping[str, Any]) -> None:
    """Print the models that were fitted to all samples of a file together, the best model first.

    `summary` is the dictionary that `Evaluation.summary` returned.
    """
    console = plain_console()
    models = summary["models"]
    if not models:
        console.print("batch models: none is fitted, see the reasons above")
        return
    print_table(
        console,
        "batch models, the best first",
        ("", "R^2", "rms [N]", "BIC", "autocorr."),
        (
            [
                fit["name"],
                f"{fit['r2']:.4f}",
                small(fit["rms"]),
                number(fit["bic"] - models[0]["bic"], 0),
                f"{fit['residual_autocorrelation']:.2f}",
            ]
            for fit in models
        ),
    )
    console.print("  rms: error of the predicted force, which includes the noise of the sensor")
    best = summary["best_model"]
    if best is not None and best != models[0]["name"]:
        console.print(
            f"  {best}: the best model whose parameters are all identifiable, drawn by --plot-fit"
        )
    if summary["contact_point"] is None:
        console.print(
            "  hunt-crossley: the force out of contact is not known, and is taken as 0 N of the "
            f"file; xc is relative to the datum ({summary['datum']['source']})"
        )
    for fit in models:
        cells = [parameter_text(name, one) for name, one in fit["parameters"].items()]
        console.print(f"  {fit['name']}: {', '.join(cells)}")


def parameter_text(name: str, one: Mapping[str, Any]) -> str:
    """Return the estimate of a parameter, and the half width of its 95 % interval, as text.

    If the data do not determine the parameter, the text is its name and "not identifiable".

    Parameters
    ----------
    name
        Name of the parameter.
    one
        The fields of its `Parameter` (value, interval, unit, and whether it is identifiable).
    """
    if not one["identifiable"]:
        return f"{name} not identifiable"
    half, shown_as = 0.5 * (one["high"] - one["low"]), quantity(name, one["unit"])
    return f"{name} {shown_half(shown_as, one['value'], half)} {shown_as.unit}".removesuffix(" -")


def with_half(value: float, half: float) -> str:
    """Return a value and the half width of its confidence interval as text: "value +- half".

    The half width has two significant digits, and the value has the same number of decimals. If the
    half width is zero or not finite, the text is only the value.
    """
    if not math.isfinite(half) or half <= 0.0:
        return small(value, 4)
    return f"{significant(value, half)} \u00b1 {significant(half, half)}"


def shown_half(quantity: Quantity, value: float, half: float) -> str:
    """Return an SI value and its half width as text in the shown unit (see `with_half`)."""
    return with_half(quantity.shown(value), quantity.shown(half))


def significant(value: float, width: float) -> str:
    """Return a value as text, rounded according to its uncertainty.

    Parameters
    ----------
    value
        The value.
    width
        Uncertainty of the value, in the unit of the value. The value is rounded to the decimal
        place of the second significant digit of this uncertainty.
    """
    decimals = 3
    if width > 0.0:
        decimals = min(1 - math.floor(math.log10(width)), MOST_DECIMALS)
    return number(round(value, decimals), max(decimals, 0))


def print_together(together: Mapping[str, Any]) -> None:
    """Print whether one Kelvin-Voigt body (f = b v + k x) explains several files.

    The first table contains k and b of a fit to each file, and of one fit to all files together.
    The second table contains the complex modulus of each file. Then follow the ratio of the largest
    to the smallest k, the same ratio for b, and the conclusions as text.

    Parameters
    ----------
    together
        The dictionary that `evaluate_together` returned.
    """
    console = plain_console()
    names = [Path(row["file"]).name for row in together["alone"]]
    if len(set(names)) < len(names):
        names = [row["file"] for row in together["alone"]]
    rows = [*zip(names, together["alone"], strict=True), ("all together", together)]
    print_table(
        console,
        "least squares of Kelvin-Voigt, one by one and together",
        ("", STIFFNESS.heading, DAMPING.heading, "residual [N rms]"),
        (
            [name, STIFFNESS.number(row["k"]), DAMPING.number(row["b"]), small(row["rms"])]
            for name, row in rows
        ),
    )
    if together["modulus"]:
        print_table(
            console,
            "complex modulus",
            ("", "f [Hz]", f"k' [{STIFFNESS.unit}]", f'k" [{STIFFNESS.unit}]', "tan delta"),
            (
                [
                    Path(row["file"]).name,
                    small(row["frequency_hz"]),
                    shown_half(STIFFNESS, row["storage"], row["storage_interval"]),
                    shown_half(STIFFNESS, row["loss"], row["loss_interval"]),
                    f"{row['tan_delta']:.3f} \u00b1 {row['tan_delta_interval']:.1g}",
                ]
                for row in together["modulus"]
            ),
        )
    for symbol, ratio in together["ratios"].items():
        if not math.isfinite(ratio["ratio"]):
            continue
        console.print(
            f"  largest {symbol} over smallest: {ratio['ratio']:.3g} "
            f"(95 % interval {ratio['low']:.3g} to {ratio['high']:.3g})"
        )
    style = "bold red" if together["insufficient"] else None
    for reason in together["reasons"]:
        console.print(f"  {reason}", style=style)
