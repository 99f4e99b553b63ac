"""One trial: palpate a cube under a control condition, and estimate while doing so."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from estimation import Bank, Conditioner, Estimates, Excitation, Preset, paper_preset
from estimation.compiled import Floats
from sim_backend import (
    CUBES,
    FreePalpation,
    MimickedSine,
    PlantParameters,
    Sensors,
    Setup,
    SimulatedRig,
    paper_setup,
)
from teleop.admittance import Admittance, AdmittanceParameters, Coupling
from teleop.choices import ConditioningName, make_conditioner
from teleop.clock import Clock, RealClock, VirtualClock
from teleop.conditions import CONDITIONS, Autonomous, Condition, Teleoperation
from teleop.controller import Controller, Record
from teleop.errors import InputError
from teleop.injector import Injector, Signal, Sine
from teleop.log import Log
from teleop.summary import loop_timing, summarise

RATES = (50.0, 100_000.0)
"""Lowest and highest rate of the loop [Hz]: below, hand and admittance do not hold together."""
LONGEST = 3600.0
"""Longest trial [s]; every tick is kept in memory, 0.2 MB a second at 1 kHz."""
REHEARSAL = 600
"""Ticks by which a rate is tried before a trial; the second half of them counts."""


@dataclass(frozen=True)
class TrialSettings:
    """What a trial is; the defaults are the paper's experiment.

    Raises
    ------
    InputError
        A setting is out of its range.
    """

    condition: str = "free"
    cube: str = "soft"
    duration: float = 10.0
    """Length [s]."""
    clock: Literal["real", "virtual"] = "real"
    rate: float = 1000.0
    """Ticks a second [Hz]."""
    seed: int = 0
    """Seed of operator and sensor noise."""
    signal: Signal = field(default_factory=lambda: Sine(2.0))
    """Excitation of the autonomous condition."""
    admittance: AdmittanceParameters = field(default_factory=AdmittanceParameters)
    coupling: Coupling = field(default_factory=Coupling)
    conditioning: ConditioningName = "matched"
    bandwidth: float = 20.0
    """Bandwidth of the conditioning's filter [Hz]."""
    force_lag: float = 0.0
    """Lag of the force channel that matched conditioning makes up for [s]."""
    preset: Preset | None = None
    """Settings of the estimators; None for the paper's, with the gain for this cube."""
    custom_setup: Setup | None = None
    """What is palpated instead of the named cube, and how deep."""

    def __post_init__(self) -> None:
        if self.condition not in CONDITIONS:
            raise InputError(
                f"condition {self.condition!r}: expected one of {', '.join(CONDITIONS)}"
            )
        if self.cube not in CUBES:
            raise InputError(f"cube {self.cube!r}: expected one of {', '.join(CUBES)}")
        if self.clock not in ("real", "virtual"):
            raise InputError(f"clock {self.clock!r}: expected one of real, virtual")
        if not RATES[0] <= self.rate <= RATES[1]:
            raise InputError(f"rate {self.rate:g} Hz: expected {RATES[0]:g} to {RATES[1]:g} Hz")
        self.make_conditioner()
        if not 1.0 / self.rate <= self.duration <= LONGEST:
            raise InputError(
                f"duration {self.duration:g} s: expected at least one tick, {1.0 / self.rate:g} s, "
                f"and at most {LONGEST:g} s"
            )
        if self.signal.highest > 0.05 * self.rate:
            raise InputError(
                f"frequency {self.signal.highest:g} Hz in the excitation: expected at most a "
                f"twentieth of the rate, {0.05 * self.rate:g} Hz"
            )

    @property
    def setup(self) -> Setup:
        """What is palpated, and how deep."""
        return self.custom_setup or paper_setup(self.condition, self.cube)

    def make_clock(self) -> Clock:
        """A fresh clock."""
        return RealClock(self.rate) if self.clock == "real" else VirtualClock(self.rate)

    def make_rig(self, now: Callable[[], float]) -> SimulatedRig:
        """A fresh simulated rig, with an operator where the condition has one."""
        setup = self.setup
        depth = setup.depth / self.coupling.scale
        operators = {"free": FreePalpation, "mimic": MimickedSine}
        operator = operators.get(self.condition)
        return SimulatedRig(
            setup.cube,
            now,
            operator=operator(depth, self.seed) if operator else None,
            parameters=PlantParameters(contact_force_lag=setup.force_lag),
            seed=self.seed,
        )

    def make_condition(self) -> Condition:
        """A fresh control condition."""
        if self.condition != "autonomous":
            return Teleoperation()
        return Autonomous(
            Injector(
                self.signal,
                self.setup.depth,
                self.admittance,
                self.coupling.scale,
                self.duration,
            )
        )

    def make_controller(self, rig: SimulatedRig, bank: Bank) -> Controller:
        """A fresh controller for this rig and bank."""
        return Controller(
            rig,
            self.make_condition(),
            Admittance(self.admittance),
            self.coupling,
            self.make_conditioner(),
            bank,
            Excitation(),
            1.0 / self.rate,
        )

    def make_conditioner(self) -> Conditioner:
        """Fresh signal conditioning."""
        resolution = Sensors().encoder_resolution
        return make_conditioner(self.conditioning, self.bandwidth, resolution, self.force_lag)

    def make_bank(self) -> Bank:
        """A fresh bank of estimators."""
        return (self.preset or paper_preset(self.cube)).bank()


