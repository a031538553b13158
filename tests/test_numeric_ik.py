"""Inverse kinematics by search: exact where it finds something, honest where it does not."""

import math

import numpy as np
import pytest
from arm_family import random_arm
from numpy.testing import assert_allclose, assert_array_equal
from urdfs import FINGERS, GOOD

from arm3dof.model.build import robot_from_description
from arm3dof.model.dh import fit_dh
from arm3dof.model.kinematics import Reason, closed_form_reach, inverse_kinematics
from arm3dof.model.library import load_robot
from arm3dof.model.numeric_ik import search_reach
from arm3dof.model.robot import Description, Limits, Robot

LIBRARY = ("ur5", "panda", "z1", "so100", "so101", "xarm7")


@pytest.fixture(scope="module", params=LIBRARY)
def robot(request):
    return load_robot(request.param)


def chain(*joints, tool="0.3 0 0"):
    """Return an arm of (type, axis, xyz, limits) joints."""
    links = '<link name="l0"/>'
    text = ""
    for i, (kind, axis, xyz, limit) in enumerate(joints):
        inertia = '<inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/>'
        links += f'<link name="l{i + 1}"><inertial><mass value="1"/>{inertia}</inertial></link>'
        text += (
            f'<joint name="j{i + 1}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>'
            f'<limit {limit} effort="1" velocity="1"/></joint>'
        )
    text += (
        f'<joint name="fix" type="fixed"><parent link="l{len(joints)}"/><child link="tool"/>'
        f'<origin xyz="{tool}"/></joint><link name="tool"/>'
    )
    text = f'<robot name="chain">{links}{text}</robot>'
    return robot_from_description(Description("chain", text), "tool")


TURN = 'lower="-2" upper="2"'


def check_reached(robot, p, answer):
    assert answer.reachable, answer.sentence
    assert answer.within_limits.all()
    assert answer.distance == 0.0
    assert answer.branches == tuple(f"numeric-{i + 1}" for i in range(len(answer.solutions)))
    for q in answer.solutions:
        assert_allclose(robot.placement(q).translation, p, atol=1e-9)
    assert (answer.solutions >= robot.limits.q_min).all()
    assert (answer.solutions <= robot.limits.q_max).all()
    for i, q in enumerate(answer.solutions):
        for other in answer.solutions[:i]:
            assert np.abs(q - other).max() > 1e-3


def check_not_reached(robot, answer, reason):
    assert answer.reason is reason
    assert answer.best is None
    assert answer.solutions.shape == (0, robot.nv)
    assert (answer.nearest_q >= robot.limits.q_min).all()
    assert (answer.nearest_q <= robot.limits.q_max).all()
    assert_allclose(robot.placement(answer.nearest_q).translation, answer.nearest, atol=1e-12)
    assert_allclose(answer.distance, math.dist(answer.target, answer.nearest))


# ---- the robots of the library -------------------------------------------------------------------


def test_every_reachable_target_is_reached(robot):
    rng = np.random.default_rng(0)
    for _ in range(12):
        p = robot.placement(robot.random_configuration(rng)).translation
        answer = inverse_kinematics(robot, p)
        check_reached(robot, p, answer)
        middle = 0.5 * (robot.limits.q_min + robot.limits.q_max)
        distances = np.linalg.norm(answer.solutions - middle, axis=1)
        assert_array_equal(distances, np.sort(distances))


@pytest.mark.slow
def test_every_reachable_target_is_reached_80_times(robot):
    rng = np.random.default_rng(1)
    for _ in range(80):
        p = robot.placement(robot.random_configuration(rng)).translation
        check_reached(robot, p, inverse_kinematics(robot, p))


def test_near_is_stayed_at(robot):
    rng = np.random.default_rng(2)
    for _ in range(4):
        q = robot.random_configuration(rng)
        p = robot.placement(q).translation
        answer = inverse_kinematics(robot, p, near=q)
        check_reached(robot, p, answer)
        assert_allclose(answer.best, q, atol=1e-6)
        other = robot.random_configuration(rng)
        answer = inverse_kinematics(robot, p, near=other)
        check_reached(robot, p, answer)
        distances = np.linalg.norm(answer.solutions - other, axis=1)
        assert_array_equal(distances, np.sort(distances))


def test_the_search_is_deterministic(robot):
    p = robot.placement(robot.random_configuration(np.random.default_rng(3))).translation
    first, second = inverse_kinematics(robot, p), inverse_kinematics(robot, p)
    assert_array_equal(first.solutions, second.solutions)


def test_too_far_is_said_with_the_nearest_point(robot):
    rng = np.random.default_rng(4)
    draws = np.array([robot.random_configuration(rng) for _ in range(2000)])
    tools = np.array([robot.placement(q).translation for q in draws])
    for p in ([3.0, 0.5, 0.4], [0.3, -0.4, 4.0]):
        answer = inverse_kinematics(robot, p)
        check_not_reached(robot, answer, Reason.TOO_FAR)
        assert answer.joint is None
        assert answer.distance <= np.linalg.norm(tools - p, axis=1).min()
        again = inverse_kinematics(robot, answer.nearest)
        assert again.distance < 1e-5


# ---- against the closed form ---------------------------------------------------------------------


def narrowed(arm, rng):
    """Return the same arm with random limits."""
    centre, half = rng.uniform(-2, 2, 3), rng.uniform(0.3, 2.0, 3)
    box = Limits(centre - half, centre + half, arm.limits.v_max, arm.limits.tau_max)
    return Robot(
        arm.model,
        limits=box,
        tool_frame=arm.tool_frame,
        damping=arm.damping,
        friction=arm.friction,
        description=arm.description,
    )


