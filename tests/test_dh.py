import importlib
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import sympy as sp
from arm_family import random_arm
from numpy.testing import assert_allclose

from arm3dof.errors import InputError, Problem
from arm3dof.model.build import robot_from_description
from arm3dof.model.dh import (
    DhGeometry,
    DhMisfit,
    chain,
    dh_table,
    fit_dh,
    link_transform,
    link_transforms,
    position,
    rotation,
)
from arm3dof.model.robot import Description

ROOT = Path(__file__).resolve().parents[1]
REFERENCE = (ROOT / "urdf" / "arm3dof.urdf").read_text(encoding="utf-8")


def build(text, tool="tool", gravity=(0.0, 0.0, -9.81), locked=()):
    locked = {"gripper": 0.0, "left_finger_joint": 0.0, **dict(locked)}
    description = Description("test", text, locked_joints=locked, gravity=gravity)
    return robot_from_description(description, tool)


def edited(*replacements):
    """Return the reference arm's URDF with its joints written otherwise."""
    text = REFERENCE
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    return text


def link_origin(parent):
    """Return the origin element of the joint below a link, as the reference arm writes it."""
    before = REFERENCE.split(f'<parent link="{parent}" />')[0]
    return "<origin" + before.rsplit("<origin", 1)[1]


def moved(parent, xyz, rpy="0 0 0"):
    old = link_origin(parent)
    return old, f'<origin xyz="{xyz}" rpy="{rpy}" />' + old.split("/>", 1)[1]


