import math

import numpy as np
import pytest

from arm3dof.errors import InputError
from arm3dof.vision.camera import Camera, intrinsics, look_at, rigid


def random_camera(rng, distortion=()):
    fx, fy = rng.uniform(300, 900, 2)
    matrix = intrinsics(fx, fy, rng.uniform(300, 340), rng.uniform(220, 260))
    pose = look_at(rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3))
    return Camera(640, 480, matrix, np.array(distortion), pose)


@pytest.mark.parametrize(
    "distortion",
    [(), (0.0,) * 5, (-0.28, 0.09, 1e-3, -5e-4), (-0.28, 0.09, 1e-3, -5e-4, -0.01)],
)
def test_deprojection_undoes_projection(distortion):
    rng = np.random.default_rng(0)
    for _ in range(50):
        camera = random_camera(rng, distortion)
        pixels = rng.uniform([0, 0], [640, 480], (40, 2))
        depth = rng.uniform(0.1, 2.0, 40)
        points = camera.deproject(pixels, depth)
        np.testing.assert_allclose(camera.project(points), pixels, atol=1e-6)
        np.testing.assert_allclose(camera.to_camera(points)[:, 2], depth, rtol=1e-9)


def test_projection_is_the_pinhole_formula():
    rng = np.random.default_rng(1)
    for _ in range(50):
        camera = random_camera(rng)
        p_camera = rng.uniform([-0.3, -0.3, 0.2], [0.3, 0.3, 2], (20, 3))
        (fx, fy), matrix = camera.focal_px, camera.camera_matrix
        expected = p_camera[:, :2] / p_camera[:, 2:] * [fx, fy] + matrix[:2, 2]
        np.testing.assert_allclose(camera.project(camera.to_base(p_camera)), expected, atol=1e-8)


def test_skewed_pixels_are_honoured_both_ways():
    matrix = intrinsics(500, 510, 320, 240)
    matrix[0, 1] = 3.0
    camera = Camera(640, 480, matrix, np.zeros(0), np.eye(4))
    pixels = np.array([[10.0, 400.0], [320.0, 240.0]])
    depth = np.array([0.3, 0.4])
    seen = camera.deproject(pixels, depth) @ matrix.T
    np.testing.assert_allclose(seen[:, :2] / seen[:, 2:], pixels, atol=1e-9)


def test_one_point_and_no_point():
    camera = Camera.pinhole(640, 480, 500)
    assert camera.project([0, 0, 1]).tolist() == [319.5, 239.5]
    assert camera.deproject([319.5, 239.5], 0.5).tolist() == [0, 0, 0.5]
    assert camera.project(np.zeros((0, 3))).shape == (0, 2)
    assert camera.rays(np.zeros((0, 2))).shape == (0, 3)


def test_what_is_behind_the_lens_has_no_pixel():
    camera = Camera.pinhole(640, 480, 500)
    pixels = camera.project([[0, 0, -1], [0, 0, 0], [0, 0, 1], [np.nan, 0, 1]])
    assert np.isnan(pixels[[0, 1, 3]]).all()
    assert np.isfinite(pixels[2]).all()
    assert np.isnan(camera.project([[0.0, 0.0, -1.0]])).all()


def test_base_and_camera_frames_are_inverse():
    rng = np.random.default_rng(2)
    camera = random_camera(rng)
    points = rng.normal(size=(7, 5, 3))
    np.testing.assert_allclose(camera.to_base(camera.to_camera(points)), points, atol=1e-12)
    np.testing.assert_allclose(camera.to_base(np.zeros(3)), camera.position)


def test_looking_at_a_point_puts_it_in_the_middle_and_keeps_level():
    rng = np.random.default_rng(3)
    for _ in range(100):
        eye, aim = rng.uniform(-1, 1, (2, 3))
        camera = Camera.pinhole(640, 480, 500, look_at(eye, aim))
        np.testing.assert_allclose(camera.project(aim), [319.5, 239.5], atol=1e-8)
        np.testing.assert_allclose(camera.position, eye)
        rotation = camera.transform_base_camera[:3, :3]
        assert rotation[2, 0] == pytest.approx(0, abs=1e-12)  # the picture's rows are level
        assert rotation[2, 1] <= 0  # and it is not upside down
        assert camera.up == pytest.approx(rotation.T @ [0, 0, 1])
        assert np.linalg.det(rotation) == pytest.approx(1)


@pytest.mark.parametrize(("drop", "top"), [(-1.0, [1, 0, 0]), (1.0, [-1, 0, 0])])
def test_straight_down_and_up(drop, top):
    rotation = look_at([0.1, 0.2, 0.3], [0.1, 0.2, 0.3 + drop])[:3, :3]
    np.testing.assert_allclose(rotation[:, 2], [0, 0, drop], atol=1e-15)
    np.testing.assert_allclose(-rotation[:, 1], top, atol=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1)


@pytest.mark.parametrize("aim", [(0, 0, 0), (math.nan, 0, 1), (math.inf, 0, 1)])
def test_looking_nowhere_is_refused(aim):
    with pytest.raises(InputError, match="two distinct finite points"):
        look_at((0, 0, 0), aim)


def test_rounding_in_a_rotation_is_repaired():
    pose = look_at([0.1, 0.125, 0.08], [0.17, -0.05, -0.09])
    repaired = rigid(pose.round(4))
    rotation = repaired[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(repaired, pose, atol=2e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "0 x 480 px"),
        ({"camera_matrix": np.eye(4)}, r"shape \(4, 4\)"),
        ({"camera_matrix": intrinsics(-5, 500, 1, 1)}, "positive focal lengths"),
        ({"camera_matrix": intrinsics(500, math.nan, 1, 1)}, "positive focal lengths"),
        ({"distortion": np.zeros(3)}, "3 coefficients"),
        ({"distortion": np.full(4, math.nan)}, "finite"),
        ({"transform_base_camera": np.diag([1, 1, -1, 1])}, r"determinant \+1 \(this is -1\)"),
        ({"transform_base_camera": 2 * np.eye(4)}, "last row"),
        ({"transform_base_camera": np.diag([2, 1, 1, 1])}, "orthonormal columns"),
        ({"transform_base_camera": np.full((4, 4), math.nan)}, "finite"),
    ],
)
def test_what_is_no_camera_is_refused(change, message):
    good = {
        "width": 640,
        "height": 480,
        "camera_matrix": intrinsics(500, 500, 320, 240),
        "distortion": np.zeros(5),
        "transform_base_camera": np.eye(4),
    }
    Camera(**good)
    with pytest.raises(InputError, match=message):
        Camera(**(good | change))


def test_a_camera_is_frozen_to_the_buffer():
    matrix = intrinsics(500, 500, 320, 240)
    camera = Camera(640, 480, matrix, np.zeros(0), np.eye(4))
    matrix[0, 0] = 1
    assert camera.focal_px == (500.0, 500.0)
    for array in (camera.camera_matrix, camera.distortion, camera.transform_base_camera):
        assert not array.flags.writeable
