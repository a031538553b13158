"""Loading robots by name and by path, and what is said when that cannot be."""

import os
import subprocess
import sys
import textwrap
from importlib import metadata
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from urdfs import FINGERS, GOOD

from arm3dof.errors import FrameNotFound, InputError, MissingExtra, MissingFile, RobotError
from arm3dof.model import catalogue
from arm3dof.model.build import default_tool, robot_from_description
from arm3dof.model.library import bundled_urdf, list_robots, load_robot, problems_of
from arm3dof.model.robot import Description
from arm3dof.model.urdf import read_urdf

LIBRARY = {
    "ur5": (6, "tool0"),
    "panda": (7, "panda_hand_tcp"),
    "z1": (6, "tool"),
    "so100": (5, "tool"),
    "so101": (5, "gripper_frame_link"),
    "xarm7": (7, "link_eef"),
}


@pytest.fixture
def path(tmp_path) -> Path:
    path = tmp_path / "small.urdf"
    path.write_text(GOOD)
    return path


# ---- by name -------------------------------------------------------------------------------------


def test_the_reference_arm():
    robot = load_robot()
    assert robot.joint_names == ("joint1", "joint2", "joint3")
    assert robot.tool_frame == "tool"
    assert robot.description.source == "arm3dof"
    np.testing.assert_array_equal(robot.limits.tau_max, [1.96] * 3)
    np.testing.assert_array_equal(robot.limits.v_max, [7.5] * 3)
    assert problems_of("arm3dof") == ()


@pytest.mark.parametrize("name", LIBRARY)
def test_library_robots_load_quietly(name, capfd):
    robot = load_robot(name)
    assert (robot.nv, robot.tool_frame) == LIBRARY[name]
    assert robot.model.nq == robot.nv
    assert problems_of(name) == ()
    rng = np.random.default_rng(0)
    for _ in range(20):
        q, v, tau = robot.random_configuration(rng), *rng.normal(size=(2, robot.nv))
        acceleration = robot.forward_dynamics(q, v, tau)
        np.testing.assert_allclose(robot.inverse_dynamics(q, v, acceleration), tau, atol=1e-9)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["arm3dof", *LIBRARY])
def test_meshes_and_shapes_can_be_drawn(name, capfd):
    robot = load_robot(name)
    geometry = pin.buildGeomFromUrdfString(
        robot.model,
        robot.description.urdf,
        pin.GeometryType.VISUAL,
        package_dirs=[str(folder) for folder in robot.description.package_dirs],
        mesh_loader=coal.MeshLoader(coal.NODE_TYPE.BV_AABB),  # the cheapest tree for collisions
    )
    assert geometry.ngeoms > 0
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "joint"),
    [
        ("panda", "panda_finger_joint1"),
        ("so101", "gripper"),
        ("ur5", "elbow_joint"),
        ("xarm7", "joint4"),
    ],
)
@pytest.mark.parametrize("share", [0.0, 0.3])
def test_locking_equals_pinocchios_reduced_model(name, joint, share):
    others = {"panda_finger_joint2": 0.01} if name == "panda" else {}
    full = load_robot(name, locked_joints=others)
    index = full.joint_names.index(joint)
    low, high = full.limits.q_min[index], full.limits.q_max[index]
    reference = np.zeros(full.nv)
    reference[index] = low + share * (high - low)
    robot = load_robot(name, locked_joints={**others, joint: reference[index]})
    reduced = pin.buildReducedModel(full.model, [full.model.getJointId(joint)], reference)
    assert robot.joint_names == tuple(reduced.names[1:])
    for ours, theirs in zip(robot.model.inertias, reduced.inertias, strict=True):
        assert ours.isApprox(theirs, 1e-12)
    np.testing.assert_array_equal(robot.model.velocityLimit, reduced.velocityLimit)
    q = robot.random_configuration(np.random.default_rng(1))
    data = reduced.createData()
    pin.framesForwardKinematics(reduced, data, q)
    tool = data.oMf[reduced.getFrameId(robot.tool_frame)]
    assert robot.placement(q).isApprox(tool, 1e-12)
    np.testing.assert_allclose(robot.mass_matrix(q), pin.crba(reduced, data, q), atol=1e-12)


