import numpy as np
import pytest

from estimation.methods.active_observer import ActiveObserver
from estimation.methods.kalman_filter import RandomWalkKalman, process_noise
from estimation.model import STIFFENING

SIZES = (0.025, 5e-3)
Q = process_noise(0.05, 1e-3, SIZES)
QP = process_noise(2.0, 1e-3, (1.0,))
P0 = tuple(1e4 / size**2 for size in SIZES)
CEILING = tuple(1.0 / size**2 for size in SIZES)


def observer():
    return ActiveObserver((*Q, *QP), (*P0, 1e6), (*CEILING, 0.01))


def test_observes_the_augmented_state_as_filterpy_does(palpation):
    from filterpy.kalman import KalmanFilter

    signals = palpation(seconds=0.5, noise=0.02, jitter=0.3)
    oracle = KalmanFilter(dim_x=3, dim_z=1)
    oracle.P, oracle.R = np.diag((*P0, 1e4)), np.eye(1)
    expected = []
    for x, v, f, dt in zip(*signals, strict=True):
        oracle.Q, oracle.H = np.diag((*Q, *QP)) * dt, np.array([[v, x, 1.0]])
        oracle.predict()
        oracle.update(f)
        expected.append(oracle.x.ravel().copy())
    estimates = ActiveObserver((*Q, *QP), (*P0, 1e4), (1e30,) * 3).run(*signals)
    got = np.column_stack((estimates.b, estimates.k, estimates.further["p"].value))
    np.testing.assert_allclose(got, expected, rtol=1e-6, atol=1e-6)


def test_update_and_run_give_the_same(palpation):
    signals = palpation(seconds=0.1, noise=0.02)
    stepped, swept = observer(), observer()
    for sample in zip(*signals, strict=True):
        estimate = stepped.update(*sample)
    swept.run(*signals)
    assert swept.estimate == estimate
    assert swept.values == stepped.values


def test_estimates_b_k_and_p():
    assert tuple(observer().values) == ("b", "k", "p")


def test_the_active_state_absorbs_a_datum_error(palpation):
    x, v, f, dt = palpation(seconds=5.0, noise=0.02)
    f = f + 1.0
    estimates = observer().run(x, v, f, dt)
    plain = RandomWalkKalman(Q, P0, CEILING).run(x, v, f, dt)
    assert estimates.further["p"].value[-1] == pytest.approx(1.0, abs=0.02)
    assert estimates.k[-1] == pytest.approx(2100.0, rel=0.005)
    assert np.abs(plain.k[-1] - 2100.0) > 50.0


def test_active_state_follows_a_force_that_changes(palpation):
    x, v, f, dt = palpation(seconds=15.0, noise=0.02)
    late = np.cumsum(dt) > 3.0
    estimates = observer().run(x, v, f + 0.5 * late, dt)
    assert estimates.further["p"].value[-1] == pytest.approx(0.5, abs=0.2)


def test_uses_the_regressors_of_a_larger_model(palpation):
    x, v, f, dt = palpation(seconds=1.0)
    f = f + 1e7 * x**3
    estimator = ActiveObserver((*Q, 1e14, *QP), (*P0, 1e18, 1e6), None, STIFFENING)
    estimates = estimator.run(x, v, f, dt, (x**3)[:, None])
    assert tuple(estimates.further) == ("k3", "p")
    assert estimates.k[-1] == pytest.approx(2100.0, rel=0.01)
    with pytest.raises(ValueError, match="0 regressors"):
        estimator.update(x[0], v[0], f[0], 1e-3)


def test_covariance_is_that_of_all_three(palpation):
    estimator = observer()
    estimator.run(*palpation(noise=0.02))
    covariance = np.array(estimator.covariance)
    deviations = [std for _, std in estimator.values.values()]
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), deviations)


def test_wants_a_setting_for_the_active_state():
    with pytest.raises(ValueError, match="process noise must be 3"):
        ActiveObserver(Q, P0)
