"""Where a camera stands, from points that it sees at known places."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm3dof.errors import InputError
from arm3dof.state import Array, frozen_array
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import check_image

FEWEST_POINTS = 4
_MOST_RMS_PX = 2.0
_NOISE_PX = 0.15  # pixels are not better than that
_MOST_POSITION_SIGMA = 0.005  # [m]
_AMBIGUOUS = 2.0  # the second-best pose must be so many times worse
_FLAT = 0.02  # points are in a plane when their spread across it is less, of that along it
_DICTIONARY = "DICT_4X4_50"


class Trouble(enum.Enum):
    """What is wrong with a pose; the value says it, with its cure."""

    FEW_POINTS = f"fewer than {FEWEST_POINTS} points; give more, far apart"
    IN_LINE = "the points lie nearly in one line; spread them"
    HIGH_RMS = (
        f"points are off by more than {_MOST_RMS_PX:g} px; check their order, their places and "
        "the lens"
    )
    AMBIGUOUS = "two poses explain the points about as well; come nearer, or tilt the camera more"
    UNCERTAIN = "the place stays uncertain by more than 5 mm; use more points, further apart"


@dataclass(frozen=True, eq=False)
class PoseCalibration:
    """A camera's pose, as far as the points tell it.

    Attributes:
        transform_base_camera: the pose, shape (4, 4); None when there is none.
        covariance: of position [m] and of small turns about the base's axes [rad], shape (6, 6).
        rms_px: by how much points are off, root of the mean square [px].
        troubles: what is wrong with it.
    """

    transform_base_camera: Array | None
    covariance: Array
    rms_px: float
    troubles: tuple[Trouble, ...]

    @property
    def good(self) -> bool:
        """Whether nothing is wrong with it."""
        return not self.troubles

    @property
    def position_sigma_m(self) -> float:
        """Standard deviation of the position along an axis, on average [m]."""
        return math.sqrt(max(float(np.trace(self.covariance[:3, :3])) / 3, 0.0))

    @property
    def rotation_sigma_rad(self) -> float:
        """Standard deviation of a turn about an axis, on average [rad]."""
        return math.sqrt(max(float(np.trace(self.covariance[3:, 3:])) / 3, 0.0))

    def applied(self, camera: Camera) -> Camera:
        """Return the camera at this pose, with its doubt.

        Raises:
            InputError: there is no pose.
        """
        if self.transform_base_camera is None:
            raise InputError("no pose was found; see its troubles")
        doubt = replace(
            camera.doubt,
            position_m=self.position_sigma_m,
            rotation_rad=self.rotation_sigma_rad,
        )
        return replace(camera, transform_base_camera=self.transform_base_camera, doubt=doubt)


def calibrate_pose(
    p_base: ArrayLike, pixels: ArrayLike, camera: Camera, *, same_points: bool = False
) -> PoseCalibration:
    """Compute where a camera stands from points that it sees.

    Args:
        p_base: the points in the base frame, shape (n, 3) [m].
        pixels: where each is seen, shape (n, 2) [px].
        camera: the camera with its lens; its pose decides only with ``same_points``.
        same_points: whether the points may also be in the reverse order, as the corners of a board
            that looks the same upside down; the pose nearer to the camera's own is taken.

    Raises:
        InputError: the arrays do not fit each other or hold what is not finite.
    """
    points = frozen_array(p_base, None, 3, name="p_base")
    seen = frozen_array(pixels, len(points), 2, name="pixels")
    if not (np.isfinite(points).all() and np.isfinite(seen).all()):
        raise InputError("p_base or pixels hold what is not finite; give finite numbers")
    if len(points) < FEWEST_POINTS:
        return _none(Trouble.FEW_POINTS)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[1] < _FLAT * spread[0]:
        return _none(Trouble.IN_LINE)
    poses = _poses(points, seen, camera, flat=bool(spread[2] < _FLAT * spread[1]))
    if same_points:
        turned = _poses(points[::-1], seen, camera, flat=True)
        if turned and (not poses or _gap(turned[0], camera) < _gap(poses[0], camera)):
            points, poses = frozen_array(points[::-1], None, 3, name="p_base"), turned
    if not poses:
        return _none(Trouble.HIGH_RMS)
    best = poses[0]
    covariance = _covariance(best, points, len(points), camera)
    found = PoseCalibration(best.transform, covariance, best.rms, ())
    ambiguous = len(poses) > 1 and poses[1].rms < _AMBIGUOUS * max(best.rms, _NOISE_PX)
    checks = {
        Trouble.HIGH_RMS: best.rms > _MOST_RMS_PX,
        Trouble.AMBIGUOUS: ambiguous,
        Trouble.UNCERTAIN: not found.position_sigma_m < _MOST_POSITION_SIGMA,
    }
    return replace(found, troubles=tuple(it for it, present in checks.items() if present))


def marker_corners(image: NDArray[np.generic], number: int) -> Array | None:
    """Find an ArUco marker of the dictionary of 50 with 4 x 4 cells.

    Args:
        image: BGR picture, shape (h, w, 3), uint8.
        number: which marker.

    Returns:
        Its corners (u, v), clockwise from its own top left, shape (4, 2); None when not seen.

    Raises:
        InputError: the picture is not one, or there is no such marker.
    """
    if not 0 <= number < 50:
        raise InputError(f"there is no marker {number}; give 0 to 49 of {_DICTIONARY}")
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(
        cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, _DICTIONARY)), settings
    )
    corners, numbers, _ = detector.detectMarkers(check_image(image))
    if numbers is None:
        return None
    for corner, found in zip(corners, np.ravel(numbers), strict=True):
        if found == number:
            return np.asarray(corner, dtype=np.float64).reshape(4, 2)
    return None


def marker_points(size_m: float) -> Array:
    """Return a marker's corners about its middle, as ``marker_corners`` has them, (4, 3) [m]."""
    if not (math.isfinite(size_m) and size_m > 0):
        raise InputError(f"size_m is {size_m}; give the edge of the marker in metres")
    return size_m / 2 * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])


