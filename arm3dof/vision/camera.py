"""A pinhole camera: intrinsics, lens distortion and its place in the robot's base frame.

Pixels are ``(u, v)`` with the centre of the top left pixel at (0, 0), as in OpenCV. The camera
frame is the optical one: x right, y down, z forward, so that depth is z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import ArrayLike

from arm3dof.errors import InputError
from arm3dof.state import Array, frozen_array

# OpenCV's distortion vectors: k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]]
_DISTORTION_LENGTHS = (4, 5, 8, 12, 14)
_ROTATION_TOLERANCE = 1e-3


@dataclass(frozen=True)
class Doubt:
    """Standard deviations of a camera's numbers; 0 takes a number for exact.

    Attributes:
        focal_px: of the focal lengths [px].
        centre_px: of the principal point, along each axis [px].
        position_m: of where it stands, along each axis [m].
        rotation_rad: of where it looks, about each axis [rad].

    Raises:
        InputError: one is negative or not finite.
    """

    focal_px: float = 0.0
    centre_px: float = 0.0
    position_m: float = 0.0
    rotation_rad: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"the camera's doubt {name} is {value}; give 0 or more")


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated camera that stands still in the base frame.

    Attributes:
        width: picture width [px].
        height: picture height [px].
        camera_matrix: intrinsics ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]``, shape (3, 3) [px].
        distortion: OpenCV's coefficients, shape (n,) with n = 4, 5, 8, 12 or 14; empty for none.
        transform_base_camera: takes points of the optical frame to the base frame, shape (4, 4).
        gamma: how it encodes light, code = light^(1 / gamma); ``None`` when not known, and then
            edges are less certain.
        doubt: how well its numbers are known.

    Raises:
        InputError: a size, a matrix or the transform cannot belong to a camera.
    """

    width: int
    height: int
    camera_matrix: Array
    distortion: Array
    transform_base_camera: Array
    gamma: float | None = None
    doubt: Doubt = field(default_factory=Doubt)

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise InputError(
                f"the camera's picture is {self.width} x {self.height} px; give sizes of 1 or more"
            )
        matrix = _checked_matrix(self.camera_matrix)
        distortion = frozen_array(self.distortion, None, name="distortion")
        if distortion.size not in (0, *_DISTORTION_LENGTHS):
            raise InputError(
                f"distortion has {distortion.size} coefficients; give none, 4, 5, 8, 12 or 14 "
                "in OpenCV's order k1 k2 p1 p2 k3 ..."
            )
        if not np.isfinite(distortion).all():
            raise InputError(f"distortion is {distortion.tolist()}; give finite numbers")
        if self.gamma is not None and not 0.2 <= self.gamma <= 5:
            raise InputError(f"gamma is {self.gamma}; give 0.2 to 5, for most cameras 2.2")
        object.__setattr__(self, "camera_matrix", matrix)
        object.__setattr__(self, "distortion", distortion)
        object.__setattr__(self, "transform_base_camera", rigid(self.transform_base_camera))

    @classmethod
    def pinhole(
        cls,
        width: int,
        height: int,
        focal_px: float,
        transform_base_camera: ArrayLike | None = None,
    ) -> Camera:
        """Build a camera from the one focal length that (1) yields.

        The optical axis meets the middle of the picture and the lens does not distort.

        Args:
            width: picture width [px].
            height: picture height [px].
            focal_px: focal length [px].
            transform_base_camera: pose, shape (4, 4); the base frame itself without one.

        Raises:
            InputError: an argument cannot belong to a camera.
        """
        return cls(
            width,
            height,
            intrinsics(focal_px, focal_px, (width - 1) / 2, (height - 1) / 2),
            np.zeros(0),
            frozen_array(
                np.eye(4) if transform_base_camera is None else transform_base_camera,
                4,
                4,
                name="transform_base_camera",
            ),
        )

    @property
    def position(self) -> Array:
        """Where the optical centre stands in the base frame, shape (3,) [m]."""
        return self.transform_base_camera[:3, 3].copy()

    @property
    def focal_px(self) -> tuple[float, float]:
        """Focal lengths (fx, fy) [px]."""
        return float(self.camera_matrix[0, 0]), float(self.camera_matrix[1, 1])

    @property
    def up(self) -> Array:
        """The base frame's z axis in the optical frame, shape (3,)."""
        return self.transform_base_camera[2, :3].copy()

    def to_base(self, p_camera: ArrayLike) -> Array:
        """Take points from the optical frame to the base frame; shape (..., 3) [m]."""
        points = np.asarray(p_camera, dtype=np.float64)
        transform = self.transform_base_camera
        result: Array = points @ transform[:3, :3].T + transform[:3, 3]
        return result

    def to_camera(self, p_base: ArrayLike) -> Array:
        """Take points from the base frame to the optical frame; shape (..., 3) [m]."""
        points = np.asarray(p_base, dtype=np.float64)
        transform = self.transform_base_camera
        result: Array = (points - transform[:3, 3]) @ transform[:3, :3]
        return result

    def project(self, p_base: ArrayLike) -> Array:
        """Find where points of the base frame fall in the picture.

        Args:
            p_base: points, shape (n, 3) or (3,) [m].

        Returns:
            Pixels (u, v), shape (n, 2) or (2,); NaN for a point that is not in front of the lens.
            A pixel may lie outside the picture.
        """
        p_camera = self.to_camera(p_base)
        points = p_camera.reshape(-1, 3)
        pixels = np.full((len(points), 2), np.nan)
        ahead = points[:, 2] > 0
        if ahead.any():
            zero = np.zeros(3)
            found, _ = cv2.projectPoints(
                points[ahead], zero, zero, self.camera_matrix, self.distortion
            )
            pixels[ahead] = found.reshape(-1, 2)
        return pixels.reshape(*p_camera.shape[:-1], 2)

    def rays(self, pixels: ArrayLike) -> Array:
        """Find the line of sight of each pixel, with the lens's distortion removed.

        Args:
            pixels: (u, v), shape (n, 2).

        Returns:
            Points (x, y, 1) of the optical frame at depth 1, shape (n, 3).
        """
        points = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        result = np.ones((len(points), 3))
        if len(points) and self.distortion.any():
            criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
            undistorted = cv2.undistortPoints(
                points.reshape(-1, 1, 2), self.camera_matrix, self.distortion, criteria=criteria
            )
            result[:, :2] = undistorted.reshape(-1, 2)
            return result
        matrix = self.camera_matrix
        result[:, 1] = (points[:, 1] - matrix[1, 2]) / matrix[1, 1]
        result[:, 0] = (points[:, 0] - matrix[0, 2] - matrix[0, 1] * result[:, 1]) / matrix[0, 0]
        return result

    def deproject(self, pixels: ArrayLike, depth: ArrayLike) -> Array:
        """Find the points of the base frame that are seen at pixels with known depths.

        Args:
            pixels: (u, v), shape (n, 2) or (2,).
            depth: distance along the optical axis, shape (n,) or a scalar [m].

        Returns:
            Points of the base frame, shape (n, 3) or (3,) [m].
        """
        given = np.asarray(pixels, dtype=np.float64)
        p_camera = self.rays(given) * np.asarray(depth, dtype=np.float64).reshape(-1, 1)
        return self.to_base(p_camera.reshape(*given.shape[:-1], 3))


