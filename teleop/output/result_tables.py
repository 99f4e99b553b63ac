"""Print results of evaluations: k and b of a file, fitted models, and fits to several files."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from estimation.quantities import DAMPING, STIFFNESS, Quantity, quantity
from teleop.output.console import number, plain_console, print_table, small, terminal_width
from teleop.printable import wrapped

MOST_DIGITS = 6
"""Largest number of significant digits of a printed value, also if its interval is narrower."""
LARGE, LITTLE = 1e7, 1e-3
"""Values from `LARGE` on, and values below `LITTLE`, are printed with a power of ten."""


def print_result(summary: Mapping[str, Any], name: str) -> None:
    """Print the result of a file or trial: whether k and b can be used, their values, remarks."""
    console = plain_console()
    result = summary["result"]
    style = "bold" if result["identifiable"] else "bold red"
    console.print(f"{name}: {use_text(result)}", style=style)
    if result["identifiable"]:
        values = len(result_values(result))
        for i, line in enumerate(result_lines(summary)):
            console.print(f"  {line}", style="bold" if i < values else None)
        for line in tangent_lines(result)[:1]:
            console.print(f"  {line}")
    for reason in further_reasons(result):
        print_item(console, reason, "yellow" if result["identifiable"] else "red")
    for hint in result["hints"]:
        console.print(f"  hint: {hint}")
    if summary.get("material"):
        print_material(summary["material"])


def print_item(console: Console, text: str, style: str | None = None) -> None:
    """Print an item of a list, whose lines after the first one are indented."""
    lines = wrapped(text, terminal_width() - 4).split("\n")
    console.print("\n    ".join([f"  - {lines[0]}", *lines[1:]]), style=style)


def use_text(result: Mapping[str, Any]) -> str:
    """Return in plain words whether k and b can be used; if not, why."""
    if not result["identifiable"]:
        why = "".join(f", because {reason}" for reason in result["reasons"][:1])
        return f"k and b cannot be used{why}"
    if result["b_reason"]:
        return f"k can be used; b cannot, because {result['b_reason']}"
    return "k and b can be used"


def further_reasons(result: Mapping[str, Any]) -> list[str]:
    """Return the reasons and remarks that `use_text` does not contain."""
    if not result["identifiable"]:
        return list(result["reasons"][1:])
    return [reason for reason in result["reasons"] if reason != result["b_reason"]]


def print_result_details(summary: Mapping[str, Any]) -> None:
    """Print the secant and complex stiffness, the motion with its phases, and the contact point."""
    console = plain_console()
    result = summary["result"]
    for line in tangent_lines(result)[1:]:
        console.print(f"  {line}")
    for line in complex_lines(summary):
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


CORRECTIONS = (
    ("a lag", "force_lag_s", 1e3, "ms"),
    ("lost motion", "lost_motion_m", 1e6, "um"),
)
"""Corrections of the result: name, key in the summary, factor and unit of the shown value."""


class ShownValue(NamedTuple):
    """A value of the result as a person sees it. All numbers are texts."""

    name: str
    symbol: str
    value: str
    """The value; empty if it is not determined."""
    unit: str
    low: str
    """Lower end of the 95 % interval."""
    high: str
    usable: bool
    """Whether the value can be used."""


def result_values(result: Mapping[str, Any]) -> list[ShownValue]:
    """Return k, k at the tip if it is known, and b of a result; none if k cannot be given."""
    if not result["identifiable"]:
        return []
    values = []
    tip = result["k_tip"]
    for one in (STIFFNESS, DAMPING):
        usable = one is STIFFNESS or not result["b_reason"]
        ends = [result[f"{one.symbol}{end}"] for end in ("_low", "", "_high")]
        values.append(shown_value(one, one.name, one.symbol, ends, usable))
        if one is STIFFNESS and tip:
            ends = [tip["low"], tip["value"], tip["high"]]
            values.append(shown_value(one, "", f"{one.symbol} at the tip", ends, usable))
    return values


def shown_value(
    one: Quantity, name: str, symbol: str, ends: Sequence[float | None], usable: bool
) -> ShownValue:
    """Return how a quantity is shown; `ends` are the low end, the value and the high end."""
    low, value, high = ends
    if low is None or value is None or high is None:
        return ShownValue(name, symbol, "", one.unit, "", "", False)
    decimals = shown_decimals(one.shown(value), one.shown(high - low))
    texts = [rounded(one.shown(each), decimals) for each in (value, low, high)]
    return ShownValue(name, symbol, texts[0], one.unit, texts[1], texts[2], usable)


def result_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return lines of text with stiffness, damping and their 95 % intervals, and what they are.

    If the data are not sufficient for stiffness and damping, the only line states that these cannot
    be given.
    """
    result = summary["result"]
    if not result["identifiable"]:
        return ["no stiffness and no damping can be given:"]
    lines = [
        f"{one.name:9} {one.symbol} = {one.value} {one.unit} "
        f"(95 % interval {one.low} to {one.high})"
        if one.value
        else f"{one.name:9} {one.symbol} is not determined"
        for one in result_values(result)
    ]
    return [*lines, *meaning_lines(summary)]


