"""What a trial is: its settings, checked, and the parts that they make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from estimation import Bank, Conditioner, Excitation, Preset, paper_preset
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
from teleop.controller import Controller
from teleop.errors import InputError
from teleop.injector import Injector, Signal, Sine

RATES = (50.0, 100_000.0)
"""Lowest and highest rate of the loop [Hz]: below, hand and admittance do not hold together."""
LONGEST = 3600.0
"""Longest trial [s]; every tick is kept in memory, 0.2 MB a second at 1 kHz."""


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
