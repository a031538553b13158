import numpy as np
import pytest

import arm3dof
from arm3dof.errors import InputError
from arm3dof.model.joint_covariance import joint_covariance


@pytest.fixture(scope="module")
def arm():
    return arm3dof.load_robot()


def test_it_is_what_inverse_kinematics_makes_of_scattered_points(arm):
    rng = np.random.default_rng(0)
    for point in ([0.17, -0.02, -0.05], [0.15, 0.08, 0.05]):
        covariance = np.diag([0.002, 0.0005, 0.001]) ** 2
        best = arm3dof.inverse_kinematics(arm, point).best
        angles = []
        for miss in rng.multivariate_normal(np.zeros(3), covariance, 300):
            reach = arm3dof.inverse_kinematics(arm, point + miss)
            near = np.abs(reach.solutions - best).sum(axis=1).argmin()
            angles.append(reach.solutions[near])
        stated = joint_covariance(arm, best, covariance)
        np.testing.assert_allclose(np.cov(np.array(angles).T), stated, atol=0.2 * stated.max())


def test_a_stretched_elbow_leaves_it_finite(arm):
    stretched = joint_covariance(arm, [0.1, 0.3, 0.0], 1e-6 * np.eye(3))
    assert np.isfinite(stretched).all()
    assert np.sqrt(stretched.max()) < 0.1


def test_what_is_no_covariance_is_refused(arm):
    with pytest.raises(InputError, match=r"shape \(2, 2\)"):
        joint_covariance(arm, [0, 0, 0], np.eye(2))
    with pytest.raises(InputError, match="not finite"):
        joint_covariance(arm, [0, 0, 0], np.full((3, 3), np.nan))
    with pytest.raises(InputError, match="q"):
        joint_covariance(arm, [0, 0], np.eye(3))
