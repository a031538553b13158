"""What is drawn: every link at its pose, every shape of the URDF, target, path and stage."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import msgpack
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from runs import TARGET, smooth_run

from arm3dof.errors import InputError
from arm3dof.model.build import robot_from_description
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Description, Robot
from arm3dof.ui import shapes
from arm3dof.ui.meshcat_scene import Scene, recording_scene
from arm3dof.ui.replay import MAX_FRAMES
from arm3dof.ui.robot_drawing import RobotDrawing
from arm3dof.ui.stage import grid_step, view_command
from arm3dof.ui.tube import SIDES, tube
from arm3dof.ui.visuals import DEFAULT_COLOR, read_visuals


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


def commands(scene: Scene) -> list[dict[str, object]]:
    return msgpack.unpackb(scene.window.snapshot())["commands"]


def one(scene: Scene, kind: str) -> dict[str, object]:
    (found,) = (each for each in commands(scene) if each["type"] == kind)
    return found


def transforms(scene: Scene) -> dict[str, np.ndarray]:
    return {
        each["path"]: np.array(each["matrix"]).reshape(4, 4).T
        for each in commands(scene)
        if each["type"] == "set_transform"
    }


def objects(scene: Scene) -> dict[str, dict[str, object]]:
    return {each["path"]: each["object"] for each in commands(scene) if "object" in each}


def numbers(packed: msgpack.ExtType) -> np.ndarray:
    kinds = {0x16: np.uint32, 0x17: np.float32, 0x18: np.float64}
    return np.frombuffer(packed.data, kinds[packed.code])


# ---- poses -------------------------------------------------------------------------------------


def test_every_link_has_a_node_at_its_pose(robot: Robot) -> None:
    scene = Scene(robot)
    rng = np.random.default_rng(1)
    links = ("base_link", "link1", "link2", "link3", "right_finger", "left_finger", "tool")
    assert scene.drawing.link_names == links
    for _ in range(50):
        q = robot.random_configuration(rng)
        scene.display(q)
        shown = transforms(scene)
        for link in scene.drawing.link_names:
            expected = robot.placement(q, link).homogeneous
            np.testing.assert_allclose(shown[f"/robot/{link}"], expected, atol=1e-15)


def test_shapes_stand_where_pinocchio_puts_them(robot: Robot) -> None:
    model = pin.buildModelFromXML(robot.description.urdf)
    folder = Path(__file__).parents[1] / "urdf" / "arm3dof.urdf"
    geometry = pin.buildGeomFromUrdf(model, str(folder), pin.GeometryType.VISUAL)
    visuals, missing = read_visuals(robot.description)
    assert missing == ()
    assert len(visuals) == geometry.ngeoms > 20
    found = {link: [] for link in Scene(robot).drawing.link_names}
    for visual in visuals:
        found[visual.link].append(visual)
    for item in geometry.geometryObjects:
        frame = model.frames[item.parentFrame]
        local = (frame.placement.inverse() * item.placement).homogeneous
        visual = found[frame.name].pop(0)
        np.testing.assert_allclose(visual.placement, local, atol=1e-12)
        np.testing.assert_allclose(visual.color, item.meshColor, atol=1e-6)
        item.geometry.computeLocalAABB()
        points = (visual.outline - local[:3, 3]) @ local[:3, :3]
        np.testing.assert_allclose(points.min(axis=0), item.geometry.aabb_local.min_, atol=1e-9)
        np.testing.assert_allclose(points.max(axis=0), item.geometry.aabb_local.max_, atol=1e-9)


def test_display_takes_nothing_but_a_configuration(robot: Robot) -> None:
    with pytest.raises(InputError, match="q has shape"):
        Scene(robot).display([0.0, 0.0])


def test_locked_joints_are_drawn_where_they_are_locked() -> None:
    text = load_robot().description.urdf
    locks = {"joint2": 1.0, "gripper": 0.01, "left_finger_joint": 0.01}
    locked = robot_from_description(Description("bent", text, (), locks), "tool")
    free = load_robot()
    scene = Scene(locked)
    scene.display([0.3, -0.4])
    grip = load_robot(locked_joints={"gripper": 0.01})
    finger = grip.placement([0.3, 1.0, -0.4], "right_finger").homogeneous
    np.testing.assert_allclose(transforms(scene)["/robot/right_finger"], finger, atol=1e-12)
    for link in ("link2", "link3", "tool"):
        expected = free.placement([0.3, 1.0, -0.4], link).homogeneous
        np.testing.assert_allclose(transforms(scene)[f"/robot/{link}"], expected, atol=1e-12)
    assert any(path.startswith("/robot/link3/") for path in objects(scene))


# ---- shapes and meshes -------------------------------------------------------------------------

LINKS = """<robot name="odd">
  <material name="red"><color rgba="1 0 0 0.5"/></material>
  <link name="base">{base}</link>
  <link name="arm">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    {arm}
  </link>
  <link name="tip"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>
    <limit lower="{low}" upper="2" effort="5" velocity="5"/></joint>
  <joint name="end" type="fixed"><parent link="arm"/><child link="tip"/>
    <origin xyz="0.4 0 0"/></joint>
