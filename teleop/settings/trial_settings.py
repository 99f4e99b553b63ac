"""The settings of a trial. They are checked when a `TrialSettings` is created."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field, replace
from functools import cache
from typing import Annotated, Any, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    ModelWrapValidatorHandler,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic.dataclasses import dataclass
from pydantic.fields import FieldInfo

from drivers.coupling import CouplingParameters
from drivers.rig_file import RigFile
from estimation import Preset, paper_preset
from estimation.conditioning import BANDWIDTH, Conditioner, make_conditioner
from estimation.method_settings import OwnSettings
from estimation.model import KELVIN_VOIGT, Model
from estimation.registry import PAPER
from estimation.transmission import RIGID as UNKNOWN_TRANSMISSION
from estimation.transmission import TransmissionCalibration
from sim_backend import (
    DEPTH,
    FORCE_LAG,
    TRANSMISSION,
    ForceMaster,
    ForceSlave,
    OperatorModel,
    PlantParameters,
    Sensors,
    Setup,
    paper_setup,
)
from teleop.control.admittance import AdmittanceParameters
from teleop.control.channel import ChannelSettings
from teleop.control.conditions import CONDITIONS, Condition, IntendedMotion
from teleop.control.coupling import Coupling
from teleop.control.designed_excitation import Design
from teleop.control.excitation_signals import AnySignal, Designed, Signal, Sine
from teleop.control.feedback.settings import FeedbackSettings
from teleop.control.hand_observer import HandObserver
from teleop.control.protocol import Protocol, ProtocolSettings
from teleop.control.station_settings import StationSettings
from teleop.control.tare import NO_TARE, Tare
from teleop.control.target import Target
from teleop.control.wanted_precision import WantedPrecision
from teleop.names import (
    COUPLED,
    FORCE_SENSOR,
    ISOMETRIC,
    NO_HANDLE,
    ClockName,
    ConditioningName,
    ConditionName,
    CubeName,
)
from teleop.safety import Limits
from teleop.safety.rig_limits import rig_limits
from teleop.safety.tightened_limits import NOT_TIGHTENED, TightenedLimits
from teleop.settings import ranges
from teleop.settings.checks import check_settings
from teleop.settings.custom_class import CustomClass, known_condition, known_signal
from teleop.settings.problems import all_problems
from teleop.settings.provenance import Provenance
from teleop.settings.simulated_rig_limits import simulated_rig_limits
from teleop.settings.transmission_file import calibration, simulated_transmission
from teleop.settings.values import (
    Hertz,
    Metres,
    ModelName,
    Seconds,
    model_of,
    one_line,
    protocol_named,
    rig_of,
    stated,
    tare_of,
    wanted_of,
    without_zero,
)

CONFIG = ConfigDict(extra="forbid", validate_by_name=True)
"""The dataclasses within the settings also use this configuration, because they define none."""


@dataclass(frozen=True, config=CONFIG)
class TrialSettings:
    """Settings of a trial.

    The default values are those of the paper (Yamamoto et al., BioRob 2008). There is one
    exception: `conditioning`, the filter of position and force before the estimators.

    Raises
    ------
    InputError
        A setting is invalid. The message has one line for each problem.
    """

    condition: ConditionName = "free"
    """Control condition."""
    cube: CubeName = "soft"
    """Cube of the simulated rig. Not used on a hardware rig."""
    specimen: Annotated[str, AfterValidator(one_line)] = ""
    """Name of the specimen; empty for the cube of the simulated rig."""
    operator: Annotated[str, AfterValidator(one_line)] = ""
    """Name of the operator."""
    notes: Annotated[str, Field(max_length=ranges.NOTES), AfterValidator(without_zero)] = ""
    """Notes on the trial."""
    about: Provenance = field(default_factory=Provenance)
    """Who measured what, and what others may do with the data."""
    live: bool = False
    """Whether to show the trial on the live page in a browser."""
    duration: Annotated[Seconds, Field(alias="duration_s", gt=0.0)] = 10.0
    """Duration of the trial [s]."""
    until: Annotated[WantedPrecision | None, BeforeValidator(wanted_of, str | WantedPrecision)] = (
        None
    )
    """Precision of the result of the evaluation at which the trial ends before `duration`, as a
    text such as `k=2%,b=10%`: half widths of the 95 % intervals. Default: the trial has the full
    duration."""
    clock: ClockName = "real"
    """Clock of the control loop: real or virtual time."""
    rate: Annotated[
        Hertz | None, Field(alias="rate_hz", ge=ranges.RATES[0], le=ranges.RATES[1])
    ] = None
    """Ticks per second [Hz]. Default: the rate in the rig file, or 1000 Hz (`loop_rate`)."""
    seed: int = 0
    """Seed of the simulated operator and of the sensor noise."""
    signal: Annotated[AnySignal, Discriminator("kind")] | None = None
    """Excitation signal of the autonomous condition. In mimic, the sine that the operator follows.
    Default: a sine of 1 Hz in mimic and of 2 Hz otherwise."""
    count_in: Annotated[Seconds | None, Field(alias="count_in_s", ge=0.0, le=60.0)] = None
    """Time at the start of a mimic trial in which the target does not move [s]. Default: 3 s on a
    hardware rig and 0 on the simulated rig."""
    admittance: AdmittanceParameters = field(default_factory=AdmittanceParameters)
    """Virtual dynamics of the master."""
    coupling: Coupling = field(default_factory=Coupling)
    """Coupling, which converts the motion of the master to the velocity of the slave."""
    feedback: FeedbackSettings = field(default_factory=FeedbackSettings)
    """Force feedback to the hand."""
    channel: ChannelSettings | None = None
    """Communication channel between master and slave. Default: no channel and no delay."""
    station: StationSettings | None = None
    """Side of the telemanipulator that this computer has. Default: both sides, no second computer.
    """
    conditioning: ConditioningName = "matched"
    """Signal conditioning before the estimators."""
    bandwidth: Annotated[Hertz, Field(alias="bandwidth_hz")] = BANDWIDTH
    """Bandwidth of the filter in the signal conditioning [Hz]."""
    force_lag: Annotated[Seconds | None, Field(alias="force_lag_s", ge=0.0)] = None
    """Lag of the force channel [s], for which matched conditioning corrects the position. Default:
    the calibrated lag of the rig, or 0 with another conditioning."""
    lost_motion: Annotated[Metres | None, Field(alias="lost_motion_m", ge=0.0)] = None
    """Half width of the play between encoder and tip [m], for which the conditioning corrects the
    position. With force feedback or a channel, the command of the slave crosses this play at each
    reversal. Default: the calibrated lost motion of the rig."""
    preset: Annotated[Preset | None, Field(alias="custom_preset")] = None
    """All settings of the estimators. Default: those of the paper, with the adaptation gain for the
    cube. On a hardware rig, this gain is that for the soft cube times (d / depth)^2, where d is the
    palpation depth for the soft cube."""
    estimators: tuple[str, ...] = PAPER
    """Names of the estimators. Not used with a custom preset."""
    model: Annotated[Model, BeforeValidator(model_of, ModelName | Model)] = KELVIN_VOIGT
    """Model for the estimators that can use any model. Not used with a custom preset."""
    estimator_parameters: Mapping[str, OwnSettings] = field(default_factory=dict)
    """Settings of individual estimators, such as forgetting, by the name of the estimator."""
    custom_setup: Setup | None = None
    """Body, force channel and palpation depth that replace those of the named cube."""
    custom_limits: Limits | None = None
    """Limits of the safety supervisor. Default: those of the rig file or, on the simulated rig,
    limits that are computed from the depth."""
    tightened_limits: TightenedLimits = NOT_TIGHTENED
    """Limits of the safety supervisor that are tighter than those of the rig."""
    sensors: Sensors = field(default_factory=Sensors)
    """Imperfections of the simulated sensors."""
    operator_model: OperatorModel = field(default_factory=OperatorModel)
    """Arm and intended motion of the operator of the simulated rig."""
    force_master: ForceMaster | None = None
    """Force-commanded master of the simulated rig, with its virtual coupling. Default: a
    velocity-commanded master with a force sensor in the handle."""
    force_slave: ForceSlave | None = None
    """Force-commanded slave of the simulated rig, whose velocity loop the host closes. Default: a
    velocity-commanded slave."""
    tare: Annotated[Tare, BeforeValidator(tare_of, str | Tare)] = NO_TARE
    """Zero offsets of force and position, which are subtracted from the measurements."""
    rig: Annotated[RigFile | None, BeforeValidator(rig_of, str | dict[str, str])] = None
    """The hardware rig. Default: the simulated rig."""
    depth: Annotated[Metres | None, Field(alias="depth_m", gt=0.0, le=ranges.DEEPEST)] = None
    """Depth of palpation [m], required on a hardware rig. Default: the depth in the paper."""
    protocol: Annotated[
        ProtocolSettings | None, BeforeValidator(protocol_named, str | ProtocolSettings | None)
    ] = None
    """Protocol that the slave performs in place of `condition`: the name of one of this package,
    the path of a file, or a table with a list of phases."""
    custom_condition: Annotated[CustomClass | None, AfterValidator(stated("condition"))] = None
    """Condition of another package that replaces `condition`: its name and its parameters. Also the
    class passed to `run_trial(condition=...)`; `condition` then selects the simulated operator."""
    custom_signal: Annotated[CustomClass | None, AfterValidator(stated("signal"))] = None
    """Excitation signal of another package that replaces `signal`: its name and its parameters."""
    custom_link: Annotated[CustomClass | None, AfterValidator(stated("link"))] = None
    """Link of another package between master and slave, which replaces admittance and coupling: its
    name and its parameters. Not with force feedback or a communication channel."""
    custom_rig: Annotated[CustomClass | None, AfterValidator(stated("rig"))] = None
    """Rig of another package that replaces the rig file and the simulated rig: its name and its
    parameters. Also the class passed to `run_trial(rig_maker=...)`."""

    def __post_init__(self) -> None:
        check_settings(self)

    @model_validator(mode="wrap")
    @classmethod
    def check_values(cls, values: object, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Report the problems of all settings at once.

        pydantic ends with the invalid values of single settings, before `check_settings`.
        """
        try:
            return handler(values)
        except ValidationError as error:
            raise all_problems(error, values, handler, KEYS, schema()) from error

    @property
    def setup(self) -> Setup:
        """Palpated body and transmission of the simulated rig, lag of its force channel, and depth.

        On a hardware rig, only the depth of palpation is used.
        """
        setup = self.custom_setup or paper_setup(self.performed_as.moved_by, self.cube)
        return replace(setup, depth=self.depth) if self.depth else setup

    @property
    def excitation(self) -> Signal | Designed:
        """Excitation signal in the condition `autonomous`, or motion of the target in `mimic`.

        This is the setting `custom_signal` or `signal`. If both are None, it is a sine whose
        frequency depends on the condition.
        """
        if self.custom_signal:
            return known_signal(self.custom_signal)
        return self.signal or Sine(self.performed_as.default_frequency)

    @property
    def performed_as(self) -> Condition:
        """Condition that selects the simulated operator and the depth.

        It is that of the trial, or `condition` beside an object that `run_trial` was given.
        """
        if self.custom_condition and self.custom_condition.plug_in:
            return known_condition(self.custom_condition)
        return Protocol(self.protocol) if self.protocol else CONDITIONS[self.condition]()

    @property
    def known_condition(self) -> Condition:
        """Condition of the trial, with all properties that are known of it."""
        custom = self.custom_condition
        return known_condition(custom) if custom else self.performed_as

    @property
    def intended_motion(self) -> IntendedMotion:
        """Settings that determine the intended motion of the slave, for the condition."""
        usual = ranges.COUNT_IN if self.rig else 0.0
        return IntendedMotion(
            self.excitation,
            self.setup.depth,
            usual if self.count_in is None else self.count_in,
            self.duration,
            self.admittance,
            self.coupling.scale,
            self.link_transmission,
            self.encoder_resolution,
            self.design,
        )

    def design(self) -> Design:
        """Return what the choice of an excitation during the trial needs to know."""
        limits = self.limits
        return Design(
            min(self.setup.depth, limits.soft_position[1]),
            self.excitation.highest,
            limits.soft_force,
            limits.max_velocity,
            limits.max_acceleration,
            self.make_conditioner(),
            self.until,
        )

    @property
    def target(self) -> Target | None:
        """Target position, which the operator follows; None if the condition has no target."""
        return self.known_condition.target_for(self.intended_motion)

    @property
    def loop_rate(self) -> float:
        """Ticks per second [Hz]: the setting `rate`, or the rate in the rig file, or 1000 Hz."""
        if self.rate is not None:
            return self.rate
        return self.rig.sections.rate_hz if self.rig else ranges.RATE

    @property
    def condition_name(self) -> str:
        """Name of the control condition, or of the class that replaced it."""
        if self.custom_condition:
            return self.custom_condition.name
        return "protocol" if self.protocol else self.condition

    @property
    def highest_frequency(self) -> float:
        """Highest frequency of the intended motion [Hz]."""
        return self.protocol.highest if self.protocol else self.excitation.highest

    @property
    def signal_name(self) -> str:
        """Kind of the excitation signal, or name of that of another package."""
        return self.custom_signal.name if self.custom_signal else self.excitation.kind

    @property
    def by_hand(self) -> bool:
        """Whether a person holds the handle."""
        return self.performed_as.moved_by == "hand"

    @property
    def is_simulated(self) -> bool:
        """Whether the trial runs on the simulated rig that these settings describe."""
        return not (self.rig or self.custom_rig)

    @property
    def needs_arming(self) -> bool:
        """Whether something real may move, so that a person must arm the drives."""
        return not self.is_simulated and self.clock == "real"

    @property
    def rig_name(self) -> str:
        """Name of the rig: that in the rig file, that of a class of the user, or `simulated`."""
        if self.custom_rig:
            return self.custom_rig.name
        return self.rig.sections.name if self.rig else "simulated"

    @property
    def palpated(self) -> str:
        """Name of the palpated body: `specimen`, or else the name of the rig or of the cube."""
        return self.specimen or (f"{self.cube} cube" if self.is_simulated else self.rig_name)

    @property
    def coupling_stiffness(self) -> float:
        """Stiffness of the virtual coupling of a force-commanded master [N/m], else infinite."""
        return self.master_coupling.stiffness if self.master_coupling else math.inf

    @property
    def master_coupling(self) -> CouplingParameters | None:
        """Virtual coupling of a force-commanded master; None for a velocity-commanded one."""
        if self.rig:
            return self.rig.coupling("master", 1.0 / self.loop_rate)
        return self.force_master.coupling if self.force_master else None

    @property
    def slave_coupling(self) -> CouplingParameters | None:
        """Velocity loop of a force-commanded slave; None for another slave."""
        period = 1.0 / self.loop_rate
        if self.rig:
            return self.rig.coupling("slave", period)
        return self.force_slave.loop(period) if self.force_slave else None

    @property
    def hand_force_source(self) -> str:
        """How the force of the hand is found: one of the sources in `teleop.names`."""
        measured = self.has_master and (
            not self.rig or self.rig.sections.channels.master_force is not None
        )
        if self.master_coupling and not (self.rig and measured):
            return COUPLED
        if not measured:
            return NO_HANDLE
        return ISOMETRIC if self.is_isometric else FORCE_SENSOR

    @property
    def hand_observer(self) -> HandObserver | None:
        """New observer of the force of the hand; None if the force is measured.

        It is also None if the rig file does not state the mass of the handle.
        """
        coupling = self.master_coupling
        if not coupling or self.hand_force_source != COUPLED:
            return None
        master = self.rig and self.rig.sections.drives.master
        if master and master.handle_mass_kg:
            return HandObserver(master.handle_mass_kg, coupling.friction, coupling.latency)
        simulated = self.force_master
        return (
            HandObserver(simulated.mass, simulated.friction, simulated.latency)
            if simulated
            else None
        )

    @property
    def is_isometric(self) -> bool:
        """Whether the handle does not move: it has a force sensor, but no drive and no encoder."""
        if not self.rig:
            return False
        sections = self.rig.sections
        channels = sections.channels
        return bool(channels.master_force) and not (
            sections.drives.master or channels.master_position
        )

    @property
    def has_link(self) -> bool:
        """Whether there is force feedback, or a communication channel between master and slave."""
        return bool(self.feedback.law != "none" or self.channel or self.station)

    @property
    def has_slave(self) -> bool:
        """Whether this computer has the slave, and not only the master."""
        return not self.station or self.station.side != "master"

    @property
    def has_master(self) -> bool:
        """Whether this computer has the master, and not only the slave."""
        return not self.station or self.station.side != "slave"

    @property
    def limits(self) -> Limits:
        """Limits of the safety supervisor for measurements after taring.

        The zero offsets are also subtracted from the ranges of the sensors.
        """
        return self.raw_limits.shifted(self.tare.zeros)

    @property
    def raw_limits(self) -> Limits:
        """Limits of the safety supervisor for measurements before taring."""
        return self.tightened_limits.applied(self.untightened_limits)

    @property
    def untightened_limits(self) -> Limits:
        """Limits of the safety supervisor for this rig, without the setting `tightened_limits`."""
        if self.custom_limits:
            return self.custom_limits
        if self.rig:
            return rig_limits(self.rig.sections)
        setup, loop = self.setup, self.slave_coupling
        limits = simulated_rig_limits(
            setup.cube.fast,
            setup.depth,
            self.coupling.scale,
            self.highest_frequency,
            1.0 / loop.stiffness if loop else self.plant_parameters.slave_compliance,
            setup.transmission,
            self.force_master,
        )
        if self.has_master and self.has_slave:
            return limits
        return limits.of_side("slave" if self.has_slave else "master")

    @property
    def plant_parameters(self) -> PlantParameters:
        """Parameters of drives, force channels and transmission of the simulated rig."""
        setup = self.setup
        return PlantParameters(contact_force_lag=setup.force_lag, transmission=setup.transmission)

    @property
    def encoder_resolution(self) -> float:
        """Resolution of the slave's encoder: smallest change of position that it measures [m]."""
        if self.rig:
            position = self.rig.sections.channels.slave_position
            return position.resolution_um * 1e-6 if position else 0.0
        return self.sensors.encoder_resolution

    @property
    def transmission(self) -> TransmissionCalibration:
        """Calibrated transmission of the rig, which corrects the result of the evaluation.

        It is that of the rig file. On the simulated rig with the force channel and transmission of
        the paper, it is that which `teleop lag` measured on a spring. Otherwise it is unknown.
        """
        if self.rig:
            section = self.rig.sections.transmission
            return calibration(section) if section else UNKNOWN_TRANSMISSION
        measured = (FORCE_LAG, TRANSMISSION)
        if self.is_simulated and (self.setup.force_lag, self.setup.transmission) == measured:
            return simulated_transmission()
        return UNKNOWN_TRANSMISSION

    @property
    def online_transmission(self) -> TransmissionCalibration:
        """Lag and lost motion for which the online estimates are corrected."""
        known, lost = self.transmission, self.lost_motion
        lag, share = self.force_lag or 0.0, 0.0  # a stated lag is of first order
        if self.force_lag is None and self.conditioning == "matched":
            lag, share = known.force_lag, known.delay_share
        return TransmissionCalibration(
            lag, known.lost_motion if lost is None else lost, delay_share=share
        )

    @property
    def link_transmission(self) -> TransmissionCalibration:
        """Lag, lost motion and compliance for which the link between the axes corrects."""
        known, lost, lag = self.transmission, self.lost_motion, self.force_lag
        if lost is not None:  # a stated value may be a guess
            known = replace(known, lost_motion=lost, lost_motion_error=0.3 * lost)
        return known if lag is None else replace(known, force_lag=lag)

    @property
    def lost_motion_known(self) -> bool:
        """Whether the lost motion of the slave's transmission is calibrated or stated."""
        return self.lost_motion is not None or self.transmission != UNKNOWN_TRANSMISSION

    @property
    def is_glued(self) -> bool:
        """Whether the specimen is glued to the slave, so that it also pulls."""
        if self.feedback.glued is not None:
            return self.feedback.glued
        return self.setup.cube.glued if self.rig is None else True

    def make_conditioner(self) -> Conditioner:
        """Return a new signal conditioner, which computes the input of the estimators."""
        correction = self.online_transmission
        return make_conditioner(
            self.conditioning,
            self.bandwidth,
            self.encoder_resolution,
            correction.force_lag,
            self.preset.model if self.preset else self.model,
            correction.lost_motion,
            correction.delay_share,
        )

    @property
    def estimation_preset(self) -> Preset:
        """Settings of the estimators: `preset`, or those of the paper adapted to this trial."""
        if self.preset:
            return self.preset
        preset = paper_preset("soft" if self.rig else self.cube)
        if self.rig and self.depth:
            preset = preset.for_depth(self.depth, DEPTH[self.performed_as.moved_by]["soft"])
        return replace(
            preset,
            estimators=self.estimators,
            model=self.model,
            correlation=self.make_conditioner().correlation(1.0 / self.loop_rate),
            own=self.estimator_parameters,
        )


FIELDS: Mapping[str, FieldInfo] = TrialSettings.__pydantic_fields__  # type: ignore[attr-defined]
KEYS = {name: field.alias or name for name, field in FIELDS.items()}
"""Key in a document of each setting, by its name. The keys of quantities end with their unit."""


@cache
def adapter() -> TypeAdapter[TrialSettings]:
    """Return the pydantic object that checks a document and converts it to `TrialSettings`."""
    return TypeAdapter(TrialSettings)


@cache
def schema() -> dict[str, Any]:
    """Return the JSON schema of configuration files. Text editors use it to check such a file."""
    from teleop.settings.documented_schema import DocumentedSchema

    document = adapter().json_schema(schema_generator=DocumentedSchema)
    return {**document, "title": "Configuration of a trial"}
