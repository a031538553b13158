"""Pictures without a browser: closed shapes, true perspective, true occlusion, true figures."""

from __future__ import annotations

import itertools
from pathlib import Path

import cv2
import numpy as np
import pytest
from runs import carried_run, smooth_run

from arm3dof.model.library import load_robot
from arm3dof.runtime.recording import Recording
from arm3dof.ui import shapes
from arm3dof.ui.facets import Facets, Piece, facets
from arm3dof.ui.painter import Canvas, Perspective
from arm3dof.ui.robot_drawing import RobotDrawing
from arm3dof.ui.run_frames import RunPainter, frame_count, run_frames, save_stills

RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
WIDTH, HEIGHT = 320, 240


def at(*position: float) -> np.ndarray:
    place = np.eye(4)
    place[:3, 3] = position
    return place


def one(shape: shapes.Shape, color: tuple[float, float, float], place: np.ndarray) -> Facets:
    return facets([Piece(0, shape, place, color)])


def view(eye: tuple[float, float, float] = (2.0, -1.0, 1.0)) -> Perspective:
    return Perspective.look_at(np.array(eye), np.zeros(3), 300.0, (WIDTH / 2, HEIGHT / 2))


def canvas(seen: Perspective) -> Canvas:
    return Canvas(np.full((HEIGHT, WIDTH, 3), 255, np.uint8), seen)


def painted(seen: Perspective, *parts: Facets) -> np.ndarray:
    made = canvas(seen)
    for part in parts:
        made.paint(part, part.placed(np.eye(4)[None]))
    return made.picture


def volume(shape: Facets) -> float:
    """Volume inside closed faces that look outwards, by the divergence theorem."""
    total = 0.0
    for corners, count in zip(shape.corners, shape.count, strict=True):
        a, *rest = shape.points[corners[:count]]
        total += sum(a @ np.cross(b, c) / 6 for b, c in itertools.pairwise(rest))
    return total


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (shapes.box((0.2, 0.3, 0.4)), 0.024),
        (shapes.cylinder(0.2, 0.5), np.pi * 0.02),
        (shapes.cylinder(0.2, 0.5, 0.1), np.pi * 0.5 * (0.04 + 0.02 + 0.01) / 3),
        (shapes.sphere(0.3), 4 / 3 * np.pi * 0.027),
    ],
)
def test_shapes_are_closed_and_look_outwards(shape: shapes.Shape, expected: float) -> None:
    assert volume(one(shape, RED, at(3.0, -2.0, 1.0))) == pytest.approx(expected, rel=0.05)


def test_meshes_are_kept_when_small_and_made_coarser_when_fine() -> None:
    ball = one(shapes.sphere(0.3), RED, np.eye(4))
    corners = np.concatenate([ball.corners[:, :3], ball.corners[:, [0, 2, 3]]])
    same = one(shapes.triangles(ball.points, corners), RED, np.eye(4))
    assert volume(same) == pytest.approx(volume(ball), rel=1e-6)
    tilt, turn = np.meshgrid(np.linspace(0, np.pi, 50), np.linspace(0, 2 * np.pi, 90))
    rings = (np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt))
    grid = np.arange(tilt.size).reshape(tilt.shape)
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    quads = np.stack([a, b, c, a, c, d], axis=-1)
    fine = shapes.triangles(np.stack(rings, axis=-1).reshape(-1, 3), quads.reshape(-1, 3))
    coarse = one(fine, RED, np.eye(4))
    assert 300 < len(coarse.corners) <= 900
    assert volume(coarse) == pytest.approx(4 / 3 * np.pi, rel=0.2)


def test_a_ball_is_painted_where_it_is() -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        seen = view(tuple(rng.normal(size=3) * 0.5 + (2, -1, 1)))
        center = rng.uniform(-0.25, 0.25, 3)
        picture = painted(seen, one(shapes.sphere(0.05), RED, at(*center)))
        rows, columns = np.nonzero(picture[..., 1] < 128)
        middle = [(columns.min() + columns.max()) / 2, (rows.min() + rows.max()) / 2]
        np.testing.assert_allclose(middle, seen.project(center[None])[0], atol=1.5)


