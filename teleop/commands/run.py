"""`teleop run`: one palpation on a rig."""

from __future__ import annotations

import signal as signals
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

if TYPE_CHECKING:
    from collections.abc import Callable

    from teleop.controller import Record
    from teleop.progress import ProgressLine
    from teleop.settings import TrialSettings


def run(
    *,
    condition: Literal["free", "mimic", "autonomous"] = "free",
    cube: Literal["soft", "medium", "hard"] = "soft",
    duration: float = 10.0,
    clock: Literal["real", "virtual"] = "real",
    rate: float = 1000.0,
    seed: int = 0,
    signal: Literal["sine", "multisine", "chirp"] = "sine",
    frequency: float = 2.0,
    coupling: Literal["velocity", "position"] = "velocity",
    conditioning: Literal["matched", "svf", "foaw", "difference"] = "matched",
    bandwidth: float = 20.0,
    force_lag: float = 0.0,
    out: Path | None = None,
    plot: Path | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Palpate a cube on the simulated rig, and estimate its stiffness and damping meanwhile.

    Example: `teleop run --condition autonomous --cube hard --plot hard.png`

    Parameters
    ----------
    condition
        An operator palpates as they like (free), tries to track a sine (mimic), or the PE
        injector moves the slave and nobody holds the handle (autonomous).
    cube
        The cube on the simulated rig.
    duration
        Length of the trial [s].
    clock
        The machine's clock, or virtual time: as fast as it goes, and the same to the bit for
        the same seed.
    rate
        Rate of the loop [Hz].
    seed
        Seed of the simulated operator and of the sensor noise.
    signal
        Excitation of the autonomous condition.
    frequency
        Its frequency [Hz]: of a multisine the lowest of five harmonics, of a chirp the
        lowest of two octaves.
    coupling
        What of the master the slave follows: its velocity, as in the paper, or its position.
    conditioning
        How velocity is had from the encoder: one state-variable filter on position and force
        alike (matched) or on position alone (svf), first-order adaptive windowing (foaw), or
        a filtered difference.
    bandwidth
        Bandwidth of that filter [Hz]; foaw has none.
    force_lag
        Lag of the force channel [s] that matched conditioning makes up for, as `teleop lag`
        measures it.
    out
        Write every tick to this CSV file, which `teleop estimate` reads.
    plot
        Draw the estimates to this .png, .svg or .pdf file.
    json
        Print one JSON document instead of tables.
    """
    from teleop import console
    from teleop.choices import make_coupling, make_signal
    from teleop.files import check_outputs
    from teleop.progress import ProgressLine
    from teleop.settings import TrialSettings
    from teleop.trial import run_trial

    settings = TrialSettings(
        condition=condition,
        cube=cube,
        duration=duration,
        clock=clock,
        rate=rate,
        seed=seed,
        signal=make_signal(signal, frequency),
        coupling=make_coupling(coupling),
        conditioning=conditioning,
        bandwidth=bandwidth,
        force_lag=force_lag,
    )
    check_outputs(out, picture=plot)
    end_like_ctrl_c()
    line = ProgressLine()
    try:
        trial = run_trial(settings, live_estimates(line, settings) if line.shown else None)
    finally:
        line.close()
    if json:
        console.print_json(trial.summary())
    else:
        console.print_trial(trial.summary())
    if out:
        from teleop.table import write_table

        write_table(out, trial.columns, trial.units)
    if plot:
        from teleop.figure import estimates_figure, save

        columns = trial.columns
        figure = estimates_figure(
            f"{condition}, {cube} cube",
            columns["Time"],
            columns["Filtered displacement"],
            columns["Filtered velocity"],
            trial.estimates,
        )
        save(figure, plot)
    return 130 if trial.interrupted else 0


def end_like_ctrl_c() -> None:
    """Let a request to end or a closed terminal stop the run as Ctrl-C does."""
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signals, name):
            signals.signal(getattr(signals, name), signals.default_int_handler)


def live_estimates(line: ProgressLine, settings: TrialSettings) -> Callable[[int, Record], None]:
    """Draws the present estimates ten times a second."""
    every = max(1, round(settings.rate / 10.0))

    def draw(number: int, record: Record) -> None:
        if number % every:
            return
        estimates = "".join(
            f"  {name} {estimate.k:6.0f} {estimate.b:+5.0f}"
            for name, estimate in record.estimates.items()
        )
        line.show(f"{record.t:4.1f} of {settings.duration:g} s  k [N/m], b [N s/m]:{estimates}")

    return draw