@pytest.fixture
def derive(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    return importlib.import_module("arm_lagrangian")


# ---- the formulas (3)-(7) ----------------------------------------------------------------------


def test_link_transform_is_the_modified_convention():
    a, alpha, d, theta = 0.3, 0.7, -0.2, 1.1
    about_x = pin.SE3(pin.utils.rotate("x", alpha), np.array([a, 0.0, 0.0]))
    about_z = pin.SE3(pin.utils.rotate("z", theta), np.array([0.0, 0.0, d]))
    expected = (about_x * about_z).homogeneous
    assert_allclose(link_transform(a, alpha, d, theta), expected, atol=1e-15)


@pytest.mark.parametrize("quarters", range(-4, 5))
def test_right_angles_are_exact(quarters):
    transform = link_transform(0.0, quarters * np.pi / 2, 0.0, 0.0)
    assert set(np.abs(transform[:3, :3]).ravel()) == {0.0, 1.0}
    assert_allclose(
        transform[:3, :3], pin.utils.rotate("x", quarters * np.pi / 2), rtol=0, atol=1e-15
    )


def test_table_one():
    one, two, three, four = dh_table(0.105, 0.150)
    assert one == (0.0, np.pi / 2, 0.0)
    assert two == (0.105, 0.0, 0.0)
    assert three == (0.150, 0.0, 0.0)
    assert four == (0.0, 0.0, 0.0)


def test_chain_is_the_product_of_the_link_transforms():
    theta = np.random.default_rng(1).uniform(-np.pi, np.pi, (4, 5, 3))
    t01, t12, t23, t34 = link_transforms(theta, 0.3, 0.2)
    assert_allclose(chain(theta, 0.3, 0.2), t01 @ t12 @ t23 @ t34, atol=1e-15)
    assert chain(theta, 0.3, 0.2).shape == (4, 5, 4, 4)


def test_rotation_and_position_are_those_of_the_chain():
    theta = np.random.default_rng(2).uniform(-np.pi, np.pi, (10_000, 3))
    product = chain(theta, 0.105, 0.150)
    assert_allclose(rotation(theta), product[:, :3, :3], atol=1e-15)
    assert_allclose(position(theta, 0.105, 0.150), product[:, :3, 3], atol=1e-15)


def test_empty_batches_give_empty_results():
    none = np.empty((0, 3))
    assert chain(none, 0.1, 0.2).shape == (0, 4, 4)
    assert rotation(none).shape == (0, 3, 3)
    assert position(none, 0.1, 0.2).shape == (0, 3)


@pytest.mark.parametrize("wrong", [0.0, [1.0, 2.0], np.zeros((3, 4))])
def test_angles_of_another_shape_are_refused(wrong):
    with pytest.raises(InputError, match=r"shape \(\.\.\., 3\)"):
        position(wrong, 0.1, 0.2)


def test_symbolic_chain_equals_the_printed_formulas_and_the_numbers(derive):
    q1, q2, q3 = derive.Q
    zero = sp.Integer(0)
    frame3 = derive.joint_frames()[2]
    tool = frame3 * derive.link_transform(derive.A3, zero, zero, zero)
    c1, s1, c2, s2 = sp.cos(q1), sp.sin(q1), sp.cos(q2), sp.sin(q2)
    c3, s3 = sp.cos(q3), sp.sin(q3)
    a2, a3 = derive.A2, derive.A3
    printed = sp.Matrix(
        [
            [c1 * c2 * c3 - c1 * s2 * s3, -c1 * c2 * s3 - c1 * s2 * c3, s1],
            [c2 * s1 * c3 - s2 * s1 * s3, -c2 * s1 * s3 - s2 * s1 * c3, -c1],
            [s2 * c3 + c2 * s3, -s2 * s3 + c2 * c3, 0],
        ]
    )
    place = sp.Matrix(
        [
            a3 * (c1 * c2 * c3 - c1 * s2 * s3) + c1 * c2 * a2,
            a3 * (c2 * s1 * c3 - s2 * s1 * s3) + c2 * s1 * a2,
            a3 * sp.sin(q2 + q3) + s2 * a2,
        ]
    )
    symbolic = sp.Matrix.hstack(printed, place)
    assert (tool[:3, :] - symbolic.applyfunc(derive.abbreviated)).applyfunc(
        derive.normal
    ) == sp.zeros(3, 4)
    evaluate = sp.lambdify([q1, q2, q3, a2, a3], symbolic, "numpy")
    for theta in np.random.default_rng(3).uniform(-np.pi, np.pi, (50, 3)):
        numbers = chain(theta, 0.105, 0.150)[:3]
        assert_allclose(evaluate(*theta, 0.105, 0.150), numbers, atol=1e-15)


# ---- the fit -----------------------------------------------------------------------------------


def test_reference_arm_is_the_paper_chain():
    geometry = DhGeometry.from_robot(build(REFERENCE))
    assert_allclose([geometry.a2, geometry.a3], [0.105, 0.150], rtol=1e-15)
    assert_allclose(geometry.transform_base_dh, np.eye(4), atol=1e-15)
    assert_allclose(geometry.sign, np.ones(3))
    assert_allclose(geometry.offset, np.zeros(3), atol=1e-15)


def test_reference_link_frames_are_the_dh_frames():
    robot = build(REFERENCE)
    for q in np.random.default_rng(4).uniform(-3, 3, (20, 3)):
        frame = np.eye(4)
        names = ("link1", "link2", "link3", "tool")
        for name, move in zip(names, link_transforms(q, 0.105, 0.150), strict=True):
            frame = frame @ move
            assert_allclose(robot.placement(q, name).homogeneous, frame, atol=1e-14)


@pytest.mark.parametrize("upright", [True, False])
@pytest.mark.parametrize("seed", range(50))
def test_random_arms_fit_and_have_pinocchio_kinematics(seed, upright):
    rng = np.random.default_rng([seed, upright])
    arm = random_arm(rng, upright=upright)
    geometry = DhGeometry.from_robot(arm.robot)
    assert_allclose([geometry.a2, geometry.a3], [arm.a2, arm.a3], rtol=1e-12)
    q = rng.uniform(-np.pi, np.pi, (20, 3))
    expected = [arm.robot.placement(one).translation for one in q]
    assert_allclose(geometry.tool_position(q), expected, rtol=0, atol=1e-14)
    assert_allclose(geometry.from_dh(geometry.to_dh(q)), q, atol=1e-14)
    base = geometry.transform_base_dh
    assert_allclose(base[:3, :3] @ base[:3, :3].T, np.eye(3), atol=1e-14)
    assert base[2, 2] >= 0.0
    if upright:
        assert_allclose(base[:3, :3], np.eye(3), atol=1e-14)


def test_frame_zero_points_up_when_the_first_axis_points_down():
    text = edited(('<axis xyz="0 0 1" />', '<axis xyz="0 0 -1" />'))
    geometry = DhGeometry.from_robot(build(text))
    assert_allclose(geometry.transform_base_dh, np.eye(4), atol=1e-15)
    assert_allclose(geometry.sign, [-1.0, -1.0, -1.0])
    assert_allclose(geometry.offset, np.zeros(3), atol=1e-15)


def test_a_first_axis_across_gravity_keeps_its_own_sense():
    geometry = DhGeometry.from_robot(build(REFERENCE, gravity=(9.81, 0.0, 0.0)))
    assert geometry.sign[0] == 1.0
    assert_allclose(DhGeometry.from_robot(build(REFERENCE, gravity=(0, 0, 0))).sign, np.ones(3))


def test_a_first_axis_along_x_takes_its_horizontal_from_y():
    text = edited(moved("base_link", "0 0 0.1", "0 1.5707963267948966 0"))
    robot = build(text)
    geometry = DhGeometry.from_robot(robot)
    expected = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    assert_allclose(geometry.transform_base_dh[:3, :3], expected, atol=1e-15)
    q = np.array([0.3, -0.8, 1.2])
    assert_allclose(geometry.tool_position(q), robot.placement(q).translation, atol=1e-15)


def test_an_elbow_that_turns_the_other_way_has_a_negative_sign():
    text = edited(moved("link2", "0.105 0 0", f"{np.pi!r} 0 0"))
    assert_allclose(DhGeometry.from_robot(build(text)).sign, [1.0, 1.0, -1.0])


def test_geometry_is_frozen():
    geometry = DhGeometry.from_robot(build(REFERENCE))
    for array in (geometry.transform_base_dh, geometry.sign, geometry.offset):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 2.0


MISFITS = {
    "skew": (moved("link1", "0 0 0", "1.4 0 0"), "joint2", "9.79 deg from perpendicular"),
    "rounded": (moved("link1", "0 0 0", "1.5708 0 0"), "joint2", "0.00021 deg"),
    "apart": (
        moved("link1", "0.02 0 0", "1.5707963267948966 0 0"),
        "joint2",
        "distance of 0.02 m",
    ),
    "tilted": (moved("link2", "0.105 0 0", "0.2 0 0"), "joint3", "not parallel to joint 'joint2'"),
    "no upper arm": (moved("link2", "0 0 0.03"), "joint3", "no length"),
    "no forearm": (moved("link3", "0 0 0.03"), "tool", "no length"),
    "beside": (moved("link3", "0.15 0 0.01"), "tool", "0.01 m beside"),
}


@pytest.mark.parametrize("name", MISFITS)
def test_other_geometry_says_what_differs(name):
    edit, where, what = MISFITS[name]
    robot = build(edited(edit))
    problem = fit_dh(robot)
    assert isinstance(problem, Problem)
    assert where in problem.where
    assert what in problem.what
    assert problem.cure
    with pytest.raises(DhMisfit, match=r"arm3dof does not fit the paper's chain") as caught:
        DhGeometry.from_robot(robot)
    assert caught.value.problem == problem


def test_rounded_angles_are_told_and_can_be_taken_on_purpose():
    robot = build(edited(MISFITS["rounded"][0]))
    assert "1.5707963267948966" in fit_dh(robot).cure
    geometry = DhGeometry.from_robot(robot, tolerance=1e-5)
    q = np.array([0.3, 0.8, -1.2])
    error = geometry.tool_position(q) - robot.placement(q).translation
    assert 1e-9 < np.linalg.norm(error) < 1e-5


def test_another_number_of_joints_does_not_fit():
    problem = fit_dh(build(REFERENCE, locked={"joint3": 0.4}))
    assert "has 2 moving joints" in problem.what


def test_a_sliding_joint_does_not_fit():
    text = edited(
        ('<joint name="joint3" type="revolute">', '<joint name="joint3" type="prismatic">')
    )
    problem = fit_dh(build(text))
    assert problem.where == "joint 'joint3'"
    assert "not revolute (PZ)" in problem.what


def test_a_branched_robot_does_not_fit():
    text = edited(('<parent link="link2" />', '<parent link="link1" />'))
    assert "do not follow one another" in fit_dh(build(text)).what


def test_a_tool_on_an_inner_link_does_not_fit():
    assert "do not follow one another" in fit_dh(build(REFERENCE, tool="link2")).what