def test_so100s_link_and_joint_of_one_name():
    robot = load_robot("so100")
    to_gripper = robot.placement(np.zeros(5), "gripper").inverse()
    tool = to_gripper * robot.placement(np.zeros(5))
    np.testing.assert_allclose(tool.translation, [0, -0.098, 0], atol=1e-12)


def test_library_robots_take_overrides():
    robot = load_robot("so101", overrides=dict.fromkeys(["elbow_flex.effort"], 2.94))
    np.testing.assert_array_equal(robot.limits.tau_max, [10, 10, 2.94, 10, 10])
    assert robot.tool_frame == "gripper_frame_link"


def test_list_agrees_with_what_is_loaded():
    entries = list_robots()
    assert [entry.name for entry in entries] == ["arm3dof", *LIBRARY]
    for entry in entries:
        robot = load_robot(entry.name)
        assert entry.installed
        assert (entry.joints, entry.tool_frame) == (robot.nv, robot.tool_frame)
    notes = {entry.name: entry.note for entry in entries}
    assert "35 N m" in notes["so100"]
    assert "2.94 N m" in notes["so101"]


def test_without_the_extra(monkeypatch):
    def missing(name: str) -> metadata.Distribution:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", missing)
    with pytest.raises(MissingExtra, match=r"robot 'ur5' needs the extra 'robots': pip install"):
        load_robot("ur5")
    installed = {entry.name: entry.installed for entry in list_robots()}
    assert installed == {"arm3dof": True, **dict.fromkeys(LIBRARY, False)}
    assert load_robot().nv == 3


def test_bundled_robots_are_found_in_the_package_first(monkeypatch, tmp_path):
    first, second = tmp_path / "a", tmp_path / "b"
    for folder, names in ((first, ["x"]), (second, ["x", "y"])):
        folder.mkdir()
        for name in names:
            (folder / f"{name}.urdf").write_text(GOOD)
    monkeypatch.setattr(catalogue, "_BUNDLED_FOLDERS", (first, second))
    assert catalogue.bundled_names() == ("x", "y")
    assert bundled_urdf("x") == first / "x.urdf"
    assert bundled_urdf("y") == second / "y.urdf"
    with pytest.raises(InputError, match="no bundled robot 'z'; there are: x, y"):
        bundled_urdf("z")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("ur6", "no robot 'ur6'; did you mean 'ur5'? there are: arm3dof, ur5, panda"),
        ("", "no robot ''; there are: arm3dof"),
        ("zzzzzz", "or give the path of a URDF file"),
    ],
)
def test_unknown_names(name, message):
    with pytest.raises(InputError) as caught:
        load_robot(name)
    assert message in str(caught.value)


# ---- by path -------------------------------------------------------------------------------------


def test_paths_of_all_kinds(path, monkeypatch):
    robots = [load_robot(source, locked_joints=FINGERS) for source in (path, str(path))]
    monkeypatch.chdir(path.parent)
    monkeypatch.setenv("HOME", str(path.parent))
    (path.parent / "bare").write_text(GOOD)
    for source in ("small.urdf", "./small.urdf", "~/small.urdf", "bare"):
        robots.append(load_robot(source, locked_joints=FINGERS))
    for robot in robots:
        assert robot.joint_names == ("pan", "elbow", "slide")
        assert robot.description.package_dirs[0] == path.parent.resolve()


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(MissingFile, match=r"nope\.urdf: no such file"):
        load_robot("nope.urdf")
    with pytest.raises(MissingFile, match="is a directory"):
        load_robot(tmp_path)
    with pytest.raises(MissingFile, match="no such file"):
        problems_of("folder/robot")
    with pytest.raises(InputError, match="give the path of a URDF"):
        load_robot("a\0b.urdf")


def test_broken_files(tmp_path, capfd):
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot>\n<link></robot>")
    with pytest.raises(RobotError, match=r"broken\.urdf: line 2, column \d+: broken XML") as caught:
        load_robot(broken)
    assert problems_of(broken) == caught.value.problems
    broken.write_bytes(bytes(range(256)))
    assert len(problems_of(str(broken))) == 1
    assert capfd.readouterr() == ("", "")


