"""Overrides change what they say, nothing else, and refuse what makes no sense."""

import numpy as np
import pinocchio as pin
import pytest
from urdfs import FINGERS, GOOD

from arm3dof.errors import InputError, RobotError
from arm3dof.model.library import load_robot
from arm3dof.model.overrides import override_keys
from arm3dof.model.robot import Robot
from arm3dof.model.tree import chain_to
from arm3dof.model.urdf import read_urdf

FORE_BODY = 2  # Pinocchio's number of the body that joint "elbow" moves
UPPER_BODY = 1


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "small.urdf"
    path.write_text(GOOD)
    return path


@pytest.fixture
def plain(path) -> Robot:
    return load_robot(path, locked_joints=FINGERS)


def changed(path, **overrides: float) -> Robot:
    keys = {key.replace("__", "."): value for key, value in overrides.items()}
    return load_robot(path, locked_joints=FINGERS, overrides=keys)


def difference(robot: Robot, other: Robot) -> set[str]:
    """Return what differs between two robots, as words."""
    a, b = robot.model, other.model
    found = set()
    for index in range(1, a.njoints):
        if not a.inertias[index].isApprox(b.inertias[index], 1e-12):
            found.add(f"inertia {a.names[index]}")
        if not a.jointPlacements[index].isApprox(b.jointPlacements[index], 1e-12):
            found.add(f"placement {a.names[index]}")
    for frame, other_frame in zip(a.frames, b.frames, strict=True):
        assert frame.name == other_frame.name
        if frame.type != pin.FrameType.JOINT and not frame.placement.isApprox(
            other_frame.placement, 1e-12
        ):
            found.add(f"frame {frame.name}")
    for name in ("q_min", "q_max", "v_max", "tau_max"):
        if not np.array_equal(getattr(robot.limits, name), getattr(other.limits, name)):
            found.add(name)
    for name in ("damping", "friction", "gravity_acceleration"):
        if not np.array_equal(getattr(robot, name), getattr(other, name)):
            found.add(name)
    return found


def test_no_overrides_change_nothing(path, plain):
    assert difference(plain, changed(path)) == set()


def test_an_override_with_the_old_value_changes_nothing(path, plain):
    assert difference(plain, changed(path, fore__mass=0.3, elbow__effort=2.0)) == set()
    again = changed(path, fore__mass=0.3)
    np.testing.assert_array_equal(
        again.placement([1, 2, 0.05]).homogeneous, plain.placement([1, 2, 0.05]).homogeneous
    )


def test_mass(path, plain):
    robot = changed(path, fore__mass=0.7)
    assert difference(plain, robot) == {"inertia elbow"}
    old, new = plain.model.inertias[FORE_BODY], robot.model.inertias[FORE_BODY]
    assert new.mass == pytest.approx(0.7, abs=1e-15)
    np.testing.assert_allclose(new.lever, old.lever, atol=1e-15)
    np.testing.assert_allclose(new.inertia, old.inertia, atol=1e-15)


def test_centre_of_mass(path, plain):
    robot = changed(path, fore__com__y=0.02, fore__com__z=-0.01)
    assert difference(plain, robot) == {"inertia elbow"}
    np.testing.assert_allclose(robot.model.inertias[FORE_BODY].lever, [0.08, 0.02, -0.01])


def test_inertia_is_set_symmetrically(path, plain):
    robot = changed(path, fore__inertia__iyy=0.00075, fore__inertia__ixy=0.0001)
    assert difference(plain, robot) == {"inertia elbow"}
    expected = [[0.0004, 0.0001, 0], [0.0001, 0.00075, 0], [0, 0, 0.0009]]
    np.testing.assert_allclose(robot.model.inertias[FORE_BODY].inertia, expected, atol=1e-15)


