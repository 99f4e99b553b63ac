"""What a trial is: its settings, checked, and the parts that they make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from drivers import Rig
from drivers.rig_file import RigFile
from drivers.wired_rig import WiredRig
from estimation import Bank, Conditioner, Excitation, Model, Preset, paper_preset
from estimation.model import KELVIN_VOIGT
from estimation.registry import PAPER
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
from teleop.control.admittance import Admittance, AdmittanceParameters, Coupling
from teleop.control.clock import Clock, RealClock, VirtualClock
from teleop.control.conditions import CONDITIONS, Autonomous, Condition, Teleoperation
from teleop.control.controller import Controller
from teleop.control.injector import Injector, Signal, Sine
from teleop.control.tare import NO_TARE, Tare
from teleop.errors import InputError
from teleop.names import ClockName, ConditioningName
from teleop.safety import Limits
from teleop.safety.palpation_limits import palpation_limits
from teleop.safety.rig_limits import rig_limits
from teleop.trial.choices import make_conditioner

RATES = (50.0, 100_000.0)
"""Lowest and highest rate of the loop [Hz]: below, hand and admittance do not hold together."""
DEEPEST = 0.1
"""Greatest depth of palpation [m]."""
LONGEST = 3600.0
"""Longest trial [s]; its summary takes all ticks into memory, 0.4 MB a second at 1 kHz."""


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
    clock: ClockName = "real"
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
    estimators: tuple[str, ...] = PAPER
    """Names of the estimators, where no preset gives them."""
    model: Model = KELVIN_VOIGT
    """Model of the estimators that take any, where no preset gives it."""
    custom_setup: Setup | None = None
    """What is palpated instead of the named cube, and how deep."""
    custom_limits: Limits | None = None
    """Limits of the safety supervisor; None for those that suit the palpation."""
    sensors: Sensors = field(default_factory=Sensors)
    """Imperfections of the simulated sensors."""
    tare: Tare = NO_TARE
    """Where force and position are zero."""
    rig: RigFile | None = None
    """The rig to run on; None for the simulated one."""
    depth: float | None = None
    """Depth of palpation that is aimed for [m]; None for that of the paper on this cube."""

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
        if self.rig and self.clock != "real":
            raise InputError("clock virtual: a rig of devices runs in real time: expected real")
        if self.depth is not None and not 0.0 < self.depth <= DEEPEST:
            raise InputError(
                f"depth {self.depth * 1e3:g} mm: expected more than 0 and at most "
                f"{DEEPEST * 1e3:g} mm"
            )
        self.tare.check(self.rig_name)
        self.make_conditioner()
        try:
            self.make_bank()
        except ValueError as error:
            raise InputError(str(error)) from error
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
        try:
            self.raw_limits.shifted(self.tare.zeros)
        except ValueError as error:
            raise InputError(f"tare: {error}") from error

    @property
    def setup(self) -> Setup:
        """What is palpated, and how deep."""
        setup = self.custom_setup or paper_setup(self.condition, self.cube)
        return replace(setup, depth=self.depth) if self.depth else setup

    @property
    def rig_name(self) -> str:
        """Name of the rig."""
        return self.rig.sections.name if self.rig else "simulated"

    @property
    def limits(self) -> Limits:
        """What the safety supervisor holds the trial to, counted from the tare."""
        return self.raw_limits.shifted(self.tare.zeros)

    @property
    def raw_limits(self) -> Limits:
        """The same with the ranges of the sensors in what they read themselves."""
        if self.custom_limits:
            return self.custom_limits
        if self.rig:
            return rig_limits(self.rig.sections)
        setup = self.setup
        return palpation_limits(
            setup.cube,
            setup.depth,
            self.coupling.scale,
            self.signal.highest,
            self.plant_parameters.slave_compliance,
        )

    @property
    def plant_parameters(self) -> PlantParameters:
        """Drives and force channels of the simulated rig."""
        return PlantParameters(contact_force_lag=self.setup.force_lag)

    def make_clock(self) -> Clock:
        """A fresh clock."""
        return RealClock(self.rate) if self.clock == "real" else VirtualClock(self.rate)

    def make_rig(self, now: Callable[[], float]) -> Rig:
        """A fresh rig on this clock."""
        return WiredRig(self.rig, now) if self.rig else self.make_simulated_rig(now)

    def make_simulated_rig(self, now: Callable[[], float], watchdog: float = 0.1) -> SimulatedRig:
        """A fresh simulated rig, with an operator where the condition has one."""
        setup = self.setup
        depth = setup.depth / self.coupling.scale
        operators = {"free": FreePalpation, "mimic": MimickedSine}
        operator = operators.get(self.condition)
        return SimulatedRig(
            setup.cube,
            now,
            operator=operator(depth, self.seed) if operator else None,
            parameters=self.plant_parameters,
            sensors=self.sensors,
            watchdog=watchdog,
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

    def make_controller(self, rig: Rig, bank: Bank, clock: Clock) -> Controller:
        """A fresh controller for this rig, bank and clock."""
        return Controller(
            rig,
            self.make_condition(),
            Admittance(self.admittance),
            self.coupling,
            self.make_conditioner(),
            bank,
            Excitation(),
            1.0 / self.rate,
            self.limits,
            self.tare,
            clock.stopwatch,
        )

    def make_conditioner(self) -> Conditioner:
        """Fresh signal conditioning."""
        return make_conditioner(
            self.conditioning,
            self.bandwidth,
            self.encoder_resolution,
            self.force_lag,
            self.preset.model if self.preset else self.model,
        )

    @property
    def encoder_resolution(self) -> float:
        """Position of one count of the slave's encoder [m]."""
        if self.rig:
            return self.rig.sections.channels.slave_position.resolution_um * 1e-6
        return self.sensors.encoder_resolution

    def make_bank(self) -> Bank:
        """A fresh bank of estimators."""
        return self.bank_preset().bank()

    def bank_preset(self) -> Preset:
        """Settings of the estimators."""
        return self.preset or replace(
            paper_preset(self.cube),
            estimators=self.estimators,
            model=self.model,
            correlation=self.make_conditioner().correlation(1.0 / self.rate),
        )

    def what_is_palpated(self) -> dict[str, Any]:
        """The simulated rig and its truth, or the rig file."""
        if self.rig:
            return {"rig": {"name": self.rig.sections.name, "toml": self.rig.text}}
        return {"setup": asdict(self.setup), "sensors": asdict(self.sensors)}

    def description(self) -> dict[str, Any]:
        """All settings as JSON has them, for the recording."""
        return {
            "condition": self.condition,
            "cube": self.cube,
            "duration_s": self.duration,
            "clock": self.clock,
            "rate_hz": self.rate,
            "seed": self.seed,
            "signal": {"kind": type(self.signal).__name__, "highest_hz": self.signal.highest},
            "admittance": asdict(self.admittance),
            "coupling": vars(self.coupling),
            "conditioning": self.conditioning,
            "bandwidth_hz": self.bandwidth,
            "force_lag_s": self.force_lag,
            "preset": asdict(self.bank_preset()),
            "encoder_resolution_m": self.encoder_resolution,
            **self.what_is_palpated(),
            "limits": asdict(self.limits),
            "tare": self.tare._asdict(),
        }