def test_problems_depend_on_what_is_locked(path):
    assert problems_of(path, locked_joints=FINGERS) == ()
    (problem,) = problems_of(path, locked_joints=())
    assert problem.where == "joint 'follower'"
    with pytest.raises(RobotError) as caught:
        load_robot(path, locked_joints=())
    assert caught.value.problems == (problem,)


def test_coupled_fingers_are_held_unless_something_else_is_said(path):
    assert problems_of(path) == ()
    assert load_robot(path).description.locked_joints == {"finger": 0.0, "follower": 0.0}
    moved = load_robot(path, locked_joints={"finger": 0.01})
    assert moved.description.locked_joints == {"finger": 0.01, "follower": 0.01}
    free = load_robot(path, locked_joints=["follower"])
    assert free.joint_names == ("pan", "elbow", "slide", "finger")
    stiff = load_robot(path, locked_joints={"elbow": 0.3})
    assert stiff.description.locked_joints == {"elbow": 0.3, "finger": 0.0, "follower": 0.0}


def test_the_reference_arms_gripper_can_be_held_anywhere_or_moved():
    closed = load_robot(locked_joints={"gripper": 0.033})
    pads = [closed.placement(np.zeros(3), f"{side}_finger") for side in ("right", "left")]
    for pad in pads:
        np.testing.assert_allclose(pad.translation, [0.255, 0.0, 0.0], atol=1e-12)
    moving = load_robot(locked_joints=["left_finger_joint"])
    assert moving.joint_names == ("joint1", "joint2", "joint3", "gripper")
    assert (moving.tool_frame, moving.nv) == ("tool", 4)


def test_continuous_joints_are_revolute_ones_without_limits(path):
    robot = load_robot(path, locked_joints=FINGERS)
    assert robot.model.nq == robot.nv == 3
    np.testing.assert_array_equal(robot.limits.q_min, [-np.inf, -1.5, 0.01])
    np.testing.assert_array_equal(robot.limits.q_max, [np.inf, 2.0, 0.1])
    np.testing.assert_array_equal(robot.model.lowerPositionLimit, robot.limits.q_min)
    np.testing.assert_array_equal(robot.model.upperPositionLimit, robot.limits.q_max)
    np.testing.assert_array_equal(robot.model.velocityLimit, robot.limits.v_max)
    np.testing.assert_array_equal(robot.model.effortLimit, robot.limits.tau_max)
    np.testing.assert_array_equal(robot.model.damping, robot.damping)
    np.testing.assert_array_equal(robot.model.friction, robot.friction)
    np.testing.assert_array_equal(robot.damping, [0.2, 0.0, 1.0])
    np.testing.assert_array_equal(robot.friction, [0.1, 0.05, 0.0])


def test_what_pinocchios_reader_stumbles_over_is_tidied(path, capfd):
    text = GOOD.replace('<mass value="0.3"/>', '<mass value=" 0.3&#10;"/>')
    text = text.replace('<dynamics friction="0.05"/>', "<dynamics/><calibration rising='x'/>")
    text = text.replace('<safety_controller k_velocity="10"/>', "<safety_controller/>")
    path.write_text(text.replace('version="1.0"', 'version="1"'))
    robot = load_robot(path, locked_joints=FINGERS)
    assert robot.model.inertias[2].mass == 0.3
    assert robot.friction[1] == 0.0
    drawn = pin.buildModelFromXML(robot.description.urdf)  # what a viewer parses once more
    assert drawn.nv == 5
    assert drawn.inertias[2].mass == 0.3
    assert capfd.readouterr() == ("", "")


def test_a_locked_position_moves_what_hangs_on_it(path):
    at_zero = load_robot(path, locked_joints=["finger", "follower"])
    apart = load_robot(path, locked_joints=FINGERS)
    q = [0.3, 0.4, 0.05]
    between = at_zero.placement(q, "left").inverse() * apart.placement(q, "left")
    np.testing.assert_allclose(between.translation, [0, 0.015, 0], atol=1e-15)
    turned = load_robot(path, locked_joints={**FINGERS, "elbow": 0.7})
    assert turned.joint_names == ("pan", "slide")
    reference = apart.placement([0.3, 0.7, 0.05])
    assert turned.placement([0.3, 0.05]).isApprox(reference, 1e-14)


