"""The Kalman filter of the joints: its gains, what it learns of noise, how soon it is surprised."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from arm3dof.control import kalman
from arm3dof.control.estimator import StateEstimator
from arm3dof.control.kalman import gains, sensor
from arm3dof.control.mpc import MpcController
from arm3dof.control.settings import MpcSettings
from arm3dof.model.library import load_robot
from arm3dof.model.uncertainty import perturbed
from arm3dof.runtime.loop import run_loop
from arm3dof.runtime.metrics import SETTLED_SPEED, summarise
from arm3dof.sim.disturbance import DisturbedPlant
from arm3dof.sim.encoder import EncoderNoise
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.state import JointState

DT, COUNT = 0.05, 25
TENTH_OF_A_DEGREE = np.deg2rad(0.1)


class Joints:
    """Joints that do what they are told, with a given acceleration beside it, read by encoders."""

    def __init__(self, noise, rng, nv=3):
        self.q, self.v, self.t = rng.normal(size=nv), rng.normal(size=nv), 0.0
        self.encoder = EncoderNoise(np.full(nv, noise), DT / COUNT, 0.01, rng)
        self.last = self.measured()

    def measured(self):
        return JointState(self.t, self.q + self.encoder.q, self.v + self.encoder.v)

    def move(self, estimator, u, beside=0.0, watched=True):
        """Move on for one sample, and return what the estimator expects to last."""
        a, h = u + beside, DT / COUNT
        for step in range(1, COUNT + 1):
            self.q = self.q + h * self.v + h**2 / 2 * a
            self.v = self.v + h * a
            self.t += h
            self.encoder.advance()
            if watched and step < COUNT:
                estimator.observe(self.measured())
        last, self.last = self.last, self.measured()
        gap = self.last.q - last.q - DT / 2 * (self.last.v + last.v)
        return estimator.update(u, gap, self.last)[2]


def started(joints, noise=None, learning=0.5):
    estimator = StateEstimator(joints.q.size, DT, learning, noise)
    estimator.restart(joints.last)
    return estimator


@pytest.mark.parametrize("count", [1, 10, 50])
@pytest.mark.parametrize("learning", [0.0, 0.5, 1.0])
def test_every_row_of_gains_makes_a_stable_filter(count, learning):
    for dt in (0.005, 0.05, 0.2):
        table, seen = gains(dt, learning, count), sensor(dt, count)
        assert np.isfinite(table.gain).all()
        move = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
        # over one sample d is the acceleration, so that measurements see d as they see a
        for gain in table.gain:
            radius = np.abs(np.linalg.eigvals((np.eye(3) - gain @ seen.of_state) @ move)).max()
            assert radius < 1 or (learning == 0 and radius < 1 + 1e-6)


def test_the_gains_are_those_of_the_riccati_equation():
    learning, ratio = 0.5, 1.0
    table, seen = gains(DT, learning, 1), sensor(DT, 1)
    move = np.array([[1, DT, 0, DT**2 / 2], [0, 1, 0, DT], [0, 0, 0, 1], [0, 0, 0, 1]])
    look = np.hstack([seen.of_state, np.zeros((2, 1))])
    passing = np.array([DT**2 / 2, DT, 1.0, 0.0])
    jerks = np.array(kalman._JERKS) * [DT**2, DT]
    walk = learning / np.sqrt(1 - learning) * (kalman._TRUSTED / ratio) ** 0.5
    unknown = np.outer(passing, passing) + np.diag([*jerks**2, 0.0, walk**2])
    noise = (ratio * DT**2) ** 2 * seen.noise
    P = solve_discrete_are(move.T, look.T, unknown, noise)
    expected = P @ look.T @ np.linalg.inv(look @ P @ look.T + noise)
    found = table.gain[np.searchsorted(table.edges, ratio)]
    np.testing.assert_allclose(found, expected[[0, 1, 3]], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("noise", [None, 0.0])
def test_without_noise_every_measurement_is_believed(noise):
    rng = np.random.default_rng(0)
    joints = Joints(0.0, rng)
    estimator = started(joints, noise)
    for _ in range(100):
        joints.move(estimator, rng.normal(size=3) * 20, rng.normal(size=3) * 10)
        np.testing.assert_allclose(estimator.q, joints.q, atol=1e-12)
        np.testing.assert_allclose(estimator.v, joints.v, atol=1e-12)
        assert max(estimator.noise) < 1e-10


@pytest.mark.parametrize("noise_deg", [0.01, 0.1, 1.0])
def test_noise_is_learned_within_a_few_samples_of_many_readings(noise_deg):
    rng, noise = np.random.default_rng(1), np.deg2rad(noise_deg)
    joints = Joints(noise, rng, nv=12)
    estimator = started(joints)
    for _ in range(8):
        joints.move(estimator, 10 * rng.normal(size=12), rng.normal(size=12))
    np.testing.assert_allclose(estimator.noise, noise, rtol=0.4)
    assert np.mean(estimator.noise) == pytest.approx(noise, rel=0.1)


def test_noise_is_learned_from_one_reading_a_sample_while_little_moves():
    rng = np.random.default_rng(2)
    joints = Joints(TENTH_OF_A_DEGREE, rng, nv=12)
    joints.v[:] = 0.0
    estimator = started(joints)
    for _ in range(100):
        joints.move(estimator, 0.1 * rng.normal(size=12), watched=False)
    assert np.mean(estimator.noise) == pytest.approx(TENTH_OF_A_DEGREE, rel=0.2)


@pytest.mark.parametrize(("watched", "better"), [(True, 8.0), (False, 2.5)])
def test_at_rest_the_estimate_is_far_better_than_a_measurement(watched, better):
    rng = np.random.default_rng(3)
    joints = Joints(TENTH_OF_A_DEGREE, rng, nv=12)
    joints.v[:] = 0.0
    estimator = started(joints)
    found = []
    for step in range(200):
        joints.move(estimator, np.zeros(12), watched=watched)
        if step >= 100:
            found.append((estimator.v - joints.v, joints.last.v - joints.v))
    estimated, measured = np.std(found, axis=(0, 2))
    assert better * estimated < measured


@pytest.mark.parametrize("watched", [True, False])
def test_what_begins_to_act_is_found_soon_and_to_its_size(watched):
    rng = np.random.default_rng(4)
    joints = Joints(TENTH_OF_A_DEGREE, rng)
    joints.v[:] = 0.0
    estimator = started(joints)
    for _ in range(60):
        joints.move(estimator, np.zeros(3), watched=watched)
    beside, known = np.array([20.0, 0.0, -5.0]), np.zeros(3)
    for _ in range(10):
        # what is expected to last is expected in the next sample
        known = known + joints.move(estimator, known, beside - known, watched=watched)
    np.testing.assert_allclose(known, beside, atol=1.5)
    np.testing.assert_allclose(estimator.v, joints.v, atol=0.15)


def test_readings_that_make_no_even_sample_are_left_aside():
    def run(spoil):
        joints = Joints(TENTH_OF_A_DEGREE, np.random.default_rng(5))
        estimator = started(joints)
        for _ in range(20):
            spoil(estimator, joints)
            joints.move(estimator, np.ones(3), watched=False)
        return estimator.q

    def late(estimator, joints):
        for step in range(10):
            estimator.observe(JointState(joints.t + 0.03 + 0.001 * step, np.ones(3), np.zeros(3)))

    def broken(estimator, joints):
        for step in range(1, COUNT):
            t = joints.t + step * DT / COUNT
            estimator.observe(JointState(t, np.full(3, np.nan), np.zeros(3)))

    expected = run(lambda *_: None)
    np.testing.assert_array_equal(run(late), expected)
    np.testing.assert_array_equal(run(broken), expected)


def test_a_controller_stands_still_under_noise_with_wrong_masses():
    robot = load_robot("arm3dof")
    target = np.deg2rad([28.1, 67.8, 53.8])
    for seed in range(4):
        plant = DisturbedPlant(
            PinocchioPlant(perturbed(robot, 30, rng=np.random.default_rng(seed)), 0.002),
            noise=TENTH_OF_A_DEGREE,
            rng=np.random.default_rng(seed),
        )
        plant.reset(JointState(0.0, np.zeros(3), np.zeros(3)))
        recording = run_loop(plant, MpcController(robot), target, 2.5)
        metrics = summarise(recording)
        assert metrics.settled
        assert metrics.settling_time < 2.0
        assert np.abs(recording.v[recording.t > 2.0]).max() < SETTLED_SPEED


def test_noise_is_declared_or_learned_and_the_papers_controller_believes_what_it_measures():
    assert MpcSettings().measurement_noise is None
    assert MpcSettings(formulation="paper").measurement_noise == 0.0
    robot = load_robot("arm3dof")
    controller = MpcController(robot, MpcSettings(measurement_noise=0.01))
    np.testing.assert_array_equal(controller.observer.filter.noise, 0.01)