def meaning_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return what kind of damping b is, and for what k and b are corrected; none without k."""
    result = summary["result"]
    if not result["identifiable"]:
        return []
    lines = []
    frequency = result["damping_at_hz"]
    if result["b"] is not None and frequency is not None:
        lines.append(f'b is the equivalent viscous damping k"/omega at {frequency:.3g} Hz')
    if result["b"] is not None and result["friction_n"]:
        lines.append("b is the damping besides the friction in the specimen")
    elif result["b"] is not None and result["damping_by_depth"]:
        lines.append("b is the damping at the depth of k")
    transmission = summary.get("transmission") or {}
    corrected = [
        f"{name} of {factor * transmission[key]:.3g} {unit}"
        for name, key, factor, unit in CORRECTIONS
        if transmission.get(key)
    ]
    if result["k_tip"]:
        lines.append("k and b are those of specimen and transmission in series")
    if corrected:
        lines.append(f"k and b are corrected for {' and '.join(corrected)}")
    return lines


def with_interval(one: Quantity, low: float, value: float, high: float) -> str:
    """Return a value with its unit and its 95 % interval, from values in SI units."""
    shown = shown_value(one, "", "", (low, value, high), usable=True)
    return f"{shown.value} {one.unit} (95 % interval {shown.low} to {shown.high})"


def true_numbers(true: Mapping[str, float]) -> list[str]:
    """Return true k, k at the tip, b and b at the tip in shown units, without the units."""
    parts = ((STIFFNESS, "k", 5), (STIFFNESS, "k_tip", 5), (DAMPING, "b", 4), (DAMPING, "b_tip", 4))
    return [small(one.shown(true[name]), digits) for one, name, digits in parts]


def motion_line(summary: Mapping[str, Any]) -> str:
    """Return frequency, amplitude and travel of the motion; with few strokes, their number."""
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


def complex_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return k' and k'' of a sine where k is a tangent, and the slope of the measured force."""
    lines = []
    result, stiffness = summary["result"], summary["complex_stiffness"]
    if stiffness and result["storage_at_hz"] is None:
        storage, loss = (
            shown_half(
                STIFFNESS, stiffness[f"{name}_n_per_m"], stiffness[f"{name}_interval_n_per_m"]
            )
            for name in ("storage", "loss")
        )
        lines.append(
            f"over whole cycles at {stiffness['frequency_hz']:.3g} Hz: storage stiffness k' = "
            f'{storage} {STIFFNESS.unit}, loss stiffness k" = {loss} {STIFFNESS.unit}'
        )
    if loading := result["loading"]:
        slope = loading["slope_n_per_m"]
        shown = with_interval(STIFFNESS, slope["low"], slope["value"], slope["high"])
        lines.append(
            f"slope of the measured force in loading at {loading['force_n']:.3g} N, "
            f"{loading['depth_m'] * 1e3:.3g} mm: {shown}; k is that of the elastic force"
        )
    return lines


SLOWER = ", at the speed of this motion: the force relaxes, so that k is smaller in slower motion"
"""End of the sentence on k of a body that relaxes: k contains the relaxing force in loading."""