def lying(points: Array, at: ArrayLike, yaw: float) -> Array:
    """Lay what is flat on the table.

    Args:
        points: in its own plane, shape (n, 3) [m].
        at: where its middle is in the base frame, shape (3,) [m].
        yaw: how its x axis is turned from the base's [rad].
    """
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    result: Array = points @ turn.T + frozen_array(at, 3, name="at")
    return result


class _Pose(NamedTuple):
    transform: Array
    rms: float


def _poses(points: Array, seen: Array, camera: Camera, *, flat: bool) -> list[_Pose]:
    """Return the poses that explain the points, the best first."""
    method = cv2.SOLVEPNP_IPPE if flat else cv2.SOLVEPNP_SQPNP
    middle = points.mean(axis=0)
    centred = points - middle  # IPPE goes astray where the origin is not among the points
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            centred, seen, camera.camera_matrix, camera.distortion, flags=method
        )
    except cv2.error:
        return []
    found = []
    for turn, shift in zip(turns, shifts, strict=True):
        refined = cv2.solvePnPRefineLM(
            centred, seen, camera.camera_matrix, camera.distortion, turn, shift
        )
        rotation = np.asarray(cv2.Rodrigues(refined[0])[0], dtype=np.float64)
        transform: Array = np.eye(4)
        transform[:3, :3] = rotation.T
        transform[:3, 3] = middle - rotation.T @ np.ravel(refined[1])
        off = replace(camera, transform_base_camera=transform).project(points) - seen
        rms = float(np.sqrt((off**2).sum(axis=1).mean()))
        if math.isfinite(rms):
            found.append(_Pose(transform, rms))
    return sorted(found, key=lambda it: it.rms)


def _covariance(pose: _Pose, points: Array, count: int, camera: Camera) -> Array:
    """Return the covariance of position and turn that noise of the pixels causes, (6, 6)."""
    placed = replace(camera, transform_base_camera=pose.transform)
    # the same change of all points, the other way round, is the change of the camera
    columns = []
    step = 1e-6
    for axis in np.eye(3):
        moved = placed.project(points - step * axis) - placed.project(points + step * axis)
        columns.append(moved.ravel() / (2 * step))
    about = points - placed.position
    for axis in np.eye(3):
        turn = step * np.cross(axis, about)
        moved = placed.project(points - turn) - placed.project(points + turn)
        columns.append(moved.ravel() / (2 * step))
    slope = np.column_stack(columns)
    spare = max(2 * count - 6, 1)
    variance = max(pose.rms**2 * count / spare, _NOISE_PX**2)
    return np.asarray(variance * np.linalg.pinv(slope.T @ slope), dtype=np.float64)


def _gap(pose: _Pose, camera: Camera) -> float:
    return float(np.linalg.norm(pose.transform[:3, 3] - camera.position))


def _none(trouble: Trouble) -> PoseCalibration:
    return PoseCalibration(None, np.zeros((6, 6)), math.nan, (trouble,))
