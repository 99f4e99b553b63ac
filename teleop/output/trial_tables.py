"""Print the results of a trial: estimates, true values, timing of the loop, safety, recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console

from estimation.expected_intervals import half_width_text
from estimation.quantities import DAMPING, STIFFNESS
from teleop.evaluation.teleoperation.thresholds import NOTICEABLE
from teleop.names import ISOMETRIC
from teleop.output.console import plain_console
from teleop.output.estimate_tables import (
    expected_text,
    left_out_lines,
    print_estimated,
    print_online,
)
from teleop.output.next_command import print_command
from teleop.output.result_tables import print_result, true_numbers
from teleop.output.step_tables import print_steps
from teleop.printable import wrapped
from teleop.recording.gaps import Gap, missing_text
from teleop.safety.events import time_text

EARLY = 0.9
"""Part of the planned duration before which a trial has ended early."""
LONG_GAP = 0.05
"""Time between two ticks above which a warning is printed [s]."""


def print_trial(summary: Mapping[str, Any], details: bool) -> None:
    """Print the result of a trial as `teleop estimate` prints it, its estimates, and warnings.

    Without `details`, the usual text fits a terminal of 24 lines.
    """
    console = plain_console()
    print_fault(console, summary["safety"])
    if summary["interrupted"]:
        console.print("INTERRUPTED before the end", style="bold yellow")
    title = f"{summary['condition']}, {summary['specimen']}, {duration(summary)}"
    print_result(summary, title)
    if until := summary["until"]:
        wanted = ", ".join(
            f"{part} {half_width_text(half)}" for part, half in until["wanted"].items()
        )
        missed = "" if until["reached"] else "not reached: at the end "
        console.print(f"  wanted {wanted}; {missed}{until['text']}")
    for choice in summary["choices"]:
        console.print(f"  at {choice['time_s']:.1f} s, {choice['text']}")
    if summary["steps"]:
        print_steps(summary["steps"])
    if summary["pairs"]:
        print_results(console, summary, details)
    if station := summary["station"]:
        print_connection(console, station)
    loop = summary["loop"]
    if summary["clock"] != "virtual":
        print_loop(console, summary, details)
    elif details:
        console.print(f"  loop: {summary['ticks']} ticks at {loop['rate_hz']:g} Hz, virtual time")
    print_rejected(console, summary["rejected"])
    print_limited(console, summary)
    recording = summary["recording"]
    if recording["path"]:
        console.print(f"  recording: {recording['path']}")
        if summary["pairs"] and not details:
            print_command("  details", ["teleop", "estimate", recording["path"], "--details"])
    else:
        console.print("  not recorded")
    print_incomplete(console, recording)
    if recording["black_box"]:
        console.print(f"  black box: {recording['black_box']}", style="red")
    if recording["black_box_problem"]:
        console.print(f"  {recording['black_box_problem']}", style="red")


def print_connection(console: Console, station: Mapping[str, Any]) -> None:
    """Print what a station has measured of its connection to the other station."""
    if "round_trip_s" not in station:
        console.print(f"  {station['side']} station: its drives were not armed")
        return
    median, largest = station["round_trip_s"] * 1e3, station["round_trip_largest_s"] * 1e3
    half = 0.5 * (station["offset_high_s"] - station["offset_low_s"]) * 1e3
    counts = ", ".join(f"{station[name]} {name}" for name in ("lost", "overtaken", "rejected"))
    console.print(
        f"  {station['side']} station: round trip {median:.1f} ms, at most {largest:.1f} ms; time "
        f"of the other station known to ± {half:.3g} ms; datagrams: {counts}"
    )


def print_results(console: Console, summary: Mapping[str, Any], details: bool) -> None:
    """Print the estimates of a trial, and quantities that help to judge them."""
    if summary["estimates"]:
        print_online(summary, {}, details)
        for line in left_out_lines(summary):
            console.print(f"  {line}")
    elif summary["interrupted"]:
        console.print(
            f"  no estimates: {summary['contact_s']:.2f} s of contact, expected at least "
            f"{summary['least_contact_s']:g} s",
            style="yellow",
        )
    if summary["truth"]:
        print_truth(console, summary, details)
    print_tracking(console, summary["tracking"], details)
    print_feedback(console, summary["feedback"])
    print_estimated(console, summary)
    if details:
        console.print(f"  {expected_text(summary['expected_intervals'])}")
    if summary["contact"] < 1.0 and details:
        rest = f"{1.0 - summary['contact']:.0%} of the samples"
        console.print(f"  contact force near zero, and estimates held, in {rest}")


def print_incomplete(console: Console, recording: Mapping[str, Any]) -> None:
    """Print which ticks a recording misses, and how to recover its intact part."""
    if recording["missing_ticks"]:
        missing = missing_text([Gap(*row.values()) for row in recording["missing_ticks"]])
        console.print(
            f"  {missing}:\n  the recorder could not keep up; the loop and the estimators "
            "processed these ticks, but the averages above do not contain them",
            style="red",
        )
    if recording["problem"]:
        console.print(f"  the recording is not complete: {recording['problem']}", style="red")
        if recording["recoverable"]:
            console.print(
                "  the tables above are computed from its intact part, which can be written to a "
                "complete file"
            )
            print_command("  write it with", ["teleop", "recover", recording["path"]])
        else:
            console.print("  the tables above are computed from the last seconds, kept in memory")


def duration(summary: Mapping[str, Any]) -> str:
    """Return the duration of a trial; if it ended early, also the planned one."""
    planned, actual = summary["duration_s"], summary["actual_duration_s"]
    if summary["steps"] and not (summary["ending"] or summary["safety"]["fault"]):
        return f"{actual:.1f} s"  # a protocol has no duration of its own
    is_early = summary["pairs"] and actual < EARLY * planned  # its purpose was reached before
    if is_early or summary["interrupted"] or summary["safety"]["fault"]:
        return f"{actual:.2f} of {planned:g} s"
    return f"{planned:g} s"


def print_truth(console: Console, summary: Mapping[str, Any], details: bool) -> None:
    """Print the true values of the simulated rig: those of the result, with `details` all others.

    Without true values of the result, damping and secant stiffness of the specimen are printed.
    """
    truth, result = summary["truth"], summary.get("true_result")
    if result:
        k, k_tip, b, b_tip = true_numbers(result)
        console.print(
            f"  true k {k} {STIFFNESS.unit} ({k_tip} at the tip), b {b} {DAMPING.unit} ({b_tip} at "
            "the tip)"
        )
    if details or not result:
        console.print(
            f"  true b {DAMPING.text(truth['b'], '.3g')}; secant k "
            f"{STIFFNESS.text(truth['k_surface'])} at the surface, "
            f"{STIFFNESS.text(truth['k_deepest'])} at full depth"
        )
    causes = [
        name
        for name, key in (("lag", "force_lag_s"), ("lost motion", "lost_motion_m"))
        if truth[key] and not summary[key]
    ]
    if details:
        console.print(
            f"  lag of the force channel {truth['force_lag_s'] * 1e3:g} ms; lost motion of the "
            f"slave {truth['lost_motion_m'] * 1e6:g} um"
        )
    if details and causes:
        console.print(
            f"  the online estimates are not corrected for {' and '.join(causes)}: their b is too "
            "low"
        )
    further = truth.get("further_laws", {})
    if further:
        console.print("  These are the values in slow motion and before any change. Others:")
    for name, law in further.items():
        console.print(
            f"    {name}: b {DAMPING.text(law['b'], '.3g')}, k {STIFFNESS.text(law['k_surface'])} "
            f"at the surface and {STIFFNESS.text(law['k_deepest'])} at the greatest depth"
        )


def print_tracking(console: Console, tracking: Mapping[str, Any] | None, details: bool) -> None:
    """Print how well the slave followed the target; nothing if there was no target."""
    if tracking:
        first, second = tracking_lines(tracking)
        console.print(f"  tracking: {first}")
        if details:
            console.print(f"  {second}")


def tracking_lines(tracking: Mapping[str, Any]) -> tuple[str, str]:
    """Return two lines: gain, phase and error of the tracking; achieved and target frequency."""
    return (
        f"gain {tracking['gain']:.2f}, phase {tracking['phase_deg']:.0f} deg "
        f"(delay {tracking['delay_s']:.3f} s), error {tracking['rms_m'] * 1e3:.2f} mm rms",
        f"frequency {tracking['frequency_hz']:.3f} of {tracking['target_hz']:g} Hz, over "
        f"{tracking['periods']} periods",
    )


def print_feedback(console: Console, feedback: Mapping[str, Any] | None) -> None:
    """Print stiffness and force that the hand felt, and the lowest energy at the hand.

    The energy is negative if the displayed environment gave energy to the hand.
    """
    if not feedback:
        return
    channel = f", channel {feedback['channel']}" if feedback["channel"] else ""
    console.print(f"  feedback: {feedback['law']}{channel}")
    if feedback["law"] == "none":
        return
    for text in felt_lines(feedback):
        console.print(wrapped(f"  {text}", console.width))
    for remark in feedback["remarks"]:
        console.print(wrapped(f"  {remark}", console.width), style="yellow")


def felt_lines(feedback: Mapping[str, Any]) -> Iterator[str]:
    """Yield stiffness, damping and force that the hand felt, beside those of the tissue."""
    coupling, bandwidth = feedback["coupling_k"], feedback["bandwidth_hz"]
    if feedback["rendered_k"] == feedback["rendered_k"]:
        tissue = "tissue" if coupling != coupling else "tissue and coupling in series"
        least = "at least " if bandwidth == feedback["evaluated_hz"] else ""
        width = f", up to {least}{bandwidth:.2g} Hz" if bandwidth == bandwidth else ""
        yield (
            f"the hand felt k = {STIFFNESS.text(feedback['rendered_k'])} "
            f"({feedback['rendered_k_error']:+.1%} of {tissue}),"
        )
        yield (
            f"b = {DAMPING.text(feedback['rendered_b'])} (tissue "
            f"{DAMPING.text(feedback['tissue_b'])}), force error "
            f"{feedback['felt_force_error']:.1%} rms{width}"
        )
        if abs(feedback["rendered_k_error"]) > NOTICEABLE:
            yield f"a person notices a difference of stiffness from {NOTICEABLE:.0%} on"
    if feedback["outcome"] == "not known":
        return
    shakes = ""
    if feedback["oscillation_m"] > 0.5 * feedback["detectable_m"]:
        shakes = (
            f", the loop moves the hand by {feedback['oscillation_m'] * 1e6:.0f} um at "
            f"{feedback['oscillation_hz']:.0f} Hz (fingers detect about "
            f"{feedback['detectable_m'] * 1e6:.0f} um; tremor: {feedback['tremor_m'] * 1e6:.0f} um)"
        )
    yield (
        f"{feedback['outcome']}{shakes}; lowest energy at the hand "
        f"{feedback['energy_min_j'] * 1e3 + 0.0:.1f} mJ"
    )


def print_loop(console: Console, summary: Mapping[str, Any], details: bool) -> None:
    """Print the timing of the control loop: its rate, and with `details` the times of the ticks."""
    loop = summary["loop"]
    late, busy = loop["lateness_us"], loop["tick_us"]["busy"]
    few = summary["pairs"] < summary["ticks"]
    pairs = f" with {summary['pairs']} pairs of force and position" if few else ""
    console.print(
        f"  loop: {loop['mean_rate_hz']:.2f} of {loop['rate_hz']:g} Hz, {summary['ticks']} ticks"
        f"{pairs}, {loop['overruns']} overruns, {loop['skipped']} periods skipped"
    )
    steps = summary["realtime"]
    missing = [f"{name}: {why}" for name, why in steps.items() if why != "done"]
    if missing:
        console.print(f"  real time: {'; '.join(missing)}", style="yellow")
    if details:
        console.print(
            f"  lateness [us]: p50 {late['p50']:.1f}, p99 {late['p99']:.1f}, "
            f"p99.9 {late['p99_9']:.1f}, max {late['max']:.1f};\n"
            f"  a tick takes [us]: p50 {busy['p50']:.0f}, p99 {busy['p99']:.0f}, "
            f"max {busy['max']:.0f}"
        )
        if steps and not missing:
            console.print(f"  real time: {', '.join(steps)}")
    if loop["longest_gap_s"] > LONG_GAP:
        console.print(
            f"  the loop stalled for {loop['longest_gap_s']:.2f} s: the estimates around that "
            "time are not valid",
            style="red",
        )
    if loop["mean_rate_hz"] < 0.99 * loop["rate_hz"]:
        console.print(
            "  the loop was slower than its rate: k and b use the measured times, but the control "
            "was less accurate",
            style="yellow",
        )


def print_rejected(console: Console, rejected: Mapping[str, Mapping[str, int]]) -> None:
    """Print how many messages of each device were rejected because of errors, by reason."""
    for device, counts in rejected.items():
        reasons = ", ".join(f"{count} for {reason}" for reason, count in counts.items())
        console.print(f"  {device}: rejected {reasons}", style="yellow")


OFTEN = 0.1
"""Smallest share of ticks at the soft position limit that is a remark for an isometric handle."""


def print_limited(console: Console, summary: Mapping[str, Any]) -> None:
    """Print which soft limits reduced the commanded velocity, and in how many ticks."""
    limited = summary["safety"]["limited_ticks"]
    held = [f"{name} {count} ticks" for name, count in limited.items() if count]
    if held:
        console.print(f"  soft limits limited the command: {', '.join(held)}", style="yellow")
    if summary["hand_force"] == ISOMETRIC and limited["position"] > OFTEN * summary["ticks"]:
        text = (
            "  the handle does not move, so that a constant force moves the slave at a constant "
            "speed up to its position limit: expected admittance.stiffness, with which each force "
            "has a position"
        )
        console.print(wrapped(text, console.width), style="yellow")


def print_fault(console: Console, safety: Mapping[str, Any]) -> None:
    """Print the fault for which the supervisor stopped the trial, and further faults."""
    if safety["fault"]:
        fault = safety["fault"]
        console.print(
            f"STOPPED for safety {time_text(safety['fault_s'])}: {fault['text']}", style="bold red"
        )
        for text in safety["further_faults"]:
            console.print(f"  also: {text}", style="red")