def test_unknown_joints_and_frames(path):
    with pytest.raises(FrameNotFound, match="no movable joint 'thumb'; this robot has: pan"):
        load_robot(path, locked_joints=["thumb"])
    with pytest.raises(FrameNotFound, match="no frame 'tol'; this robot has: universe, base"):
        load_robot(path, locked_joints=FINGERS, tool_frame="tol")
    with pytest.raises(FrameNotFound, match="no frame 'tol'"):
        load_robot(path, locked_joints=FINGERS, tool_frame="tol", overrides={"fore.mass": 1})


def test_a_joints_frame_can_be_the_tool(path):
    robot = load_robot(
        path, locked_joints=FINGERS, tool_frame="tip", overrides={"slider.length": 0.07}
    )
    to_slider = robot.placement([0, 0, 0.05], "slider").inverse()
    np.testing.assert_allclose(
        (to_slider * robot.placement([0, 0, 0.05])).translation, [0.07, 0, 0], atol=1e-15
    )


@pytest.mark.parametrize(
    ("renamed", "tool"),
    [
        ({}, "grip_tcp"),
        ({"grip_tcp": "tcp"}, "tcp"),
        ({"bracket": "tool0", "grip_tcp": "ee_link"}, "tool0"),
        ({"grip_tcp": "last"}, "last"),  # as deep as the fingers' links, and locked as they are
        ({"base": "tool", "grip_tcp": "ee_link"}, "ee_link"),  # the base does not move
    ],
)
def test_default_tool(renamed, tool):
    text = GOOD
    for old, new in renamed.items():
        text = text.replace(f'"{old}"', f'"{new}"')
    urdf, _ = read_urdf(text)
    if tool == "last":
        assert default_tool(urdf, FINGERS) == "left"  # the first in the file of equal leaves
        assert default_tool(urdf, {}) == "left"
        return
    assert default_tool(urdf, FINGERS) == tool


def test_package_folders(tmp_path):
    package = tmp_path / "ws" / "small_description"
    (package / "urdf").mkdir(parents=True)
    path = package / "urdf" / "small.urdf"
    mesh = '<mesh filename="package://small_description/meshes/a.stl"/>'
    path.write_text(GOOD.replace('<sphere radius="0.03"/>', mesh))
    robot = load_robot(path, locked_joints=FINGERS)
    assert robot.description.package_dirs == (path.parent, package.parent)


# ---- again from its description ------------------------------------------------------------------


@pytest.mark.parametrize("name", ["arm3dof", "so100", "panda"])
def test_a_robot_can_be_rebuilt_without_its_file(name):
    overrides = {"gravity.x": 1.0, "gravity.z": -9.8} if name == "arm3dof" else None
    robot = load_robot(name, overrides=overrides)
    description = Description.from_dict(robot.description.to_dict())
    again = robot_from_description(description, robot.tool_frame)
    assert again.description == robot.description
    assert (again.name, again.joint_names) == (robot.name, robot.joint_names)
    np.testing.assert_array_equal(again.gravity_acceleration, robot.gravity_acceleration)
    q = robot.random_configuration(np.random.default_rng(3))
    np.testing.assert_array_equal(again.mass_matrix(q), robot.mass_matrix(q))
    np.testing.assert_array_equal(again.gravity(q), robot.gravity(q))
    np.testing.assert_array_equal(again.placement(q).homogeneous, robot.placement(q).homogeneous)
    for side in ("q_min", "q_max", "v_max", "tau_max"):
        np.testing.assert_array_equal(getattr(again.limits, side), getattr(robot.limits, side))


def test_a_description_that_is_no_robot():
    with pytest.raises(RobotError, match="notes: line 1, column 1: broken XML"):
        robot_from_description(Description("notes", "hello"))


def test_loading_without_overrides_imports_no_yourdfpy():
    code = """
    import sys
    from arm3dof.model.library import load_robot
    load_robot()
    assert "yourdfpy" not in sys.modules
    load_robot(overrides={"link2.mass": 0.2})
    assert "yourdfpy" in sys.modules
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONWARNINGS": "error"},
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