def tangent_lines(result: Mapping[str, Any]) -> list[str]:
    """Return what k is and where, and the secant stiffness there if it is known."""
    tangent = result["tangent"]
    if tangent["force_n"] is None:
        return []
    what = "tangent stiffness"
    if result["storage_at_hz"] is not None:
        what = (
            f"storage stiffness k' at {result['storage_at_hz']:.3g} Hz, and the tangent stiffness"
        )
    speed = "" if result["storage_at_hz"] or not result["relaxation_times_s"] else SLOWER
    lines = [
        f"k is the {what} at {tangent['force_n']:.3g} N, "
        f"{tangent['depth_m'] * 1e3:.3g} mm from the {tangent['depth_from']}{speed}"
    ]
    if tangent["secant_n_per_m"] is not None:
        lines.append(
            f"secant there {STIFFNESS.text(tangent['secant_n_per_m'], '.4g')}; it changes by "
            f"{tangent['secant_change_per_0.1mm']:.1%} for a datum error of 0.1 mm"
        )
    return lines


def print_material(material: Mapping[str, Any]) -> None:
    """Print the result of `elastic_modulus`."""
    low, value, high = (material[f"modulus{end}_pa"] for end in ("_low", "", "_high"))
    plain_console().print(
        f"  elastic modulus E = {value / 1e3:.4g} kPa "
        f"(95 % interval {low / 1e3:.4g} to {high / 1e3:.4g})\n    {material['method']}",
        style="bold",
    )


def print_models(summary: Mapping[str, Any]) -> None:
    """Print the models that were fitted to all samples, the best first."""
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
    console.print(
        "  k of kelvin-voigt: average over the recording, k' in a sine; k of stiffening: tangent "
        "at the datum"
    )
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
    """Return name, value, half width of the 95 % interval and unit of a `Parameter`."""
    if not one["identifiable"]:
        return f"{name} not identifiable"
    half, shown_as = 0.5 * (one["high"] - one["low"]), quantity(name, one["unit"])
    return f"{name} {shown_half(shown_as, one['value'], half)} {shown_as.unit}".removesuffix(" -")


def with_half(value: float, half: float) -> str:
    """Return "value \u00b1 half": two significant digits of the half width, if it is known.

    A value has at most `MOST_DIGITS` significant digits. If the half width is less than the last of
    them, it is rounded up to it.
    """
    if not math.isfinite(half) or half <= 0.0:
        return small(value, 4)
    size = max(abs(value), half)
    if abs(value) >= LARGE or size < LITTLE:
        power = math.floor(math.log10(size))
        return f"({with_half(value / 10.0**power, half / 10.0**power)})e{power}"
    decimals = shown_decimals(value, half)
    return f"{rounded(value, decimals)} \u00b1 {rounded(max(half, 10.0**-decimals), decimals)}"


def shown_half(quantity: Quantity, value: float, half: float) -> str:
    """Return an SI value and its half width as text in the shown unit (see `with_half`)."""
    return with_half(quantity.shown(value), quantity.shown(half))


def shown_decimals(value: float, width: float) -> int:
    """Return the decimals that show the second significant digit of the uncertainty `width`.

    They are negative if digits before the point are uncertain. The value has at most `MOST_DIGITS`
    significant digits.
    """
    most = MOST_DIGITS - 1 - (math.floor(math.log10(abs(value))) if value else 0)
    return min(1 - math.floor(math.log10(width)), most) if width > 0.0 else min(3, most)


def rounded(value: float, decimals: int) -> str:
    """Return a value with a number of decimals, which is negative to round before the point."""
    return number(round(value, decimals), max(decimals, 0))


def print_together(together: Mapping[str, Any]) -> None:
    """Print the result of `evaluate_together`: fits, complex stiffness, ratios and conclusions."""
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
    if together["complex_stiffness"]:
        print_table(
            console,
            "complex stiffness",
            ("", "f [Hz]", f"k' [{STIFFNESS.unit}]", f'k" [{STIFFNESS.unit}]', "tan delta"),
            (
                [
                    Path(row["file"]).name,
                    small(row["frequency_hz"]),
                    shown_half(STIFFNESS, row["storage_n_per_m"], row["storage_interval_n_per_m"]),
                    shown_half(STIFFNESS, row["loss_n_per_m"], row["loss_interval_n_per_m"]),
                    with_half(row["tan_delta"], row["tan_delta_interval"]),
                ]
                for row in together["complex_stiffness"]
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
