"""Lenses and poses from synthetic boards and markers that a known, distorted camera sees."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from prints import CAMERA, COLUMNS, MATRIX, ROWS, SQUARE, chess, held, print_of

from arm3dof.errors import InputError
from arm3dof.vision import chessboard, pose
from arm3dof.vision.camera import Camera, look_at
from arm3dof.vision.chessboard import board_corners, board_points, calibrate_lens
from arm3dof.vision.pose import calibrate_pose, lying, marker_corners, marker_points


@pytest.fixture(scope="module")
def pictures():
    rng = np.random.default_rng(0)
    return [print_of(*chess(), CAMERA, held(rng)) for _ in range(8)]


def test_corners_and_lens_come_from_pictures(pictures):
    corners = [board_corners(it, COLUMNS, ROWS) for it in pictures]
    assert sum(it is not None for it in corners) >= 7
    found = calibrate_lens(corners, board_points(COLUMNS, ROWS, SQUARE), 640, 480)
    assert found.good, found.troubles
    assert found.rms_px < 0.15
    off = np.array([found.camera_matrix[0, 0] - 610, found.camera_matrix[1, 1] - 605])
    assert np.abs(off).max() < max(4 * found.focal_sigma_px, 1.5)
    assert found.focal_sigma_px < 6
    assert np.hypot(*(found.camera_matrix[:2, 2] - MATRIX[:2, 2])) < 5 * found.centre_sigma_px
    # what matters is where the lens sends rays
    there = Camera(640, 480, found.camera_matrix, found.distortion, np.eye(4))
    spots = np.array([[100.0, 80], [320, 240], [540, 400]])
    np.testing.assert_allclose(there.rays(spots), CAMERA.rays(spots), atol=0.006)


def synthetic(rng, count, tilt=0.6, noise=0.1, spread=0.05):
    board = board_points(COLUMNS, ROWS, SQUARE)
    views = []
    for _ in range(count):
        at = held(rng, tilt, spread)
        seen = CAMERA.project(board @ at[:3, :3].T + at[:3, 3])
        views.append(seen + rng.normal(0, noise, seen.shape))
    return views


def test_the_stated_focal_sigma_is_honest():
    rng = np.random.default_rng(1)
    board, ratios = board_points(COLUMNS, ROWS, SQUARE), []
    for _ in range(12):
        found = calibrate_lens(synthetic(rng, 10), board, 640, 480)
        ratios.append((found.camera_matrix[0, 0] - 610) / found.focal_sigma_px)
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.8


def test_each_bad_calibration_has_its_verdict():
    rng = np.random.default_rng(2)
    board = board_points(COLUMNS, ROWS, SQUARE)
    few = calibrate_lens([*synthetic(rng, 4), None, None], board, 640, 480)
    assert few.troubles == (chessboard.Trouble.FEW_BOARDS,)
    assert few.camera_matrix is None
    assert not few.good
    alike = calibrate_lens(synthetic(rng, 8, tilt=0.03), board, 640, 480)
    assert chessboard.Trouble.ALIKE in alike.troubles
    blurred = calibrate_lens(synthetic(rng, 8, noise=2.0), board, 640, 480)
    assert chessboard.Trouble.HIGH_RMS in blurred.troubles
    good = synthetic(rng, 9)
    good[4] = good[4] + rng.normal(0, 4, good[4].shape)
    left_out = calibrate_lens(good, board, 640, 480)
    assert 4 not in left_out.used
    assert left_out.rms_px < 0.2
    for trouble in (*chessboard.Trouble, *pose.Trouble):
        assert ";" in trouble.value


def test_a_board_that_is_not_there_is_not_found():
    assert board_corners(np.full((120, 160, 3), 128, np.uint8), COLUMNS, ROWS) is None
    with pytest.raises(InputError, match="2 x 6 inner corners"):
        board_corners(np.zeros((9, 9, 3), np.uint8), 2, 6)
    with pytest.raises(InputError, match="square_m is 0"):
        board_points(9, 6, 0)


# ---- poses --------------------------------------------------------------------------------------

POSE = look_at([0.06, 0.30, 0.17], [0.175, -0.035, -0.09])
STANDING = replace(CAMERA, transform_base_camera=POSE)


def test_the_pose_comes_from_points_in_space_and_its_covariance_is_honest():
    rng = np.random.default_rng(3)
    squares = []
    for _ in range(40):
        points = rng.uniform([0.1, -0.12, -0.1], [0.25, 0.12, 0.1], (12, 3))
        pixels = STANDING.project(points) + rng.normal(0, 0.5, (12, 2))
        found = calibrate_pose(points, pixels, CAMERA)
        assert found.good, found.troubles
        miss = found.transform_base_camera[:3, 3] - POSE[:3, 3]
        turn, _ = cv2.Rodrigues(found.transform_base_camera[:3, :3] @ POSE[:3, :3].T)
        error = np.concatenate([miss, turn.ravel()])
        squares.append(error @ np.linalg.solve(found.covariance, error))
        assert np.linalg.norm(miss) < 0.008
    assert 4 < np.mean(squares) < 9  # 6 of a normal law
    placed = found.applied(CAMERA)
    assert placed.doubt.position_m == found.position_sigma_m > 0
    assert placed.doubt.rotation_rad == found.rotation_sigma_rad > 0


@pytest.mark.parametrize("kind", ["marker", "board"])
def test_the_pose_comes_from_a_picture_of_a_print_on_the_table(kind):
    at, yaw = np.array([0.17, -0.02, -0.09]), 0.4
    if kind == "marker":
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        cells = cv2.aruco.generateImageMarker(dictionary, 7, 240)
        pattern = cv2.copyMakeBorder(cells, 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=255)
        size = (0.08 * 320 / 240,) * 2
    else:
        pattern, size = chess()
    frame = np.eye(4)
    frame[:3, :3] = [
        [math.cos(yaw), -math.sin(yaw), 0],
        [math.sin(yaw), math.cos(yaw), 0],
        [0, 0, 1],
    ]
    frame[:3, 3] = at
    image = print_of(pattern, size, CAMERA, np.linalg.inv(POSE) @ frame)
    if kind == "marker":
        seen, flat = marker_corners(image, 7), marker_points(0.08)
        assert marker_corners(image, 8) is None
    else:
        seen, flat = board_corners(image, COLUMNS, ROWS), board_points(COLUMNS, ROWS, SQUARE)
    guess = replace(STANDING, transform_base_camera=look_at([0.1, 0.4, 0.2], at))
    found = calibrate_pose(lying(flat, at, yaw), seen, guess, same_points=kind == "board")
    assert found.rms_px < 0.5
    assert np.linalg.norm(found.transform_base_camera[:3, 3] - POSE[:3, 3]) < 0.006
    assert pose.Trouble.HIGH_RMS not in found.troubles


def test_each_bad_pose_has_its_verdict():
    rng = np.random.default_rng(4)
    line = np.outer(np.linspace(1, 2, 6), [0.1, 0.1, 0.0])
    far = lying(marker_points(0.02), [0.2, -1.2, -0.09], 0)
    cases = {
        pose.Trouble.FEW_POINTS: line[:3],
        pose.Trouble.IN_LINE: line,
        pose.Trouble.AMBIGUOUS: far,
    }
    for trouble, points in cases.items():
        pixels = STANDING.project(points) + rng.normal(0, 0.2, (len(points), 2))
        assert trouble in calibrate_pose(points, pixels, CAMERA).troubles
    points = rng.uniform([0.1, -0.1, -0.1], [0.25, 0.1, 0.1], (8, 3))
    mixed = calibrate_pose(points, STANDING.project(points)[::-1], CAMERA)
    assert pose.Trouble.HIGH_RMS in mixed.troubles
    with pytest.raises(InputError, match="no pose was found"):
        calibrate_pose(line[:3], np.zeros((3, 2)), CAMERA).applied(CAMERA)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: calibrate_pose(np.zeros((4, 2)), np.zeros((4, 2)), CAMERA), "p_base has shape"),
        (lambda: calibrate_pose(np.zeros((4, 3)), np.zeros((5, 2)), CAMERA), "pixels has shape"),
        (lambda: calibrate_pose(np.full((4, 3), np.nan), np.zeros((4, 2)), CAMERA), "not finite"),
        (lambda: marker_points(0), "size_m is 0"),
        (lambda: marker_corners(np.zeros((9, 9, 3), np.uint8), 50), "no marker 50"),
    ],
)
def test_what_is_no_input_is_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()
