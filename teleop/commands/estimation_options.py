"""The options of the estimation: of a new trial, and of a file that is evaluated."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from teleop.commands.options import ESTIMATION
from teleop.commands.quantities import Compliance, Hertz, Length, Seconds
from teleop.names import ConditioningName, CubeName, ModelName, PresetName

if TYPE_CHECKING:
    from collections.abc import Mapping

    from estimation.figures import Truth
    from estimation.model import Model
    from estimation.transmission import TransmissionCalibration
    from teleop.evaluation.settings import EstimateSettings
    from teleop.recording.recording import Recording


@dataclass(frozen=True)
class EstimationOptions:
    """Options that replace settings of the estimation; None keeps the setting.

    Each option has the name of the setting in `TrialSettings` and in `EstimateSettings`.
    """

    conditioning: ConditioningName | None = None
    """How velocity is computed from position: by a state-variable filter on position and force
    (matched), or on position only (svf); by first-order adaptive windowing (foaw); or by a filtered
    difference (difference). Default: that of the recording, and otherwise matched."""
    bandwidth: Hertz | None = None
    """Bandwidth of the conditioning filter [Hz]; not used by foaw. Default: that of the recording;
    20 for a new trial, and with the paper's settings; for other files, ten times the highest
    frequency at which force follows displacement."""
    force_lag: Seconds | None = None
    """Lag of the force channel, such as 2.66ms, as measured by `teleop lag`; matched conditioning
    compensates for it. Default: that of the recording; for a new trial, that of the rig if it is
    known; for other files, the delay of the force filter if the file states this filter."""
    lost_motion: Length | None = None
    """Lost motion between encoder and tip in either direction, such as 120um. Default: that of the
    recording; for a new trial, that of the rig if it is known. 0 here and in --force-lag gives the
    estimates of the paper, from the position at the encoder."""
    estimators: str | None = None
    """Names of estimators, such as rls,kalman,rls_sift, or all. The message about an unknown name
    lists all names. Default: the estimators of the recording, and rls,ai,me for a new trial or a
    file of another program."""
    model: ModelName | None = None
    """Model of the environment, for the estimators that support several models. Default: that of
    the recording, and otherwise kelvin-voigt."""

    def given(self) -> dict[str, Any]:
        """Values of the settings for which an option was given."""
        settings = {name: value for name, value in vars(self).items() if value is not None}
        if self.estimators is not None:
            settings["estimators"] = chosen_estimators(self.estimators)
        if self.model:
            settings["model"] = chosen_model(self.model)
        return settings


@dataclass(frozen=True)
class FileOptions(EstimationOptions):
    """Options of the estimation from a file."""

    preset: PresetName | None = None
    """Settings of the estimators: scaled from the data (scaled), or the paper's (paper). Default:
    the settings of the run for a recording, and scaled for other files."""
    cube: CubeName | None = None
    """Cube of the paper whose adaptation gain is used. Only with the paper's settings. Default: the
    cube of the run for a recording, and soft for other files."""
    whole: bool | None = None
    """Also use the samples at rest before and after the motion."""
    transmission: Path | None = None
    """File of `teleop lag --out` with the lag, lost motion and compliance between encoder and tip,
    for which the result is corrected; or none, for no correction. Default: the values of the rig of
    a recording, if known. --force-lag, --lost-motion and --compliance replace single values."""
    compliance: Compliance | None = None
    """Compliance between encoder and tip, such as 7um/N; gives the stiffness at the tip."""

    def changes(self, datum: str) -> dict[str, Any]:
        """Values of the settings for which an option was given, with the option --datum.

        They are for `file_settings`, which makes one setting of the values of the transmission.
        """
        from teleop.errors import InputError

        given = self.given()
        for name in OF_TRANSMISSION:
            if given.get(name, 0.0) < 0.0:
                option = name.replace("_", "-")
                raise InputError(f"--{option} {given[name]:g}: expected zero or more")
        if self.transmission:
            given["transmission"] = chosen_transmission(self.transmission)
        return given | ({} if datum == "auto" else {"datum": datum})


Estimation = Annotated[EstimationOptions, Parameter(name="*", group=ESTIMATION)]
FileEstimation = Annotated[FileOptions, Parameter(name="*", group=ESTIMATION)]
NEW_TRIAL = EstimationOptions()
OF_TRANSMISSION = ("force_lag", "lost_motion", "compliance")
"""Options that replace a value of the transmission."""
NO_TRANSMISSION = Path("none")
"""Value of --transmission for no correction."""
AS_RECORDED = FileOptions()


def file_settings(recording: Recording | None, changes: Mapping[str, Any]) -> EstimateSettings:
    """Settings of the recorded trial, or the defaults for a foreign file, with these changes."""
    from estimation.transmission import stated_lag
    from teleop.evaluation.settings import EstimateSettings

    settings = EstimateSettings()
    if recording:
        from teleop.trial.recorded_trial import estimate_settings

        settings = estimate_settings(recording)
    # A value that the user states replaces that of the file or rig, and has no error.
    stated = {name: changes[name] for name in OF_TRANSMISSION if name in changes}
    known = changes.get("transmission", settings.transmission)
    if "force_lag" in stated:
        known = stated_lag(known, stated["force_lag"])
    known = replace(known, **stated, **{f"{name}_error": 0.0 for name in stated})
    online = settings.online and replace(settings.online, **stated)
    others = {name: v for name, v in changes.items() if name not in ("lost_motion", "compliance")}
    return replace(settings, **{**others, "transmission": known, "online": online})


def true_values(recording: Recording) -> Truth | None:
    """The true stiffness and damping, if the recorded trial was on the simulated rig."""
    from estimation.figures import known_truth
    from teleop.trial.recorded_trial import recorded_truth

    return known_truth(recorded_truth(recording))


def chosen_estimators(names: str) -> tuple[str, ...]:
    """The estimators in a list separated by commas, or `all`; InputError for a wrong name."""
    from estimation.registry import named_estimators
    from teleop.errors import as_input_error

    with as_input_error():
        return named_estimators(names)


def chosen_transmission(file: Path) -> TransmissionCalibration:
    """The transmission in a file; InputError for a wrong file."""
    from estimation.transmission import RIGID
    from teleop.settings.transmission_file import read_transmission

    return RIGID if file == NO_TRANSMISSION else read_transmission(file)


def chosen_model(name: str) -> Model:
    """The model of the environment with this name; InputError for a wrong name."""
    from estimation.model import model_named
    from teleop.errors import as_input_error

    with as_input_error():
        return model_named(name)
