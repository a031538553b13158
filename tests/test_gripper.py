"""Grippers: found in a robot's description, opened and closed."""

import numpy as np
import pytest

from arm3dof.model.gripper import find_gripper, with_free_gripper, with_gripper_at
from arm3dof.model.library import load_robot


@pytest.mark.parametrize(("name", "opening"), [("arm3dof", 0.066), ("panda", 0.08)])
def test_fingers_are_as_far_apart_as_the_opening_says(name, opening):
    robot = load_robot(name)
    gripper = find_gripper(robot)
    assert gripper.opening == pytest.approx(opening)
    assert gripper.closed == pytest.approx(0.0)
    q = np.zeros(robot.nv)
    for wanted in np.linspace(0.0, opening, 6):
        held = with_gripper_at(robot, wanted)
        links = (gripper.driven.link, gripper.follower.link)
        first, second = (held.placement(q, link).translation for link in links)
        assert np.linalg.norm(first - second) == pytest.approx(wanted, abs=1e-12)
        driven = gripper.position_of(wanted)
        assert gripper.opening_of(driven) == pytest.approx(wanted)
        assert gripper.opening_of(driven, driven) == pytest.approx(wanted)


def test_what_it_cannot_open_is_taken_as_the_nearest():
    gripper = find_gripper(load_robot("arm3dof"))
    assert gripper.position_of(1.0) == gripper.q_open == 0.0
    assert gripper.position_of(-1.0) == gripper.q_closed == 0.033


def test_one_finger_may_lag_behind():
    gripper = find_gripper(load_robot("arm3dof"))
    assert gripper.opening_of(0.010, 0.012) == pytest.approx(0.044)


def test_freed_fingers_are_joints_and_a_payload_stays():
    robot = load_robot("arm3dof").with_payload(0.1)
    free = with_free_gripper(robot, find_gripper(robot))
    assert free.joint_names == ("joint1", "joint2", "joint3", "gripper", "left_finger_joint")
    assert free.payload == robot.payload
    q = np.array([0.2, 0.5, -0.4, 0.0, 0.0])
    np.testing.assert_allclose(
        free.mass_matrix(q)[:3, :3], robot.mass_matrix(q[:3]), rtol=1e-12, atol=1e-15
    )


@pytest.mark.parametrize("name", ["ur5", "so101", "xarm7"])
def test_robots_without_sliding_fingers_have_none(name):
    robot = load_robot(name)
    assert find_gripper(robot) is None
    assert with_gripper_at(robot, 0.01) is robot
