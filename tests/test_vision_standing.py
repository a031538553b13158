"""Standing a thing on the table by its outline."""

from dataclasses import replace

import numpy as np
import pytest
from test_vision_silhouette import outline

from arm3dof.config.camera_file import load_camera
from arm3dof.runtime.tasks.simulated import task_camera
from arm3dof.vision.camera import Camera, Doubt, look_at
from arm3dof.vision.standing import SHAPE_SIGMA_M, Standing, stand
from arm3dof.vision.upright import KINDS, across, upright

TABLE = -0.11


def random_camera(rng):
    bearing, height = rng.uniform(-np.pi, np.pi), rng.uniform(0.2, 0.5)
    away = rng.uniform(0.15, 0.35)
    eye = [0.18 + away * np.cos(bearing), away * np.sin(bearing), TABLE + height]
    return Camera.pinhole(640, 480, 640.0, look_at(eye, [0.18, 0.0, TABLE + 0.02]))


def random_state(rng, kind):
    turn = [rng.uniform(0, np.pi)] if kind == "box" else []
    x, y = 0.18 + rng.uniform(-0.06, 0.06), rng.uniform(-0.08, 0.08)
    return np.array([x, y, rng.uniform(0.02, 0.05), rng.uniform(0.03, 0.07), *turn])


def pixels(kind, camera, state, rng, noise_px=0.1):
    seen = outline(upright(kind, camera, TABLE), state, rng, noise_px)
    return seen * camera.focal_px + camera.camera_matrix[:2, 2]


@pytest.mark.parametrize("kind", KINDS)
def test_an_upright_thing_is_found_where_it_stands(kind):
    rng = np.random.default_rng(0)
    for _ in range(20):
        camera, state = random_camera(rng), random_state(rng, kind)
        thing = stand("red", pixels(kind, camera, state, rng), camera, TABLE)
        assert not thing.hidden
        np.testing.assert_allclose((thing.x, thing.y), state[:2], atol=2e-4)
        assert thing.width_m == pytest.approx(across(kind, state), abs=2e-4)
        # a neck that is not seen beyond the belly is not told
        heights = (state[3], 0.7 * state[3]) if kind == "bottle" else (state[3],)
        assert min(abs(thing.height_m - it) for it in heights) < 5e-4


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_of_the_solids_are_those_of_their_points(kind):
    rng = np.random.default_rng(1)
    solid, state = upright(kind, random_camera(rng), TABLE), random_state(rng, kind)
    for k, step in enumerate(1e-6 * np.eye(len(state))):
        for (low, _), (high, _), (_, slopes) in zip(
            solid(state - step), solid(state + step), solid(state), strict=True
        ):
            np.testing.assert_allclose((high - low) / 2e-6, slopes[:, :, k], atol=1e-8)


def test_a_cameras_doubt_is_in_the_covariance():
    rng = np.random.default_rng(2)
    doubt = Doubt(focal_px=4.0, centre_px=2.0, position_m=0.002, rotation_rad=0.004)
    shape, squares = SHAPE_SIGMA_M**2 * np.eye(2), []
    for _ in range(60):
        camera = random_camera(rng)
        state = random_state(rng, "cylinder")
        seen = pixels("cylinder", camera, state, rng)
        matrix, pose = camera.camera_matrix.copy(), camera.transform_base_camera.copy()
        matrix[0, 0] = matrix[1, 1] = matrix[0, 0] + doubt.focal_px * rng.standard_normal()
        matrix[:2, 2] += doubt.centre_px * rng.standard_normal(2)
        turn = doubt.rotation_rad * rng.standard_normal(3)
        small = np.array([[0, -turn[2], turn[1]], [turn[2], 0, -turn[0]], [-turn[1], turn[0], 0]])
        u, _, v = np.linalg.svd(np.eye(3) + small)
        pose[:3, :3] = pose[:3, :3] @ u @ v
        pose[:3, 3] += doubt.position_m * rng.standard_normal(3)
        wrong = replace(camera, camera_matrix=matrix, transform_base_camera=pose, doubt=doubt)
        thing = stand("red", seen, wrong, TABLE)
        miss = np.array([thing.x, thing.y]) - state[:2]
        squares.append(miss @ np.linalg.solve(thing.covariance - shape, miss))
    # of chi-squared with two degrees of freedom
    assert 0.8 < np.mean(np.array(squares) < 4.605) <= 1.0
    assert 0.3 < np.mean(np.array(squares) < 1.386) < 0.7


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("axis", [0, 1])
def test_half_a_thing_is_told_from_a_whole_one(kind, axis):
    rng, camera = np.random.default_rng(3), task_camera()
    for _ in range(8):
        state = random_state(rng, kind)
        seen = np.concatenate([pixels(kind, camera, state, rng) for _ in range(4)])
        middle = (seen[:, axis].min() + seen[:, axis].max()) / 2
        rest = seen[seen[:, axis] < middle]
        ends = rest[rest[:, axis] > middle - 3, 1 - axis]
        edge = np.full((60, 2), middle)
        edge[:, 1 - axis] = np.linspace(ends.min(), ends.max(), len(edge))
        assert stand("red", np.concatenate([rest, edge]), camera, TABLE).hidden


def test_what_cannot_stand_there_is_not_placed():
    level = Camera.pinhole(640, 480, 640.0)
    frame = [[300, 0], [330, 0], [300, 5], [330, 5]]
    assert stand("red", frame, level, TABLE) is None


def test_a_thing_knows_how_far_it_is():
    thing = Standing("red", 0.2, 0.1, 0.03, 0.05, np.diag([4e-6, 1e-6]))
    assert thing.sigma_m == pytest.approx(0.002)
    assert thing.distance_to(0.2, 0.0) == pytest.approx(0.1)


def test_the_preset_front_is_the_camera_of_tasks():
    preset, built = load_camera("front").camera, task_camera()
    np.testing.assert_allclose(preset.transform_base_camera, built.transform_base_camera)
    np.testing.assert_allclose(preset.camera_matrix, built.camera_matrix)