@dataclass(frozen=True)
class Trial:
    """A trial that has been run."""

    settings: TrialSettings
    columns: dict[str, Floats]
    """What was logged, by column; arrays of shape (ticks,) in SI units."""
    units: dict[str, str]
    """Unit of each column."""
    bank: Bank
    """The estimators in their final state."""
    interrupted: bool
    """Whether it ended before its time."""

    @property
    def estimates(self) -> dict[str, Estimates]:
        """Each estimator's estimates."""
        return {
            name: Estimates(self.columns[f"{name.upper()} b"], self.columns[f"{name.upper()} k"])
            for name in self.bank
        }

    def summary(self) -> dict[str, Any]:
        """What the trial comes to, as `teleop run --json` prints it."""
        settings, columns = self.settings, self.columns
        t = columns["Time"]
        x, v, f = (columns[f"Filtered {name}"] for name in ("displacement", "velocity", "force"))
        cube = settings.setup.cube
        return {
            "condition": settings.condition,
            "cube": settings.cube,
            "duration_s": settings.duration,
            "clock": settings.clock,
            "seed": settings.seed,
            "ticks": len(t),
            "interrupted": self.interrupted,
            "estimates": {
                name: summarise(t, x, v, f, estimates, self.bank[name])._asdict()
                for name, estimates in self.estimates.items()
            },
            "truth": {
                "b": cube.b,
                "k_surface": cube.k1,
                "k_deepest": cube.k1
                + cube.k3 * float(np.max(np.abs(columns["Displacement"]))) ** 2,
                "force_lag_s": settings.setup.force_lag,
            },
            "excitation": {
                "mean": float(np.mean(columns["Excitation"])),
                "last": float(columns["Excitation"][-1]),
            },
            "loop": loop_timing(settings.rate, t, columns["Lateness"], columns["Overrun"]),
        }


def tick_cost(settings: TrialSettings) -> float:
    """Time [s] that nine of ten ticks keep to on this machine, rehearsed in virtual time.

    The rehearsal runs at 1 kHz at the most, so that it gets to the motion.
    """
    rehearsal = replace(settings, clock="virtual", rate=min(settings.rate, 1000.0))
    clock = rehearsal.make_clock()
    costs = []
    with rehearsal.make_rig(clock.now) as rig:
        bank = rehearsal.make_bank()
        controller = rehearsal.make_controller(rig, bank)
        log = Log(bank)
        for _ in range(REHEARSAL):
            start = time.perf_counter()
            log.append(clock.wait(), controller.tick())
            costs.append(time.perf_counter() - start)
    return float(np.percentile(costs[REHEARSAL // 2 :], 90.0))


def check_rate(settings: TrialSettings) -> None:
    """Make sure that this machine can hold the rate, in the best of three rehearsals.

    Raises
    ------
    InputError
        It cannot.
    """
    cost = math.inf
    for _ in range(3):
        cost = min(cost, tick_cost(settings))
        if cost <= 0.9 / settings.rate:
            return
    raise InputError(
        f"rate {settings.rate:g} Hz: a tick takes {cost * 1e6:.0f} us on this machine, "
        f"expected a rate of at most {0.9 / cost:.0f} Hz, or --clock virtual"
    )


def run_trial(
    settings: TrialSettings, on_tick: Callable[[int, Record], None] | None = None
) -> Trial:
    """Run a trial to its end, or to Ctrl-C; the rig is stopped on every way out.

    Parameters
    ----------
    settings
        What to run.
    on_tick
        Called with the tick's number and record after each tick; must be quick.

    Raises
    ------
    InputError
        The machine cannot hold the rate.
    """
    if settings.clock == "real":
        check_rate(settings)
    bank = settings.make_bank()
    log = Log(bank)
    clock = settings.make_clock()
    interrupted = False
    with settings.make_rig(clock.now) as rig:
        controller = settings.make_controller(rig, bank)
        number = 0
        try:
            while True:
                tick = clock.wait()
                number += tick.skipped
                if number >= settings.duration * settings.rate:
                    break
                record = controller.tick()
                log.append(tick, record)
                if on_tick:
                    on_tick(number, record)
                number += 1
        except KeyboardInterrupt:
            if not log:
                raise
            interrupted = True
    return Trial(settings, log.columns(), log.units, bank, interrupted)
