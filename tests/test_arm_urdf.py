import importlib
from dataclasses import replace
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose

from arm3dof.model.build import robot_from_description
from arm3dof.model.robot import Description

ROOT = Path(__file__).resolve().parents[1]
URDF = ROOT / "urdf" / "arm3dof.urdf"
TEXT = URDF.read_text(encoding="utf-8")
TREE = ElementTree.fromstring(TEXT)
STALL = 1.96
OPEN = {"gripper": 0.0, "left_finger_joint": 0.0}
FINGERS = ("right_finger", "left_finger")


@pytest.fixture(scope="module")
def tools():
    """The scripts that make the arm, by name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "tools"))
        yield importlib.import_module


@pytest.fixture
def robot():
    return robot_from_description(Description("arm3dof", TEXT, locked_joints=OPEN))


# ---- the script --------------------------------------------------------------------------------


def test_file_is_what_the_script_writes(tools):
    assert tools("make_arm_urdf").main(["--check"]) == 0


def test_another_file_is_told(tools, tmp_path, monkeypatch, capsys):
    script = tools("make_arm_urdf")
    monkeypatch.setattr(script, "URDF", tmp_path / "arm.urdf")
    assert script.main(["--check"]) == 1
    assert "run it" in capsys.readouterr().err
    assert script.main([]) == 0
    assert "link3: " in capsys.readouterr().out
    assert script.main(["--check"]) == 0
    assert (tmp_path / "arm.urdf").read_text(encoding="utf-8") == TEXT


def test_a_box_weighs_as_its_eight_octants(tools):
    shapes = tools("arm_shapes")
    material = shapes.Material("m", (0, 0, 0), 1000.0)
    centre, size = np.array([10.0, -20.0, 30.0]), np.array([40.0, 60.0, 80.0])
    whole = shapes.sum_parts([shapes.Part("w", shapes.Box(tuple(size)), tuple(centre), material)])
    octant = shapes.Box(tuple(size / 2))
    pieces = shapes.sum_parts(
        shapes.Part("p", octant, tuple(centre + np.array(corner) * size / 4), material)
        for corner in product((-1, 1), repeat=3)
    )
    assert_allclose(whole.mass, 0.192)
    for have, want in zip(vars(pieces).values(), vars(whole).values(), strict=True):
        assert_allclose(have, want, rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize("axis", "xyz")
def test_inertia_is_that_of_a_cloud_of_points(tools, axis):
    shapes = tools("arm_shapes")
    material = shapes.Material("m", (0, 0, 0), 2000.0)
    parts = [
        shapes.Part("c", shapes.Cylinder(20.0, 30.0, axis), (10.0, 0.0, 5.0), material),
        shapes.Part("b", shapes.Box((20.0, 30.0, 10.0)), (-40.0, 25.0, 0.0), material),
    ]
    rng = np.random.default_rng(1)
    points = rng.uniform(-70.0, 70.0, (2_000_000, 3)) * 1e-3
    long = "xyz".index(axis)
    offset = points - np.array([0.010, 0.0, 0.005])
    round_part = np.linalg.norm(np.delete(offset, long, axis=1), axis=1) < 0.020
    in_cylinder = round_part & (np.abs(offset[:, long]) < 0.015)
    from_box = np.abs(points - np.array([-0.040, 0.025, 0.0]))
    in_box = np.all(from_box < np.array([0.010, 0.015, 0.005]), axis=1)
    inside = points[in_cylinder | in_box]
    weight = 2000.0 * 0.140**3 / len(points)
    body = shapes.sum_parts(parts)
    assert_allclose(body.mass, weight * len(inside), rtol=0.02)
    centroid = inside.mean(axis=0)
    assert_allclose(body.centroid, centroid, atol=4e-4)
    arms = inside - centroid
    tensor = weight * (np.sum(arms**2) * np.eye(3) - arms.T @ arms)
    assert_allclose(body.tensor, tensor, atol=0.03 * np.abs(tensor).max())


def test_urdf_inertias_are_the_sums_of_the_parts(tools, robot):
    links, opening = tools("arm_parts").LINKS, tools("arm_parts").OPENING
    forearm = [*links["link3"]]
    for name, side in zip(FINGERS, (1.0, -1.0), strict=True):
        pad = np.array([150.0, 0.0, side * opening / 2])
        forearm += [replace(part, at=tuple(part.at + pad)) for part in links[name]]
    bodies = (links["link1"], links["link2"], forearm)
    for parts, inertia in zip(bodies, robot.model.inertias[1:], strict=True):
        body = tools("arm_shapes").sum_parts(parts)
        assert_allclose(inertia.mass, body.mass, rtol=1e-5)
        assert_allclose(inertia.lever, body.centroid, rtol=1e-5)
        assert_allclose(inertia.inertia, body.tensor, rtol=1e-5)


def test_four_servos_weigh_sixty_grams_each(tools):
    parts = [part for parts in tools("arm_parts").LINKS.values() for part in parts]
    servos = [part for part in parts if part.name.endswith("_servo")]
    assert len(servos) == 4
    for servo in servos:
        assert servo.weight == 0.060
        assert sorted(servo.shape.size) == [20.0, 40.0, 40.5]
        assert not servo.drawn
    details = [part for part in parts if "_servo_" in part.name]
    assert details
    assert sum(part.weight for part in details) == 0.0


# ---- the arm -----------------------------------------------------------------------------------


def test_joints_links_and_tool(robot):
    assert robot.name == "arm3dof"
    assert robot.joint_names == ("joint1", "joint2", "joint3")
    assert robot.tool_frame == "tool"
    names = [link.get("name") for link in TREE.iter("link")]
    assert names == ["base_link", "link1", "link2", "link3", *FINGERS, "tool"]


def test_zero_pose_is_stretched_forward_and_joint_two_lifts(robot):
    assert_allclose(robot.placement([0, 0, 0]).translation, [0.255, 0, 0], atol=1e-12)
    assert_allclose(robot.placement([0.1, 0, 0]).translation[1], 0.255 * np.sin(0.1))
    assert robot.placement([0, 0.1, 0]).translation[2] > 0.02
    assert robot.placement([0, 0, 0.1]).translation[2] > 0.01
    for link in ("link1", "link2"):
        assert_allclose(robot.placement([0.4, 0.5, 0.6], link).translation, 0, atol=1e-15)


def test_limits_are_the_servos(robot):
    limits = robot.limits
    assert_allclose(limits.q_max - limits.q_min, np.radians(270))
    assert_allclose(limits.tau_max, STALL)
    assert_allclose(limits.v_max, 7.5)
    assert_allclose(robot.damping, 0.01)
    assert_allclose(robot.friction, 0.0)
    for pose in ([0, 0, 0], np.radians([28.1, 67.8, 53.8])):
        assert np.all(limits.q_min < pose)
        assert np.all(pose < limits.q_max)


def test_static_load_leaves_room_for_a_payload(robot):
    stretched = np.zeros(3)
    hold = robot.gravity(stretched)
    payload = robot.jacobian(stretched)[:3].T @ [0.0, 0.0, 0.1 * 9.81]
    assert np.abs(hold).max() < 0.6 * STALL
    assert np.abs(hold + payload).max() < 0.6 * STALL
    rng = np.random.default_rng(2)
    loads = [np.abs(robot.gravity(robot.random_configuration(rng))).max() for _ in range(500)]
    assert max(loads) <= np.abs(hold).max() * 1.01


def test_weight_is_a_hobby_arms(robot):
    moving = sum(inertia.mass for inertia in robot.model.inertias[1:])
    base = float(TREE.find("link[@name='base_link']/inertial/mass").get("value"))
    assert 0.35 < moving < 0.6
    assert 0.7 < moving + base < 1.2


def test_inertias_are_physical_and_off_axis(robot):
    for inertia in robot.model.inertias[1:]:
        moments = np.linalg.eigvalsh(inertia.inertia)
        assert moments[0] > 0.0
        assert moments[0] + moments[1] > moments[2]
        assert np.all(np.abs(inertia.lever) > 1e-4)
        assert np.all(np.abs(inertia.inertia[np.triu_indices(3, 1)]) > 1e-8)


# ---- what is seen and what collides ------------------------------------------------------------


def test_shapes_are_primitives_with_known_materials():
    materials = {material.get("name") for material in TREE.findall("material")}
    assert not list(TREE.iter("mesh"))
    for link in TREE.findall("link")[:-1]:
        assert len(link.findall("visual")) >= 5
        assert 2 <= len(link.findall("collision")) <= 4
    used = {visual.find("material").get("name") for visual in TREE.iter("visual")}
    assert used == materials


def half_size(shape):
    if shape.tag == "box":
        return np.array([float(side) for side in shape.get("size").split()]) / 2
    radius = float(shape.get("radius"))
    return np.array([radius, radius, float(shape.get("length")) / 2])


def corners(element):
    """Return the corners of the box around a shape that lies along the axes, shape (2, 3) [m]."""
    origin = element.find("origin")
    centre = np.array([float(value) for value in origin.get("xyz").split()])
    half = half_size(element.find("geometry")[0])
    roll, pitch, _ = (abs(float(value)) > 1.0 for value in origin.get("rpy").split())
    if roll:
        half = half[[0, 2, 1]]
    if pitch:
        half = half[[2, 1, 0]]
    return np.array([centre - half, centre + half])


@pytest.mark.parametrize("name", ["base_link", "link1", "link2", "link3", *FINGERS])
def test_collision_shapes_cover_what_is_seen(name):
    link = TREE.find(f"link[@name='{name}']")
    solids = [corners(element) for element in link.findall("collision")]
    for visual in link.findall("visual"):
        if visual.get("name").endswith("_rack"):
            continue  # it runs inside link 3's palm
        low, high = corners(visual)
        points = low + (high - low) * np.array(list(product((0, 0.5, 1), repeat=3)))
        covered = [
            np.all((points >= solid[0] - 0.004) & (points <= solid[1] + 0.004), axis=1)
            for solid in solids
        ]
        assert np.any(covered, axis=0).all(), visual.get("name")


def test_the_arm_stands_on_the_table(tools):
    link = TREE.find("link[@name='base_link']")
    lowest = min(corners(visual)[0][2] for visual in link.findall("visual"))
    assert_allclose(lowest, tools("arm_parts").TABLE * 1e-3)


def test_the_tool_is_between_the_pads(tools):
    joints = {joint.find("child").get("link"): joint for joint in TREE.findall("joint")}
    pads = []
    for name in FINGERS:
        origin = [float(x) for x in joints[name].find("origin").get("xyz").split()]
        pads.append(corners(TREE.find(f".//visual[@name='{name}_pad']")) + np.array(origin))
    right, left = pads
    assert_allclose(right[0][2] - left[1][2], 0.066)
    assert_allclose((left + right).mean(axis=0) / 2, [0.150, 0.0, 0.0], atol=1e-12)