@pytest.mark.parametrize(
    ("key", "value", "changes", "field"),
    [
        ("elbow.effort", 1.5, "tau_max", 1.5),
        ("elbow.velocity", 9.0, "v_max", 9.0),
        ("elbow.lower", -0.5, "q_min", -0.5),
        ("elbow.upper", 0.5, "q_max", 0.5),
        ("elbow.damping", 0.4, "damping", 0.4),
        ("elbow.friction", 0.0, "friction", 0.0),
    ],
)
def test_joint_values(path, plain, key, value, changes, field):
    robot = load_robot(path, locked_joints=FINGERS, overrides={key: value})
    assert difference(plain, robot) == {changes}
    owner = robot.limits if hasattr(robot.limits, changes) else robot
    before = getattr(plain.limits if owner is robot.limits else plain, changes)
    expected = before.copy()
    expected[1] = field
    np.testing.assert_array_equal(getattr(owner, changes), expected)


def test_gravity(path, plain):
    robot = changed(path, gravity__z=-9.8, gravity__x=0.5)
    assert difference(plain, robot) == {"gravity_acceleration"}
    np.testing.assert_array_equal(robot.gravity_acceleration, [0.5, 0.0, -9.8])
    assert robot.description.gravity == (0.5, 0.0, -9.8)


def test_length_to_the_next_joint_runs_through_fixed_links(path, plain):
    robot = changed(path, upper__length=0.3)
    assert difference(plain, robot) == {"placement elbow", "frame plate", "frame bracket"}
    old, new = (r.model.jointPlacements[FORE_BODY] for r in (plain, robot))
    assert np.linalg.norm(new.translation) == pytest.approx(0.3, abs=1e-15)
    np.testing.assert_allclose(
        new.translation / 0.3, old.translation / np.linalg.norm(old.translation), atol=1e-14
    )
    np.testing.assert_allclose(new.rotation, old.rotation, atol=1e-15)


def test_length_of_the_base_and_of_the_last_link(path, plain):
    robot = changed(path, base__length=0.5)
    assert difference(plain, robot) == {"placement pan"}
    np.testing.assert_allclose(robot.model.jointPlacements[1].translation, [0, 0, 0.5])
    robot = changed(path, slider__length=0.08)
    assert difference(plain, robot) == {"frame tip", "frame grip_tcp"}
    to_slider = robot.placement([0, 0, 0.05], "slider").inverse()
    tool = to_slider * robot.placement([0, 0, 0.05])
    np.testing.assert_allclose(tool.translation, [0.08, 0, 0], atol=1e-15)


def test_payload_on_a_link_without_inertial(path, plain):
    robot = changed(path, grip_tcp__mass=0.2, grip_tcp__com__x=0.01)
    assert difference(plain, robot) == {"inertia slide"}
    point = pin.Inertia(0.2, np.array([0.06, 0, 0]), np.zeros((3, 3)))
    expected = plain.model.inertias[3] + point
    np.testing.assert_allclose(robot.model.inertias[3].matrix(), expected.matrix(), atol=1e-15)


def test_limits_and_dynamics_that_the_file_lacks(path, plain):
    path.write_text(GOOD.replace('<limit effort="3" velocity="4"/>', ""))
    with pytest.raises(RobotError, match="effort limit is missing"):
        load_robot(path, locked_joints=FINGERS)
    cured = changed(path, pan__effort=3, pan__velocity=4)
    assert difference(plain, cured) == set()
    path.write_text(GOOD.replace('<dynamics friction="0.05"/>', ""))
    np.testing.assert_array_equal(changed(path, elbow__damping=0.3).damping, [0.2, 0.3, 1.0])


def test_overrides_cure_a_file_only_where_they_reach(path):
    path.write_text(GOOD.replace('effort="2"', 'effort="0"').replace('"0 2 1"', '"0 0 0"'))
    with pytest.raises(RobotError) as caught:
        changed(path, elbow__effort=2)
    assert [problem.what for problem in caught.value.problems] == [
        "its axis is zero",
        "effort limit is 0",
    ]


def test_a_mimic_joint_is_not_lost_on_the_way(path):
    with pytest.raises(RobotError, match="mimics 'finger'"):
        load_robot(path, overrides={"fore.mass": 1.0}, locked_joints=())


