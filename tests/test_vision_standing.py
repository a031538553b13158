"""Standing a thing on the table by the four sides of its outline."""

import numpy as np
import pytest

from arm3dof.config.camera_file import load_camera
from arm3dof.runtime.tasks.simulated import task_camera
from arm3dof.vision.camera import Camera, look_at
from arm3dof.vision.standing import EDGE_SIGMA_PX, Standing, stand

TABLE = -0.11
TURN = np.linspace(0, 2 * np.pi, 720, endpoint=False)


def random_camera(rng):
    bearing, height = rng.uniform(-np.pi, np.pi), rng.uniform(0.2, 0.5)
    away = rng.uniform(0.15, 0.35)
    eye = [0.18 + away * np.cos(bearing), away * np.sin(bearing), TABLE + height]
    return Camera.pinhole(640, 480, 640.0, look_at(eye, [0.18, 0.0, TABLE + 0.02]))


def outline(camera, x, y, width, height):
    rim = np.column_stack([x + width / 2 * np.cos(TURN), y + width / 2 * np.sin(TURN)])
    levels = [np.column_stack([rim, np.full(len(rim), z)]) for z in (TABLE, TABLE + height)]
    pixels = camera.project(np.concatenate(levels))
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def random_thing(rng):
    return (
        0.18 + rng.uniform(-0.06, 0.06),
        *rng.uniform(-0.08, 0.08, 1),
        *rng.uniform(0.02, 0.07, 2),
    )


def test_an_upright_cylinder_is_found_where_it_stands():
    rng = np.random.default_rng(0)
    for _ in range(100):
        camera, truth = random_camera(rng), random_thing(rng)
        thing = stand("red", outline(camera, *truth), camera, TABLE)
        assert thing is not None
        found = (thing.x, thing.y, thing.width_m, thing.height_m)
        # the eye's circle has fewer corners than the truth's
        np.testing.assert_allclose(found, truth, atol=6e-4)


def test_the_stated_covariance_is_honest():
    rng = np.random.default_rng(1)
    squares = []
    for _ in range(150):
        camera, truth = random_camera(rng), random_thing(rng)
        noisy = outline(camera, *truth) + EDGE_SIGMA_PX * rng.standard_normal(4)
        thing = stand("red", noisy, camera, TABLE)
        miss = np.array([thing.x - truth[0], thing.y - truth[1]])
        squares.append(miss @ np.linalg.solve(thing.covariance, miss))
    # of chi-squared with two degrees of freedom; what shapes add is not there
    assert 0.88 < np.mean(np.array(squares) < 4.605) <= 1.0


def test_what_cannot_stand_there_is_not_placed():
    camera = task_camera()
    assert stand("red", [300, 0, 330, 5], Camera.pinhole(640, 480, 640.0), TABLE) is None
    assert stand("red", [10, 200, 600, 230], camera, TABLE) is None
    assert stand("red", [300, 200, 301, 400], camera, TABLE) is None


def test_a_thing_knows_how_far_it_is():
    thing = Standing("red", 0.2, 0.1, 0.03, 0.05, np.diag([4e-6, 1e-6]))
    assert thing.sigma_m == pytest.approx(0.002)
    assert thing.distance_to(0.2, 0.0) == pytest.approx(0.1)


def test_the_preset_front_is_the_camera_of_tasks():
    preset, built = load_camera("front").camera, task_camera()
    np.testing.assert_allclose(preset.transform_base_camera, built.transform_base_camera)
    np.testing.assert_allclose(preset.camera_matrix, built.camera_matrix)