def intrinsics(fx: float, fy: float, cx: float, cy: float) -> Array:
    """Assemble a camera matrix, shape (3, 3), from focal lengths and principal point [px]."""
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def look_at(position: ArrayLike, target: ArrayLike) -> Array:
    """Build the pose of a camera that looks from one point at another, held level.

    The base frame's z axis points up in the picture. A camera that looks straight up or down has
    no level: base +x points up in its picture when it looks down, and down when it looks up.

    Args:
        position: optical centre in the base frame, shape (3,) [m].
        target: the point that appears at the principal point, shape (3,) [m].

    Returns:
        ``transform_base_camera``, shape (4, 4).

    Raises:
        InputError: the two points are the same or not finite.
    """
    eye = frozen_array(position, 3, name="position")
    aim = frozen_array(target, 3, name="look_at")
    forward = aim - eye
    distance = float(np.linalg.norm(forward))
    if not np.isfinite(distance) or distance < 1e-9:
        raise InputError(
            f"the camera at {eye.tolist()} looks at {aim.tolist()}; give two distinct finite points"
        )
    forward = forward / distance
    right = np.array([forward[1], -forward[0], 0.0])
    length = float(np.linalg.norm(right))
    right = right / length if length > 1e-9 else np.array([0.0, -1.0, 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    pose[:3, 3] = eye
    return pose


def rigid(transform: ArrayLike) -> Array:
    """Check a rigid transform and make its rotation exactly orthonormal.

    Args:
        transform: shape (4, 4); the rotation may carry rounding of up to 1e-3.

    Returns:
        The nearest rigid transform, read-only.

    Raises:
        InputError: the last row, the rotation or the translation is not that of a rigid transform.
    """
    matrix = frozen_array(transform, 4, 4, name="transform_base_camera").copy()
    if not np.isfinite(matrix).all() or not np.allclose(matrix[3], [0, 0, 0, 1]):
        raise InputError(
            f"transform_base_camera is {matrix.tolist()}; give finite numbers with the last row "
            "0 0 0 1"
        )
    rotation = matrix[:3, :3]
    error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    determinant = float(np.linalg.det(rotation))
    if error > _ROTATION_TOLERANCE or determinant < 0:
        raise InputError(
            f"rotation is {rotation.tolist()}; give a rotation matrix: orthonormal columns "
            f"(these miss by {error:.2g}) and determinant +1 (this is {determinant:.2g})"
        )
    left, _, right = np.linalg.svd(rotation)
    matrix[:3, :3] = left @ right
    return frozen_array(matrix, 4, 4, name="transform_base_camera")


def _checked_matrix(values: ArrayLike) -> Array:
    matrix = frozen_array(values, 3, 3, name="camera_matrix")
    right_form = (
        np.isfinite(matrix).all()
        and matrix[0, 0] > 0
        and matrix[1, 1] > 0
        and matrix[1, 0] == 0
        and np.array_equal(matrix[2], [0, 0, 1])
    )
    if not right_form:
        raise InputError(
            f"camera_matrix is {matrix.tolist()}; give [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] "
            "with positive focal lengths [px]"
        )
    return matrix
