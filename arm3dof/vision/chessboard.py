"""The lens of a camera from pictures of a chessboard: Zhang's method, with a verdict."""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from arm3dof.errors import InputError
from arm3dof.state import Array, frozen_array
from arm3dof.vision.colour import check_image

FEWEST_BOARDS = 5
"""So many views of a board make a calibration; twice as many make a good one."""

_MOST_RMS_PX = 1.0
_LEAST_TURN = math.radians(15)  # between the two boards that are turned most differently
_LEAST_COVER = 0.35  # of the picture, by all boards together
_MOST_FOCAL_SIGMA = 0.02
_STRAY = 3.0  # a view with so many times the usual error is left out
_NOISE_PX = 0.05  # corners are not better than that


class Trouble(enum.Enum):
    """What is wrong with a calibration; the value says it, with its cure."""

    FEW_BOARDS = f"the board is seen in fewer than {FEWEST_BOARDS} pictures; take 10 to 20"
    HIGH_RMS = (
        f"corners are off by more than {_MOST_RMS_PX:g} px; hold the board still and flat, and "
        "focus"
    )
    ALIKE = "the board is turned alike in all pictures; tilt it by 30 degrees to all sides"
    SMALL = "the boards cover a small part of the picture; bring it nearer, and into the corners"
    UNCERTAIN = "the focal length stays uncertain by more than 2 %; take more pictures"


@dataclass(frozen=True, eq=False)
class LensCalibration:
    """A camera's lens, as far as the pictures tell it.

    Attributes:
        width: picture width [px].
        height: picture height [px].
        camera_matrix: intrinsics, shape (3, 3) [px]; None when there are too few boards.
        distortion: k1 k2 p1 p2 k3, shape (5,).
        rms_px: by how much corners are off, root of the mean square [px].
        focal_sigma_px: standard deviation of the focal lengths [px].
        centre_sigma_px: standard deviation of the principal point along an axis [px].
        used: the pictures that count, by their place in the list.
        troubles: what is wrong with it.
    """

    width: int
    height: int
    camera_matrix: Array | None
    distortion: Array
    rms_px: float
    focal_sigma_px: float
    centre_sigma_px: float
    used: tuple[int, ...]
    troubles: tuple[Trouble, ...]

    @property
    def good(self) -> bool:
        """Whether nothing is wrong with it."""
        return not self.troubles


def board_corners(image: NDArray[np.generic], columns: int, rows: int) -> Array | None:
    """Find the inner corners of a chessboard to a fraction of a pixel.

    Args:
        image: BGR picture, shape (h, w, 3), uint8.
        columns: inner corners in a row of the board.
        rows: rows of inner corners.

    Returns:
        Pixels (u, v) row by row, shape (rows * columns, 2); None when no whole board is seen.

    Raises:
        InputError: the picture is not one, or a board has fewer than 3 corners to a side.
    """
    if min(columns, rows) < 3:
        raise InputError(f"the board has {columns} x {rows} inner corners; give 3 or more each way")
    grey = cv2.cvtColor(check_image(image), cv2.COLOR_BGR2GRAY)
    flags = cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCornersSB(grey, (columns, rows), flags=flags)
    return np.asarray(corners, dtype=np.float64).reshape(-1, 2) if found else None


def board_points(columns: int, rows: int, square_m: float) -> Array:
    """Return the inner corners about the board's middle, x along a row, shape (n, 3) [m]."""
    if not (math.isfinite(square_m) and square_m > 0):
        raise InputError(f"square_m is {square_m}; give the edge of a square in metres")
    x, y = np.meshgrid(np.arange(columns) - (columns - 1) / 2, np.arange(rows) - (rows - 1) / 2)
    return square_m * np.column_stack([x.ravel(), -y.ravel(), np.zeros(x.size)])


def calibrate_lens(
    corners: Sequence[Array | None], board: Array, width: int, height: int
) -> LensCalibration:
    """Compute a lens from the corners of a board in several pictures.

    A picture whose corners fit three times worse than the others' is left out.

    Args:
        corners: pixels of the board's corners in each picture, shape (n, 2); None where not seen.
        board: the same corners on the board, shape (n, 3) [m].
        width: of the pictures [px].
        height: of the pictures [px].
    """
    used = [index for index, it in enumerate(corners) if it is not None]
    seen = [np.asarray(it, dtype=np.float32) for it in corners if it is not None]
    if len(seen) < FEWEST_BOARDS:
        nothing = frozen_array([], None, name="distortion")
        few = (Trouble.FEW_BOARDS,)
        return LensCalibration(
            width, height, None, nothing, math.nan, math.nan, math.nan, tuple(used), few
        )
    solved = _solve(seen, board, width, height)
    worst = _STRAY * float(np.median(solved.views)) + _NOISE_PX
    kept = [k for k, error in enumerate(solved.views) if error <= worst]
    if FEWEST_BOARDS <= len(kept) < len(seen):
        seen, used = [seen[k] for k in kept], [used[k] for k in kept]
        solved = _solve(seen, board, width, height)
    return LensCalibration(
        width,
        height,
        frozen_array(solved.matrix, 3, 3, name="camera_matrix"),
        frozen_array(solved.distortion, None, name="distortion"),
        solved.rms,
        float(np.hypot(*solved.sigmas[:2]) / math.sqrt(2)),
        float(np.hypot(*solved.sigmas[2:4]) / math.sqrt(2)),
        tuple(used),
        _troubles(solved, seen, width, height),
    )


@dataclass(frozen=True, eq=False)
class _Solved:
    matrix: Array
    distortion: Array
    rms: float
    views: Array
    sigmas: Array
    turns: list[Array]


def _solve(seen: list[NDArray[np.float32]], board: Array, width: int, height: int) -> _Solved:
    rms, matrix, distortion, turns, _, sigmas, _, views = cv2.calibrateCameraExtended(
        [board.astype(np.float32)] * len(seen), seen, (width, height), None, None
    )
    # what OpenCV states follows the residual, which may be less than corners deserve
    scale = max(1.0, _NOISE_PX / max(float(rms), 1e-9))
    return _Solved(
        np.asarray(matrix, dtype=np.float64),
        np.asarray(distortion, dtype=np.float64).ravel(),
        float(rms),
        np.asarray(views, dtype=np.float64).ravel(),
        scale * np.asarray(sigmas, dtype=np.float64).ravel(),
        [np.asarray(it, dtype=np.float64).ravel() for it in turns],
    )


def _troubles(
    solved: _Solved, seen: list[NDArray[np.float32]], width: int, height: int
) -> tuple[Trouble, ...]:
    normals = np.array([cv2.Rodrigues(turn)[0][:, 2] for turn in solved.turns])
    turn = math.acos(float(np.clip((normals @ normals.T).min(), -1, 1)))
    hull = cv2.convexHull(np.concatenate(seen).reshape(-1, 1, 2))
    cover = cv2.contourArea(hull) / (width * height)
    focal = float(solved.matrix[0, 0])
    checks = {
        Trouble.HIGH_RMS: solved.rms > _MOST_RMS_PX,
        Trouble.ALIKE: turn < _LEAST_TURN,
        Trouble.SMALL: cover < _LEAST_COVER,
        Trouble.UNCERTAIN: not solved.sigmas[0] < _MOST_FOCAL_SIGMA * focal,
    }
    return tuple(trouble for trouble, present in checks.items() if present)
