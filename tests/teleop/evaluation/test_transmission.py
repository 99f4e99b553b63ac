"""The result is that of the specimen, on rigs with force lag, lost motion and compliance."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from estimation.transmission import TransmissionCalibration
from teleop.cli import main
from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.reading.recorded import recorded_settings, recorded_signals
from teleop.evaluation.reading.samples import Samples, SamplesAtTip
from teleop.evaluation.reading.signals import Signals, periods, smallest_step
from teleop.evaluation.settings import EstimateSettings
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

K1, K3, B = 3000.0, 8e7, 5.0
LAG, LOST_MOTION, COMPLIANCE = 3e-3, 90e-6, 12e-6


def measured(seed, depth=4e-3, frequency=1.3):
    """A stiffening body behind play, a spring and a lag, by small steps of the implicit rule."""
    rng = np.random.default_rng(seed)
    every, dt = 20, 5e-5
    t = np.arange(0.0, 8.0, dt)
    x = 0.5 * depth * (1.0 - np.cos(2.0 * np.pi * frequency * t)) * (1.0 + 0.2 * np.sin(t))
    y, lagged, play = 0.0, 0.0, 0.0
    force = np.empty(len(t))
    for n, position in enumerate(x.tolist()):
        play = min(max(play, position - LOST_MOTION), position + LOST_MOTION)
        # (play - y) / c = k1 y + k3 y^3 + b (y - before) / dt, by two steps of Newton
        before = y
        for _ in range(2):
            f = K1 * y + K3 * y**3 + B * (y - before) / dt
            slope = K1 + 3.0 * K3 * y * y + B / dt
            y += ((play - y) / COMPLIANCE - f) / (slope + 1.0 / COMPLIANCE)
        f = K1 * y + K3 * y**3 + B * (y - before) / dt
        lagged += (f - lagged) * dt / LAG
        force[n] = lagged
    noisy = force[::every] + rng.normal(0.0, 0.01, len(t[::every]))
    counted = np.round((x[::every] + rng.normal(0.0, 2e-7, len(noisy))) / 1e-6) * 1e-6
    return Signals(t[::every], counted, noisy, periods(t[::every]), "position")


@pytest.fixture(scope="module")
def record():
    return measured(731)


def result_of(signals, **known):
    settings = EstimateSettings(transmission=TransmissionCalibration(**known))
    return evaluate(signals, settings).analysis


CALIBRATED = {
    "force_lag": 1.01 * LAG,
    "lost_motion": LOST_MOTION - 1e-6,
    "compliance": 12.1e-6,
    "force_lag_error": 6e-5,
    "lost_motion_error": 2e-6,
    "compliance_error": 0.2e-6,
}


def test_with_a_calibrated_transmission_the_intervals_contain_the_true_values(record):
    analysis = result_of(record, **CALIBRATED)
    result = analysis.result
    # the position behind the play at which k is reported gives the position of the tip
    y = np.linspace(0.0, 5e-3, 200_001)
    series = y + COMPLIANCE * (K1 * y + K3 * y**3)
    tip = float(np.interp(analysis.local.best.position, series, y))
    k = K1 + 3.0 * K3 * tip**2
    assert result.k_tip.low <= k <= result.k_tip.high
    assert result.k_low <= k / (1.0 + COMPLIANCE * k) <= result.k_high
    assert result.b_low <= B / (1.0 + COMPLIANCE * k) ** 2 <= result.b_high
    assert result.k_high - result.k_low < 0.02 * k


def test_without_it_the_lost_motion_is_found_in_the_record(record):
    result = result_of(record, force_lag=LAG).result
    assert result.lost_motion.low <= LOST_MOTION <= result.lost_motion.high
    assert result.lost_motion.value == pytest.approx(LOST_MOTION, rel=0.05)
    assert result.b_low <= B <= result.b_high
    assert result.k_tip is None


def test_the_resolution_is_that_of_the_sensor_and_not_of_the_play(record):
    at_tip = SamplesAtTip(Samples(record), 90.3e-6).signals
    assert smallest_step(at_tip.x) < 0.5e-6
    assert at_tip.step == pytest.approx(1e-6)


def test_errors_of_the_calibration_widen_the_intervals(record):
    exact = {name: value for name, value in CALIBRATED.items() if not name.endswith("_error")}
    sure, unsure = (result_of(record, **known).result for known in (exact, CALIBRATED))
    assert unsure.b_high - unsure.b_low > 1.5 * (sure.b_high - sure.b_low)
    assert unsure.k_high - unsure.k_low > sure.k_high - sure.k_low


def test_the_result_of_a_trial_on_the_default_rig_is_right(tmp_path, capsys):
    """The paper's nine trials: benchmarks/published_results.py."""
    cube, condition = "hard", "mimic"
    path = str(tmp_path / "trial.mcap")
    run = ["run", "--cube", cube, "--condition", condition, "--clock", "virtual", "--seed", "918"]
    assert main([*run, "--record", path]) == 0
    capsys.readouterr()
    assert main(["estimate", path, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    result, setup = found["result"], TrialSettings(condition, cube=cube).setup
    law, compliance = setup.cube.slow, setup.transmission.compliance
    tip = law.compressed(result["tangent"]["position_m"], compliance)
    k = law.stiffness(tip)
    assert result["k_tip"]["value"] == pytest.approx(k, rel=5e-3)
    assert result["k"] == pytest.approx(k / (1.0 + compliance * k), rel=5e-3)
    b = law.b / (1.0 + compliance * k)  # the plant neglects that b v stretches the transmission
    assert result["b_low"] <= b <= result["b_high"]
    assert not any("negative" in reason for reason in result["reasons"])
    assert found["lost_motion_m"] == found["transmission"]["lost_motion_m"]
    assert main(["estimate", path, "--details"]) == 0
    out = capsys.readouterr().out
    assert "k and b are those of specimen and transmission in series" in out
    assert "k and b are corrected for a lag of 2.66 ms and lost motion of 122 um" in out
    assert "the online estimates are not corrected" not in out


NOT_CORRECTED = ("--force-lag", "0", "--lost-motion", "0")


def online_estimates(tmp_path, capsys, *options):
    """Evaluation of a trial of the default rig with a model that describes the cube."""
    path = str(tmp_path / "trial.mcap")
    given = ["--clock", "virtual", "--seed", "5521", "--model", "stiffening"]
    run = ["run", "--estimators", "rls_conditional,kalman", *given, *options]
    assert main([*run, "--record", path, "--overwrite"]) == 0
    capsys.readouterr()
    assert main(["estimate", path, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.usefixtures("interpreted")
def test_the_online_estimates_of_a_trial_are_corrected_for_the_transmission_of_the_rig(
    tmp_path, capsys
):
    truth = TrialSettings(cube="soft").setup.cube.slow
    k = truth.stiffness(0.0) / (1.0 + 7e-6 * truth.stiffness(0.0))
    estimates = online_estimates(tmp_path, capsys, "--duration", "15")["estimates"]
    for one in estimates.values():
        assert one["b"] == pytest.approx(truth.b, abs=0.3)
        assert one["k"] == pytest.approx(k, rel=0.02)


def delayed(settings):
    """A trial on a rig whose file states a pure delay as a part of the lag."""
    known = TransmissionCalibration(5e-3, 90e-6, delay_share=0.6)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("teleop.settings.trial_settings.simulated_transmission", lambda: known)
        return run_trial(settings).recording


def assert_same_bits(recording, estimates):
    for name, recorded in recording.estimated().estimates().items():
        for ours, theirs in zip(estimates[name][:5], recorded[:5], strict=True):
            assert np.array_equal(ours, theirs, equal_nan=True), name


@pytest.mark.parametrize("duration", [1.5, 4.0])  # with and without the compiled code
def test_the_delay_in_the_lag_is_applied_and_recorded_and_a_replay_gives_the_same_bits(duration):
    settings = TrialSettings("mimic", clock="virtual", duration=duration)
    recording = delayed(settings)
    recorded = {"force_lag": 5e-3, "lost_motion": 90e-6, "delay_share": 0.6}
    assert recording.settings["online_transmission"] == recorded
    again = evaluate(recorded_signals(recording), recorded_settings(recording))
    assert_same_bits(recording, again.estimates)
    first_order = replace(recorded_settings(recording), online=TransmissionCalibration(5e-3, 90e-6))
    wrong = evaluate(recorded_signals(recording), first_order).estimates["rls"]
    assert not np.array_equal(wrong.b, again.estimates["rls"].b)


def test_a_recording_without_a_share_of_the_delay_is_replayed_with_a_lag_of_first_order():
    settings = TrialSettings("mimic", clock="virtual", duration=1.5, force_lag=5e-3)
    recording = delayed(settings)  # a stated lag is of first order
    document = recording.settings["online_transmission"]
    assert document.pop("delay_share") == 0.0
    again = evaluate(recorded_signals(recording), recorded_settings(recording))
    assert_same_bits(recording, again.estimates)


@pytest.mark.usefixtures("interpreted")
def test_without_correction_a_trial_has_the_low_damping_of_the_paper_and_says_why(tmp_path, capsys):
    found = online_estimates(tmp_path, capsys, *NOT_CORRECTED, "--duration", "6")
    assert all(one["b"] < 0.0 for one in found["estimates"].values())
    assert found["force_lag_s"] == found["lost_motion_m"] == 0.0
    assert found["result"]["b_low"] <= TrialSettings(cube="soft").setup.cube.slow.b
    assert main(["estimate", str(tmp_path / "trial.mcap"), "--details"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "the online estimates are not corrected, as in the trial: lag and lost motion" in out


def test_without_its_calibration_a_trial_has_lost_motion_and_no_damping(tmp_path, capsys):
    path = str(tmp_path / "trial.mcap")
    run = ["run", "--condition", "autonomous", "--clock", "virtual", "--duration", "4"]
    assert main([*run, "--record", path]) == 0
    capsys.readouterr()
    assert main(["estimate", path, "--transmission", "none", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["transmission"] is None
    result, true = found["result"], TrialSettings("autonomous").setup.transmission.lost_motion
    assert result["lost_motion_m"]["low"] <= true <= result["lost_motion_m"]["high"]
    # the lag of the force is not compensated
    assert result["b"] is result["b_low"] is result["b_high"] is None
    assert any("damping is not determined: it is negative" in one for one in result["reasons"])


def test_stated_values_replace_those_of_the_rig(tmp_path, capsys):
    path = str(tmp_path / "trial.mcap")
    run = ["run", "--condition", "autonomous", "--clock", "virtual", "--duration", "4"]
    assert main([*run, "--record", path]) == 0
    capsys.readouterr()
    assert main(["estimate", path, "--lost-motion", "0um", "--force-lag", "1ms", "--json"]) == 0
    transmission = json.loads(capsys.readouterr().out)["transmission"]
    assert transmission["force_lag_s"] == 1e-3
    assert transmission["lost_motion_m"] == 0.0
    assert transmission["compliance_m_per_n"] == pytest.approx(7e-6, rel=1e-2)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--lost-motion", "50mm"), ["lost motion of 5e+04 um", "travel"]),
        (("--lost-motion=-1um",), ["--lost-motion", "zero or more"]),
        (("--compliance", "7um"), ["--compliance", "7um/N"]),
    ],
)
def test_an_impossible_value_is_refused_in_one_line(record, options, words, tmp_path, capsys):
    table = tmp_path / "record.csv"
    columns = np.column_stack([record.t, record.x * 1e3, record.f])
    np.savetxt(table, columns, delimiter=",", header="t [s],x [mm],F [N]", comments="")
    assert main(["estimate", str(table), *options]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert all(word in lines[0] for word in words)


def test_a_compliance_that_hides_the_specimen_gives_a_remark_instead_of_a_stiffness(record):
    result = result_of(record, compliance=2.6e-4, compliance_error=2e-5).result
    assert result.k_tip is None
    assert any("stiffness at the tip is not determined" in reason for reason in result.reasons)


def test_files_and_options_state_the_transmission(record, tmp_path, capsys):
    table = tmp_path / "record.csv"
    columns = np.column_stack([record.t, record.x * 1e3, record.f])
    np.savetxt(table, columns, delimiter=",", header="t [s],x [mm],F [N]", comments="")
    file = tmp_path / "transmission.toml"
    file.write_text(
        "lag_ms = 3.0\ndelay_share = 0.5\ndelay_share_error = 0.5\n"  # as for a stated lag
        "lost_motion_um = 90\ncompliance_um_per_n = 12.0\n"
    )
    found = []
    for options in (
        ("--transmission", str(file)),
        ("--force-lag", "3ms", "--lost-motion", "90um", "--compliance", "12um/N"),
        ("--transmission", str(file), "--compliance", "0um/N"),
    ):
        assert main(["estimate", str(table), *options, "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out)["result"])
    for key in ("k", "b"):
        assert found[0][key] == pytest.approx(found[1][key], rel=1e-12)
    assert found[0]["k_tip"] == pytest.approx(found[1]["k_tip"])
    assert found[2]["k_tip"] is None


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("lag_ms = -1.0", ["lag_ms", "expected", "0"]),
        ("lost_motion_mm = 0.1", ["lost_motion_mm"]),
        ("lag_ms = ", ["not a TOML file"]),
        ("lost_motion_um = 1e9", ["lost_motion_um", "10000"]),
        ("compliance_um_per_n = nan", ["compliance_um_per_n"]),
    ],
)
def test_a_wrong_transmission_file_is_refused_in_one_line(content, words, tmp_path, capsys):
    file = tmp_path / "transmission.toml"
    file.write_text(content)
    assert main(["estimate", "x.csv", "--transmission", str(file)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert all(word in lines[0] for word in (str(file), *words))


def test_behind_a_compliance_the_damping_of_a_stiffening_body_is_that_at_the_position_of_k():
    """Presses from outside of contact: the mean damping of the motion is 4 % larger."""
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 10.0, 2e-3)
    depth = 1e-3 * (1.3 - 2.3 * np.cos(2.2 * np.pi * t)) * (1.0 + 0.2 * np.sin(t))
    tip = np.maximum(depth, 0.0)
    v = np.where(depth > 0.0, np.gradient(depth, t), 0.0)
    law, c = K1 * tip + K3 * tip**3, 40e-6
    force = np.where(depth > 0.0, np.maximum(law + B * v, 0.0), 0.0)
    noisy = force + rng.normal(0.0, 0.005, len(t))
    position = depth + c * force + rng.normal(0.0, 2e-7, len(t))
    signals = Signals(t, position, noisy, periods(t), "position")
    result = result_of(signals, force_lag=1e-9, compliance=c, compliance_error=1e-7).result
    y = np.linspace(0.0, 6e-3, 200_001)
    at = float(np.interp(result.position, y + c * (K1 * y + K3 * y**3), y))
    k = K1 + 3.0 * K3 * at**2
    assert result.damping_at_hz is None
    assert result.b == pytest.approx(B / (1.0 + c * k) ** 2, rel=0.02)
    assert result.b_low <= B / (1.0 + c * k) ** 2 <= result.b_high


def test_behind_a_compliance_k_does_not_depend_on_the_frequencies_of_the_motion():
    """Specimen and compliance in series relax: their storage stiffness grows with frequency."""
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 10.0, 2e-3)
    k, b, c = 1500.0, 25.0, 60e-6
    position, force = np.full(len(t), 6e-3), np.full(len(t), 6e-3 * k / (1.0 + c * k))
    for size, frequency in ((1e-3, 0.8), (6e-4, 1.7), (5e-4, 3.1), (4e-4, 4.3)):
        wave = size * np.exp(2j * np.pi * frequency * (t + rng.uniform()))
        at_tip = k + 2j * np.pi * frequency * b
        position += wave.real
        force += (at_tip / (1.0 + c * at_tip) * wave).real
    noisy = force + rng.normal(0.0, 0.003, len(t))
    signals = Signals(t, position, noisy, periods(t), "position")
    result = result_of(signals, force_lag=1e-9, compliance=c, compliance_error=1e-8).result
    assert result.k_low <= k / (1.0 + c * k) <= result.k_high
    assert result.k_high - result.k_low < 2e-3 * k
    assert result.k_tip.low <= k <= result.k_tip.high
    assert result.b_low <= b / (1.0 + c * k) ** 2 <= result.b_high
    assert not result.times
