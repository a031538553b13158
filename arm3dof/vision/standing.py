"""Where a thing stands on a known table, and how large it is, from its outline alone.

An upright cylinder on the table has four unknowns: its place (x, y), width and height. The four
sides of its outline in the picture are four numbers. So a camera that knows where the table is
needs no known width, and its error no longer grows with the square of the distance, as that of
(2) does: the foot of a thing is where the line of sight meets the table.

A box is measured as the cylinder that looks as wide, a bottle as its belly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.state import Array, frozen_array
from arm3dof.vision.camera import Camera

EDGE_SIGMA_PX = 0.4
"""What light, shade and noise do to one side of an outline [px]."""
SHAPE_SIGMA_M = 0.001
"""What the place errs by because things are not quite cylinders [m]."""

_STEPS = 15
_CONVERGED_PX = 0.01
_WIDTHS = (0.005, 0.2)  # [m]
_HEIGHTS = (0.005, 0.5)  # [m]
_TURN = np.linspace(0, 2 * np.pi, 32, endpoint=False)
_RIM = np.column_stack([np.cos(_TURN), np.sin(_TURN)]) / 2
_NUDGE = 1e-5  # [m]


@dataclass(frozen=True, eq=False)
class Standing:
    """A thing that stands on the table.

    Attributes:
        target: name of its target, commonly its colour.
        x: of the middle of its foot, in the base frame [m].
        y: of the middle of its foot [m].
        width_m: as wide as it looks [m].
        height_m: from foot to top [m].
        covariance: of (x, y), shape (2, 2) [m^2].
    """

    target: str
    x: float
    y: float
    width_m: float
    height_m: float
    covariance: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", frozen_array(self.covariance, 2, 2, name="cov"))

    @property
    def sigma_m(self) -> float:
        """Standard deviation of its place in the less certain direction [m]."""
        return float(np.sqrt(max(np.linalg.eigvalsh(self.covariance)[-1], 0.0)))

    def distance_to(self, x: float, y: float) -> float:
        """Return how far its middle is from a point of the table [m]."""
        return float(np.hypot(self.x - x, self.y - y))


def stand(
    target: str, outline_px: ArrayLike, camera: Camera, table_height: float
) -> Standing | None:
    """Stand what has an outline on the table.

    Args:
        target: name of the target.
        outline_px: left, top, right and bottom side of the outline, shape (4,) [px].
        camera: the camera.
        table_height: of the table in the base frame [m].

    Returns:
        The thing, or None when nothing that stands on the table looks like that.
    """
    outline = frozen_array(outline_px, 4, name="outline_px")
    state = _first_guess(outline, camera, table_height)
    for _ in range(_STEPS):
        if state is None or not _is_possible(state):
            return None
        seen = _outline(state, camera, table_height)
        slope = np.column_stack(
            [(_outline(state + step, camera, table_height) - seen) / _NUDGE for step in _STEPS_OF]
        )
        if not np.isfinite(slope).all() or abs(np.linalg.det(slope)) < 1e-3:
            return None
        inverse = np.linalg.inv(slope)
        state = state + inverse @ (outline - seen)
        if np.abs(outline - seen).max() < _CONVERGED_PX:
            covariance = EDGE_SIGMA_PX**2 * inverse @ inverse.T
            x, y, width, height = state.tolist()
            place = covariance[:2, :2] + SHAPE_SIGMA_M**2 * np.eye(2)
            return Standing(target, x, y, width, height, place)
    return None


_STEPS_OF = _NUDGE * np.eye(4)


def _outline(state: Array, camera: Camera, table_height: float) -> Array:
    """Return the sides of a cylinder's outline: left, top, right, bottom [px]."""
    x, y, width, height = state
    rim = np.column_stack([x + width * _RIM[:, 0], y + width * _RIM[:, 1]])
    foot = np.column_stack([rim, np.full(len(rim), table_height)])
    top = np.column_stack([rim, np.full(len(rim), table_height + height)])
    pixels = camera.project(np.concatenate([foot, top]))
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def _first_guess(outline: Array, camera: Camera, table_height: float) -> Array | None:
    left, top, right, bottom = outline
    middle = (left + right) / 2
    near = _meet(camera, (middle, bottom), table_height)
    far = _meet(camera, (middle, top), table_height)
    if near is None or far is None:
        return None
    depth = float(camera.to_camera(near)[2])
    width = (right - left) * depth / camera.focal_px[0]
    ahead = (far - near)[:2]
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    x, y = near[:2] + width / 2 * ahead
    return np.array([x, y, width, width])


def _meet(camera: Camera, pixel: tuple[float, float], height: float) -> Array | None:
    """Return where a line of sight meets a level plane, shape (3,); None above the horizon."""
    ray = camera.transform_base_camera[:3, :3] @ camera.rays([pixel])[0]
    drop = height - camera.position[2]
    if ray[2] * drop <= 0:
        return None
    return np.asarray(camera.position + drop / ray[2] * ray)


def _is_possible(state: Array) -> bool:
    _, _, width, height = state.tolist()
    return bool(
        np.isfinite(state).all()
        and _WIDTHS[0] <= width <= _WIDTHS[1]
        and _HEIGHTS[0] <= height <= _HEIGHTS[1]
    )