def test_what_is_nearer_hides_what_is_behind_in_any_order() -> None:
    seen = view()
    near = one(shapes.box((0.1, 0.1, 0.1)), RED, at(0.8, -0.4, 0.4))
    far = one(shapes.box((0.3, 0.3, 0.3)), BLUE, np.eye(4))
    pictures = [painted(seen, near, far), painted(seen, far, near)]
    np.testing.assert_array_equal(*pictures)
    middle = pictures[0][HEIGHT // 2, WIDTH // 2]
    assert middle[2] > 100  # red
    assert middle[0] == 0


def test_boxes_that_cross_share_the_picture_where_they_meet() -> None:
    """Two long boxes through each other: sorting by distance alone would hide one."""
    seen = view((0.0, -3.0, 0.0))
    along = one(shapes.box((1.0, 0.1, 0.1)), RED, np.eye(4))
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]]
    across = one(shapes.box((1.0, 0.1, 0.1)), BLUE, turn)
    row = painted(seen, along, across)[HEIGHT // 2].astype(int)
    left, right = (row[WIDTH // 2 + side * 25] for side in (-1, 1))
    assert left[0] > 50 > left[2]  # blue is nearer on the left
    assert right[2] > 50 > right[0]


def test_lines_and_shadows() -> None:
    seen = view()
    made = canvas(seen)
    ball = one(shapes.sphere(0.1), GREEN, at(0, 0, 0.3))
    made.cast_shadow(ball, ball.placed(np.eye(4)[None]), 0.0)
    dark = made.picture[..., 0] < 200
    assert 100 < dark.sum() < 3000
    made.line(np.array([[-0.2, 0, 0], [0.2, 0, 0]]), BLUE, 3.0)
    u, v = np.rint(seen.project(np.zeros((1, 3)))[0]).astype(int)
    assert tuple(made.picture[v, u]) == (255, 0, 0)


# ---- runs ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run() -> Recording:
    return smooth_run(load_robot(), duration=1.0)


def test_the_arm_in_the_picture_is_where_pinocchio_says(run: Recording) -> None:
    painter = RunPainter(run, (640, 360))
    robot = run.load_robot()
    drawing = RobotDrawing(robot)
    empty = painter._empty
    for t in (0.0, 0.2, 0.8):
        q = np.array([np.interp(t, run.t, column) for column in run.q.T])
        canvas = Canvas(empty, painter._view)
        shape = facets(drawing.pieces())
        canvas.paint(shape, shape.placed(drawing.placements(q)))
        arm = (canvas.picture != empty).any(axis=2)
        for link in ("link2", "link3"):
            center = robot.placement(q, link).act(np.zeros(3))
            u, v = np.rint(painter._view.project(center[None])[0]).astype(int)
            assert arm[v - 2 : v + 3, u - 2 : u + 3].all(), (t, link)


def test_frames_tell_time_and_torque(run: Recording) -> None:
    frames = list(run_frames(run, 10.0, (640, 360)))
    assert len(frames) == frame_count(run, 10.0) == 20
    assert all(frame.shape == (360, 640, 3) for frame in frames)
    assert all(np.array_equal(frame, frames[-1]) for frame in frames[11:])
    blue = [(frame[341, :, 0] > 150) & (frame[341, :, 2] < 30) for frame in frames[:10]]
    ends = [np.flatnonzero(row).max() for row in blue]  # of the time line
    assert all(np.diff(ends) > 0)
    share = np.diff(ends) / (640 - 95 - 17)
    np.testing.assert_allclose(share, 0.1, atol=0.02)


def test_the_first_and_last_pose_are_written(run: Recording, tmp_path: Path) -> None:
    start, end = save_stills(run, tmp_path / "poses")
    pictures = [cv2.imread(str(path)) for path in (start, end)]
    assert [picture.shape for picture in pictures] == [(720, 1280, 3)] * 2
    assert (pictures[0] != pictures[1]).any(axis=2).mean() > 0.02


def test_objects_are_drawn_where_they_are() -> None:
    run = carried_run(load_robot())
    painter = RunPainter(run, (640, 360))
    rows = []
    for t in (0.0, 0.99):
        picture = painter.at(t).astype(int)
        green = (picture[..., 1] > 1.6 * picture[..., 2]) & (picture[..., 1] > 60)
        green[:, :210] = False  # the bin, which rests
        rows.append(np.nonzero(green)[0].mean())
    assert rows[0] - rows[1] > 20  # it rises
