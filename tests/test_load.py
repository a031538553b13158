"""What the controller learns about masses, from motions that are made up."""

import numpy as np
import pinocchio as pin
import pytest

from arm3dof.control.load import LoadEstimator
from arm3dof.model.library import load_robot

DT = 0.05  # [s]
NOTHING = np.zeros(3)


@pytest.fixture
def robot():
    return load_robot("arm3dof")


def heavier(robot, share):
    """A copy of a robot with all masses larger by a share."""
    copy = robot.clone()
    parameters = [(1 + share) * body.toDynamicParameters() for body in robot.bodies]
    copy.reweigh([pin.Inertia.FromDynamicParameters(row) for row in parameters])
    return copy


def look(estimator, truth, q, v, a):
    """Show an estimator a motion that torques took a robot through."""
    tau = truth.inverse_dynamics(q, v, a)
    return estimator.look(q.tolist(), v.tolist(), a.tolist(), tau, NOTHING)


def test_masses_and_a_load_are_found_and_taught(robot):
    rng = np.random.default_rng(0)
    for _ in range(10):
        share, mass = rng.uniform(-0.3, 0.3), rng.uniform(0.0, 0.1)
        pupil = robot.clone()
        estimator = LoadEstimator(pupil, DT)
        truth = heavier(robot.with_payload(mass / (1 + share)), share)  # the load is not heavier
        for _ in range(20):
            q, v, a = robot.random_configuration(rng), *rng.normal(size=(2, 3))
            look(estimator, truth, q, v, 20 * a)
            estimator.learn()
            estimator.teach()
        assert estimator.load == pytest.approx(mass, rel=0.2, abs=5e-3)  # a prior draws it to 0
        assert estimator.mass_error == pytest.approx(share, rel=0.2, abs=0.02)
        _, left = look(estimator, truth, q, v, a)
        np.testing.assert_allclose(left, 0.0, atol=0.02)
        own = truth.inverse_dynamics(q, v, a)
        np.testing.assert_allclose(pupil.inverse_dynamics(q, v, a), own, atol=0.02)


@pytest.mark.parametrize(
    ("share", "speed", "taught"),
    [(0.01, 0.1, False), (0.035, 0.1, True), (0.035, 7.0, False), (0.15, 7.0, True)],
)
def test_a_motion_that_turned_far_has_to_tell_more_to_be_believed(robot, share, speed, taught):
    rng = np.random.default_rng(1)
    estimator, truth = LoadEstimator(robot.clone(), DT), heavier(robot, share)
    estimator.teach()
    for _ in range(20):
        q, a = robot.random_configuration(rng), 20 * rng.normal(size=3)
        look(estimator, truth, q, speed * rng.choice([-1.0, 1.0], 3), a)
        estimator.learn()
    assert estimator.mass_error == pytest.approx(share, rel=0.2)
    assert (estimator.teach() is not None) is taught