def test_locked_names_follow_overridden_limits(path):
    robot = load_robot(path, locked_joints=["finger", "follower"], overrides={"finger.lower": 0.01})
    assert robot.description.locked_joints == {"finger": 0.01, "follower": 0.0}


def test_every_key_can_be_used(path):
    urdf, _ = read_urdf(GOOD)
    keys = override_keys(urdf, "grip_tcp")
    assert len(set(keys)) == len(keys) == 8 * 10 + 4 + 4 + 4 * 6 + 3
    assert "pan.lower" not in keys  # it turns freely
    assert "plate.effort" not in keys  # it is fixed
    assert "left.length" not in keys  # not on the way to the tool
    for key in keys:
        overrides = {key: 0.015}
        name, _, field = key.partition(".")
        if name in ("base", "bracket", "grip_tcp") and field not in ("mass", "length"):
            overrides[f"{name}.mass"] = 0.015
        if field.startswith("inertia"):
            solid = {f"{name}.inertia.{entry}": 0.05 for entry in ("ixx", "iyy", "izz")}
            overrides = solid | overrides
        robot = load_robot(path, locked_joints=["finger", "follower"], overrides=overrides)
        assert np.isfinite(robot.gravity([0.1, 0.2, 0.05])).all()


def test_lengths_of_an_arm_add_up():
    robot = load_robot(overrides={"link2.length": 0.2, "link3.length": 0.3})
    np.testing.assert_allclose(robot.placement(np.zeros(3)).translation, [0.5, 0, 0], atol=1e-12)
    urdf, _ = read_urdf(robot.description.urdf)
    assert [joint.name for joint in chain_to(urdf, "link3")] == ["joint1", "joint2", "joint3"]


# ---- what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("fore.mas", 1, "unknown override 'fore.mas'; did you mean 'fore.mass'?"),
        ("plate.effort", 1, "unknown override 'plate.effort'"),
        ("pan.lower", 0, "unknown override 'pan.lower'"),
        ("gravity", 1, "unknown override 'gravity'"),
        ("qqqqqq", 1, "unknown override 'qqqqqq'; there are: base"),
        (7, 1, "unknown override '7'"),
        ("fore.mass", -1, "'fore.mass' is -1; give 0 or more"),
        ("fore.mass", "1", "'fore.mass' is '1'; give a finite number"),
        ("fore.mass", True, "'fore.mass' is True; give a finite number"),
        ("fore.mass", None, "'fore.mass' is None; give a finite number"),
        ("fore.com.x", float("nan"), "give a finite number"),
        ("gravity.z", float("inf"), "give a finite number"),
        ("elbow.effort", 0, "'elbow.effort' is 0; give a number above 0"),
        ("elbow.velocity", -2.0, "'elbow.velocity' is -2.0; give a number above 0"),
        ("elbow.damping", -1e-9, "give 0 or more"),
        ("upper.length", 0.0, "give a number above 0"),
        ("grip_tcp.com.x", 0.1, "'grip_tcp.com.x' has no effect"),
    ],
)
def test_impossible_overrides(path, key, value, message):
    with pytest.raises(InputError) as caught:
        load_robot(path, locked_joints=FINGERS, overrides={key: value})
    assert message in str(caught.value)


def test_the_list_of_keys_names_links_and_joints_together(path):
    with pytest.raises(InputError) as caught:
        changed(path, nothing=1)
    message = str(caught.value)
    assert "pan . effort, velocity, damping, friction;" in message
    assert (
        "elbow|slide|finger|follower . effort, velocity, damping, friction, lower, upper" in message
    )
    assert message.endswith("gravity . x, y, z")


def test_values_that_do_not_go_together(path):
    with pytest.raises(RobotError, match="is that of no solid"):
        changed(path, fore__inertia__ixx=1.0)
    with pytest.raises(RobotError, match="lower limit 3 is not below upper limit 2"):
        changed(path, elbow__lower=3)
    with pytest.raises(RobotError, match="moves and has zero mass"):
        changed(path, fore__mass=0)
