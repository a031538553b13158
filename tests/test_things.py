"""Objects, bins and fingers on the 3-D page: where a recording says they are."""

from __future__ import annotations

from dataclasses import replace

import msgpack
import numpy as np
import pinocchio as pin
import pytest
from runs import smooth_run

from arm3dof.model.gripper import find_gripper
from arm3dof.model.library import load_robot
from arm3dof.runtime.recording import Recording
from arm3dof.sim.world import Bin, Body, World
from arm3dof.ui.meshcat_scene import recording_scene
from arm3dof.ui.robot_drawing import RobotDrawing
from arm3dof.ui.things import body_poses, draw_world, thing_path

SHAPES = ("cylinder", "cube", "bottle")
BODIES = tuple(
    Body(f"{shape}_0", shape, 0.03, 0.05, 0.02, (0.8, 0.1, 0.1), 0.2, 0.07 * k - 0.07, yaw=0.3)
    for k, shape in enumerate(SHAPES)
)
WORLD = World(bodies=BODIES, bins=(Bin("red", 0.0, -0.2, (0.05, 0.06), (0.5, 0.5, 0.5)),))


@pytest.fixture(scope="module")
def run() -> Recording:
    plain = smooth_run(load_robot())
    rows = len(plain)
    poses = {}
    for body in BODIES:
        poses[body.name] = np.tile([body.x, body.y, -0.085, 0, 0, 0, 1.0], (rows, 1))
        poses[body.name][:, 2] += np.linspace(0, 0.1, rows)
    return replace(plain, gripper=np.linspace(0.05, 0.0, rows), world=WORLD, bodies=poses)


def test_every_object_and_bin_is_drawn_where_it_stands():
    commands = draw_world(WORLD)
    at = {c["path"]: np.array(c["matrix"]).reshape(4, 4).T for c in commands if "matrix" in c}
    drawn = {c["path"] for c in commands if c["type"] == "set_object"}
    for body in BODIES:
        parts = [path for path in drawn if path.startswith(f"/things/{body.name}/")]
        assert len(parts) == (2 if body.shape == "bottle" else 1)
        pose = at[thing_path(body.name)]
        np.testing.assert_allclose(pose[:3, 3], [body.x, body.y, -0.11 + 0.025])
        np.testing.assert_allclose(pose[:3, :3], pin.utils.rotate("z", 0.3), atol=1e-12)
    assert len([path for path in drawn if path.startswith("/bins/red/")]) == 5
    (moved,) = body_poses({"cube_0": np.array([1.0, 2.0, 3.0, 0, 0, 0, 1])})
    assert moved["path"] == "/things/cube_0"
    assert np.array(moved["matrix"]).reshape(4, 4).T[:3, 3].tolist() == [1, 2, 3]


def test_the_replay_moves_objects_and_fingers(run):
    scene = recording_scene(run)
    commands = msgpack.unpackb(scene.window.snapshot())["commands"]
    (replay,) = (each for each in commands if each["type"] == "replay")
    poses = np.frombuffer(replay["poses"].data).reshape(replay["frames"], -1, 7)
    column = {path: poses[:, k] for k, path in enumerate(replay["paths"])}
    for body in BODIES:
        height = column[thing_path(body.name)][:, 2]
        assert height[0] == pytest.approx(-0.085)
        assert height[-1] == pytest.approx(0.015, abs=2e-3)
    gap = np.linalg.norm(
        column["/robot/right_finger"][:, :3] - column["/robot/left_finger"][:, :3], axis=1
    )
    assert gap[0] == pytest.approx(0.05, abs=1e-9)
    assert gap[-1] == pytest.approx(0.0, abs=1e-3)


def test_the_hand_moves_its_fingers_alone(run):
    robot = run.load_robot()
    drawing, gripper = RobotDrawing(robot), find_gripper(robot)
    q = np.array([0.2, 0.4, -0.5])
    as_held = drawing.placements(q)
    np.testing.assert_allclose(drawing.placements(q, gripper.opening), as_held, atol=1e-12)
    half = dict(zip(drawing.link_names, drawing.placements(q, 0.02), strict=True))
    for name, pose in zip(drawing.link_names, as_held, strict=True):
        moves = name in (gripper.driven.link, gripper.follower.link)
        shift = np.linalg.norm(half[name][:3, 3] - pose[:3, 3])
        assert shift == pytest.approx((gripper.opening - 0.02) / 2 if moves else 0.0, abs=1e-9)