</robot>"""


def odd(base: str = "", arm: str = "", *folders: Path, low: float = -2.0) -> Robot:
    urdf = LINKS.format(base=base, arm=arm, low=low)
    return robot_from_description(Description("odd", urdf, folders), "tip")


def visual(geometry: str, extra: str = "") -> str:
    return f"<visual>{extra}<geometry>{geometry}</geometry></visual>"


def look(scene: Scene, path: str) -> dict[str, object]:
    return objects(scene)[path]["materials"][0]


def test_primitives_keep_their_sizes_and_colours() -> None:
    green = '<material name="green"><color rgba="0 1 0 1"/></material>'
    arm = (
        visual('<box size="1 2 3"/>', '<material name="red"/>')
        + visual('<cylinder radius="0.5" length="2"/>')
        + visual('<sphere radius="0.7"/>', green)
    )
    scene = Scene(odd("", arm))
    drawn = {path: each["geometries"][0] for path, each in objects(scene).items() if "arm" in path}
    box, cylinder, ball = (drawn[f"/robot/arm/{k}"] for k in range(3))
    assert (box["width"], box["height"], box["depth"]) == (1, 2, 3)
    assert (cylinder["radiusTop"], cylinder["radiusBottom"], cylinder["height"]) == (0.5, 0.5, 2)
    assert ball["radius"] == 0.7
    upright = np.array(objects(scene)["/robot/arm/1"]["object"]["matrix"]).reshape(4, 4).T
    np.testing.assert_array_equal(upright[:3, :3] @ [0, 1, 0], [0, 0, 1])
    assert look(scene, "/robot/arm/0")["color"] == 0xFF0000
    assert look(scene, "/robot/arm/0")["opacity"] == 0.5
    assert look(scene, "/robot/arm/1")["color"] == shapes.hex_color(DEFAULT_COLOR)
    assert look(scene, "/robot/arm/2")["color"] == 0x00FF00


@pytest.mark.parametrize("suffix", ["stl", "obj", "dae"])
@pytest.mark.parametrize("name", ["package://parts/ball.{}", "parts/ball.{}", "file://{}"])
def test_mesh_files_are_found_and_drawn(tmp_path: Path, suffix: str, name: str) -> None:
    file = tmp_path / "parts" / f"ball.{suffix}"
    file.parent.mkdir()
    trimesh.creation.icosphere(subdivisions=2, radius=0.1).export(file)
    where = name.format(file if name.startswith("file") else suffix)
    mesh = visual(f'<mesh filename="{where}" scale="2 2 2"/>')
    scene = Scene(odd("", mesh, tmp_path))
    assert scene.drawing.stand_ins == ()
    (geometry,) = objects(scene)["/robot/arm/0"]["geometries"]
    attributes = geometry["data"]["attributes"]
    points = numbers(attributes["position"]["array"]).reshape(-1, 3)
    normals = numbers(attributes["normal"]["array"]).reshape(-1, 3)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 0.2, rtol=1e-3)
    np.testing.assert_allclose(normals, points / 0.2, atol=0.1)
    assert numbers(geometry["data"]["index"]["array"]).size == 3 * 320


@pytest.mark.parametrize(
    "content", [None, b"", b"solid nothing", b"\x00" * 40, b"<COLLADA/>"], ids=repr
)
def test_a_missing_or_broken_mesh_is_stood_in_for(tmp_path: Path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / "arm.stl").write_bytes(content)
    scene = Scene(
        odd(visual('<box size="1 1 1"/>'), visual('<mesh filename="arm.stl"/>'), tmp_path)
    )
    assert scene.drawing.stand_ins == ("arm",)
    drawn = [path for path in objects(scene) if path.startswith("/robot/")]
    assert drawn == ["/robot/base/0", "/robot/arm/0", "/robot/arm/1"]  # box; ball and bar
    bar = transforms(scene)["/robot/arm/1"]
    np.testing.assert_allclose(bar[:3, 3], [0.2, 0, 0], atol=1e-12)
    np.testing.assert_allclose(bar[:3, :3] @ [0, 0, 1], [1, 0, 0], atol=1e-12)


def test_a_robot_without_any_shape_is_a_stick_figure() -> None:
    scene = Scene(odd())
    drawn = [path for path in objects(scene) if path.startswith("/robot/")]
    assert drawn == ["/robot/base/0", "/robot/base/1", "/robot/arm/0", "/robot/arm/1"]
    assert scene.drawing.stand_ins == ()


def test_the_first_pose_is_inside_the_limits() -> None:
    robot = odd(low=0.75)
    np.testing.assert_allclose(
        transforms(Scene(robot))["/robot/arm"], robot.placement([0.75], "arm").homogeneous
    )


@pytest.mark.parametrize("name", ["so101", pytest.param("ur5", marks=pytest.mark.slow)])
def test_library_robots_are_drawn_from_light_meshes(name: str) -> None:
    robot = load_robot(name)
    scene = Scene(robot)
    assert scene.drawing.stand_ins == ()
    assert len(scene.window.snapshot()) < 6_000_000
    rng = np.random.default_rng(2)
    q = robot.random_configuration(rng)
    scene.display(q)
    for link in scene.drawing.link_names:
        expected = robot.placement(q, link).homogeneous
        np.testing.assert_allclose(transforms(scene)[f"/robot/{link}"], expected, atol=1e-12)


# ---- ghost, target, path -----------------------------------------------------------------------


def test_a_ghost_comes_moves_and_goes(robot: Robot) -> None:
    scene = Scene(robot)
    plain = scene.window.snapshot()
    for q in (TARGET, -TARGET):
        scene.show_ghost(q)
        expected = robot.placement(q, "link3").homogeneous
        np.testing.assert_allclose(transforms(scene)["/ghost/link3"], expected, atol=1e-15)
    assert look(scene, "/ghost/link3/0")["opacity"] < 0.5
    scene.hide_ghost()
    assert scene.window.snapshot() == plain
    with pytest.raises(InputError, match="q has shape"):
        scene.show_ghost([1.0])


def test_a_target_is_marked_where_it_is(robot: Robot) -> None:
    scene = Scene(robot)
    for point in ([0.1, 0.15, 0.1], [0.2, 0.0, scene.drawing.floor()]):
        scene.show_target(point)
        np.testing.assert_array_equal(transforms(scene)["/target"][:3, 3], point)
        foot = transforms(scene)["/target/foot"][2, 3] + point[2]
        assert foot == pytest.approx(scene.drawing.floor(), abs=2e-3)
        has_stalk = "/target/stalk" in objects(scene)
        assert has_stalk is (point[2] > 0)
    with pytest.raises(InputError, match="point has shape"):
        scene.show_target([0.1, 0.2])


def test_a_path_is_a_tube_around_its_points(robot: Robot) -> None:
    scene = Scene(robot)
    turn = np.linspace(0, 3, 100)
    path = np.column_stack([np.cos(turn), np.sin(turn), 0.2 * turn])
    scene.show_path(path)
    assert objects(scene)["/path"]["geometries"][0]["type"] == "BufferGeometry"
    scene.show_path(path[:1])
    assert "/path" not in objects(scene)
    with pytest.raises(InputError, match="points has shape"):
        scene.show_path(path[:, :2])


@pytest.mark.parametrize("seed", range(20))
def test_tubes_have_their_radius_everywhere(seed: int) -> None:
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(size=(60, 3)) * 0.02 + 0.05, axis=0)
    path = np.repeat(path, rng.integers(1, 3, size=60), axis=0)  # it stands still here and there
    shape = tube(path, 0.003, (1, 0, 0), (0, 0, 1))
    data = shape.data["data"]
    points = numbers(data["attributes"]["position"]["array"]).reshape(-1, SIDES, 3)
    normals = numbers(data["attributes"]["normal"]["array"]).reshape(-1, SIDES, 3)
    colors = numbers(data["attributes"]["color"]["array"]).reshape(-1, SIDES, 3)
    centers = points.mean(axis=1)
    np.testing.assert_allclose(
        centers, path[np.any(np.diff(path, axis=0, prepend=9), axis=1)], atol=1e-6
    )
    np.testing.assert_allclose(np.linalg.norm(points - centers[:, None], axis=2), 0.003, rtol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=2), 1, rtol=1e-5)
    np.testing.assert_array_equal(colors[0, 0], [1, 0, 0])
    np.testing.assert_array_equal(colors[-1, -1], [0, 0, 1])
    faces = numbers(data["index"]["array"])
    assert faces.max() == points.size // 3 - 1


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.zeros((1, 3)), np.ones((9, 3))])
def test_a_path_without_length_is_no_tube(points: np.ndarray) -> None:
    assert tube(points, 0.01, (0, 0, 0), (1, 1, 1)) is None


def test_a_tube_survives_a_path_that_turns_back() -> None:
    path = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0], [-1, 0, 0]])
    shape = tube(path, 0.01, (0, 0, 0), (1, 1, 1))
    assert np.isfinite(numbers(shape.data["data"]["attributes"]["position"]["array"])).all()


# ---- stage -------------------------------------------------------------------------------------


@pytest.mark.parametrize("radius", [0.003, 0.02, 0.17, 1.0, 4.2, 130.0])
def test_grid_steps_are_round_and_fit(radius: float) -> None:
    step = grid_step(radius)
    assert radius / 10 < step <= radius / 4 * (1 + 1e-12)
    assert re.fullmatch(r"[125](\.0+)?e[+-]\d+", f"{step:.6e}")


def test_views_look_at_the_middle_from_afar() -> None:
    center = np.array([0.1, 0.2, 0.3])
    views = view_command(center, 0.4)["views"]
    assert [view["name"] for view in views] == ["Corner", "Front", "Side", "Top"]
    for view in views:
        assert view["target"] == center.tolist()
        away = np.array(view["eye"]) - center
        assert np.linalg.norm(away) * np.sin(np.deg2rad(16)) > 0.4  # the whole sphere is seen
        assert view["eye"][2] > center[2] or view["name"] != "Corner"


def test_the_floor_is_under_the_robot(robot: Robot) -> None:
    floor = RobotDrawing(robot).floor()
    assert floor == pytest.approx(-0.110, abs=1e-9)
    lowest = RobotDrawing(robot).outline(np.zeros((1, 3)))[:, 2].min()
    assert lowest == pytest.approx(floor)
    assert RobotDrawing(odd("", visual('<box size="1 1 9"/>'))).floor() == 0


# ---- recordings --------------------------------------------------------------------------------


def test_a_recording_is_played_as_it_was(robot: Robot) -> None:
    run = smooth_run(robot)
    scene = recording_scene(run)
    replay = one(scene, "replay")
    frames, links = replay["frames"], scene.drawing.link_names
    assert replay["fps"] == 60
    assert frames == 180  # 0 to 2.998 s
    assert replay["paths"] == [f"/robot/{link}" for link in links]
    poses = numbers(replay["poses"]).reshape(frames, len(links), 7)
    for frame in range(0, frames, 7):
        q = [np.interp(frame / 60, run.t, column) for column in run.q.T]
        for link, pose in zip(links, poses[frame], strict=True):
            expected = robot.placement(q, link).homogeneous
            np.testing.assert_allclose(pin.XYZQUATToSE3(pose).homogeneous, expected, atol=1e-14)
        shown = numbers(replay["position"]).reshape(frames, 3)[frame]
        np.testing.assert_allclose(shown, np.rad2deg(q), atol=1e-12)
    torque = numbers(replay["torque"]).reshape(frames, 3)
    np.testing.assert_allclose(torque[0], run.tau[0])
    assert [joint["limit"] for joint in replay["joints"]] == [1.96] * 3
    assert {joint["unit"] for joint in replay["joints"]} == {"°"}
    np.testing.assert_allclose(
        transforms(scene)["/target"][:3, 3], robot.placement(TARGET).translation
    )


def test_a_long_recording_is_played_at_a_lower_rate(robot: Robot) -> None:
    run = smooth_run(robot, duration=300, dt=0.05)
    replay = one(recording_scene(run), "replay")
    assert replay["frames"] == MAX_FRAMES
    assert replay["fps"] == pytest.approx((MAX_FRAMES - 1) / run.t[-1])


def test_one_row_is_a_picture(robot: Robot) -> None:
    run = smooth_run(robot, duration=0.002)
    assert one(recording_scene(run), "replay")["frames"] == 1


def test_the_verdict_says_how_it_ended(robot: Robot) -> None:
    caption = one(recording_scene(smooth_run(robot)), "caption")
    assert caption["title"] == "arm3dof"
    assert re.fullmatch(r"Settled in \d\.\d\d s", caption["verdict"])
    assert caption["good"]
    facts = dict(caption["facts"])
    assert facts["Target"] == "28.1, 67.8, 53.8 °"
    assert facts["Peak torque"].endswith(" of 1.96 N m")
    slow = one(recording_scene(smooth_run(robot, stiffness=1.0)), "caption")
    assert slow["verdict"] == "Not settled after 3.0 s"
    assert not slow["good"]
    run = smooth_run(robot)
    weak = replace(run, limits=replace(run.limits, tau_max=np.full(3, 0.1)))
    broken = one(recording_scene(weak), "caption")
    assert re.fullmatch(r"Torque limit broken in \d+ steps", broken["verdict"])
    assert not broken["good"]


def test_display_ends_a_replay(robot: Robot) -> None:
    scene = recording_scene(smooth_run(robot))
    scene.display(TARGET)
    assert one(scene, "replay")["frames"] == 0
    scene.display(TARGET)
    assert one(scene, "replay")["frames"] == 0


def test_sliding_joints_are_shown_in_millimetres() -> None:
    text = load_robot().description.urdf.replace(
        '<joint name="joint3" type="revolute">', '<joint name="joint3" type="prismatic">'
    )
    locks = {"gripper": 0.0, "left_finger_joint": 0.0}
    robot = robot_from_description(Description("slide", text, (), locks), "tool")
    replay = one(recording_scene(smooth_run(robot, target=[0.1, 0.2, 0.03])), "replay")
    assert [joint["unit"] for joint in replay["joints"]] == ["°", "°", "mm"]
    assert replay["joints"][2]["effort"] == "N"
    assert numbers(replay["position"])[-1] == pytest.approx(30, abs=0.1)