def test_search_and_closed_form_say_the_same():
    rng = np.random.default_rng(5)
    reasons = []
    for _ in range(8):
        arm = narrowed(random_arm(rng, upright=False).robot, rng)
        geometry = fit_dh(arm)
        span = geometry.a2 + geometry.a3
        targets = geometry.transform_base_dh[:3, 3] + rng.uniform(-0.7 * span, 0.7 * span, (3, 3))
        for p in (*targets, arm.placement(arm.random_configuration(rng)).translation):
            exact = closed_form_reach(geometry, arm.limits, arm.joint_names, p)
            found = search_reach(arm, p)
            reasons.append(exact.reason)
            assert found.reason == exact.reason
            if exact.reachable:
                check_reached(arm, p, found)
                inside = exact.solutions[exact.within_limits]
                assert len(found.solutions) <= len(inside)
                for q in found.solutions:
                    assert np.abs(q - inside).max(axis=1).min() < 1e-6
            else:
                check_not_reached(arm, found, exact.reason)
                assert_allclose(found.distance, exact.distance, atol=1e-6)
                assert found.joint == exact.joint
    assert set(reasons) == {None, *Reason}


# ---- other kinds of arm --------------------------------------------------------------------------


def test_the_hollow_around_a_lame_elbow_is_too_near():
    arm = chain(
        ("revolute", "0 0 1", "0 0 0", 'lower="-3.1" upper="3.1"'),
        ("revolute", "0 1 0", "0 0.01 0", 'lower="-3.1" upper="3.1"'),
        ("revolute", "0 1 0", "0.4 0 0", 'lower="-3.1" upper="3.1"'),
        tool="0.1 0 0",
    )
    answer = inverse_kinematics(arm, [0.05, 0.05, 0.1])
    check_not_reached(arm, answer, Reason.TOO_NEAR)
    assert answer.distance > 0.1


def test_the_joint_at_fault_of_an_offset_arm():
    arm = chain(
        ("revolute", "0 0 1", "0 0 0", 'lower="-0.5" upper="0.5"'),
        ("revolute", "0 1 0", "0 0.05 0", TURN),
        ("revolute", "0 1 0", "0.4 0 0", TURN),
    )
    answer = inverse_kinematics(arm, [0.2, 0.5, 0.2])
    check_not_reached(arm, answer, Reason.OUTSIDE_LIMITS)
    assert answer.joint == "j1"
    assert "j1" in answer.sentence


def test_a_slider_and_a_joint_without_limits():
    locked = Description("small", GOOD, locked_joints=FINGERS)
    arm = robot_from_description(locked, "grip_tcp")
    rng = np.random.default_rng(6)
    for _ in range(10):
        p = arm.placement(arm.random_configuration(rng)).translation
        check_reached(arm, p, inverse_kinematics(arm, p))
    answer = inverse_kinematics(arm, [2.0, 0.0, 0.2])
    check_not_reached(arm, answer, Reason.TOO_FAR)


def test_a_slider_at_fault_is_named():
    arm = chain(
        ("prismatic", "0 0 1", "0 0 0", 'lower="0" upper="0.2"'),
        ("revolute", "0 0 1", "0 0 0", TURN),
        ("revolute", "0 0 1", "0.3 0 0", TURN),
    )
    check_reached(arm, [0.4, 0.1, 0.1], inverse_kinematics(arm, [0.4, 0.1, 0.1]))
    answer = inverse_kinematics(arm, [0.4, 0.1, 0.5])
    check_not_reached(arm, answer, Reason.TOO_FAR)
    assert_allclose(answer.distance, 0.3, atol=1e-6)


@pytest.mark.parametrize("count", [1, 2])
def test_arms_with_fewer_joints_than_coordinates(count):
    joints = [("revolute", "0 1 0", "0 0 0", TURN), ("revolute", "0 1 0", "0.3 0 0", TURN)]
    arm = chain(*joints[:count])
    q = np.array([0.4, -0.7])[:count]
    p = arm.placement(q).translation
    assert arm.jacobian(q).shape == (6, count)
    answer = inverse_kinematics(arm, p)
    check_reached(arm, p, answer)
    assert np.abs(answer.solutions - q).max(axis=1).min() < 1e-6
    beside = inverse_kinematics(arm, p + np.array([0.0, 0.1, 0.0]))
    check_not_reached(arm, beside, Reason.TOO_FAR)
    assert_allclose(beside.distance, 0.1, atol=1e-6)


def test_absurdly_far_targets_still_have_an_answer():
    arm = load_robot("ur5")
    for far in (1e4, 1e12, 1e300):
        answer = inverse_kinematics(arm, [far, 0.0, 0.0])
        check_not_reached(arm, answer, Reason.TOO_FAR)
        assert_allclose(answer.distance, far, rtol=1e-3)
        assert answer.nearest[0] > 0.8


def test_whole_turns_are_taken_out():
    arm = load_robot("ur5")
    p = arm.placement([6.0, -1.0, 1.0, 5.5, 0.3, -6.0]).translation
    answer = inverse_kinematics(arm, p)
    assert np.abs(answer.solutions).max() <= np.pi
    near = np.array([6.0, -1.0, 1.0, 5.5, 0.3, -6.0])
    assert_allclose(inverse_kinematics(arm, p, near=near).best, near, atol=1e-6)
