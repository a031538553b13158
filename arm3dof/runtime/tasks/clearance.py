"""How far an arm's links are from the table and from things that stand on it.

Each collision shape of a moving link is stood for by points on its bounding box, 8 mm or less
apart; meshes are left out. A thing is an upright cylinder. What is held moves with the tool and is
points as well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm3dof.model.geometry import LinkShape, link_shapes
from arm3dof.model.gripper import find_gripper, with_gripper_at
from arm3dof.model.robot import Robot
from arm3dof.state import Array

_SPACING = 0.008  # of the points on a shape [m]
_STEP = 0.001  # to which openings of the gripper are rounded up [m]
TABLE = "the table"


@dataclass(frozen=True)
class Obstacle:
    """An upright cylinder on the table.

    Attributes:
        name: what messages call it.
        x: of its axis in the base frame [m].
        y: of its axis [m].
        radius: [m].
        top: height of its top in the base frame [m].
    """

    name: str
    x: float
    y: float
    radius: float
    top: float


@dataclass(frozen=True)
class Gap:
    """The narrowest gap at some configurations.

    Attributes:
        distance: [m]; negative where the arm is inside something.
        name: what is nearest.
        index: the configuration at which it is narrowest.
    """

    distance: float
    name: str
    index: int


class Clearance:
    """Measures gaps between an arm and what stands around it."""

    def __init__(self, robot: Robot, table_height: float) -> None:
        """Take up an arm.

        Args:
            robot: the robot.
            table_height: of the table in the base frame [m].
        """
        self._robot, self.table_height = robot.clone(), table_height
        gripper = find_gripper(robot)
        self._widest = 0.0 if gripper is None else gripper.opening
        self._hand = lru_cache(maxsize=64)(self._points_at)

    def gap(
        self,
        path: ArrayLike,
        opening: float,
        obstacles: Sequence[Obstacle] = (),
        held: Array | None = None,
    ) -> Gap:
        """Return the narrowest gap along a path.

        Args:
            path: configurations, shape (k, nv) [rad].
            opening: of the gripper [m].
            obstacles: what stands around.
            held: points of what is held, in the tool frame, shape (n, 3) [m].
        """
        rounded = min(np.ceil(opening / _STEP - 1e-6) * _STEP, self._widest)
        frames, clouds = self._hand(round(float(rounded), 6))
        best = Gap(np.inf, TABLE, 0)
        for index, q in enumerate(np.atleast_2d(np.asarray(path, dtype=np.float64))):
            places = self._robot.placements(q, frames)
            parts = [moved(place, cloud) for place, cloud in zip(places, clouds, strict=True)]
            if held is not None:
                parts.append(moved(self._robot.placement(q), held))
            world = np.concatenate(parts)
            low, high = world.min(axis=0).tolist(), world.max(axis=0).tolist()
            lowest = low[2] - self.table_height
            if lowest < best.distance:
                best = Gap(lowest, TABLE, index)
            for obstacle in obstacles:
                if _at_least(low, high, obstacle) >= best.distance:
                    continue
                distance = _distance(world, obstacle)
                if distance < best.distance:
                    best = Gap(distance, obstacle.name, index)
        return best

    def _points_at(self, opening: float) -> tuple[tuple[str, ...], tuple[Array, ...]]:
        """Return the links that carry shapes, and the points that each carries in its frame."""
        posed = with_gripper_at(self._robot, opening)
        model = posed.model
        data = model.createData()
        pin.framesForwardKinematics(model, data, pin.neutral(model))
        clouds: dict[str, list[Array]] = {}
        for shape in link_shapes(posed.description, "collision"):
            frame = model.getFrameId(shape.link)
            carrier = self._carrier(model.frames[frame].parentJoint)
            if carrier is not None:
                base = data.oMf[model.getFrameId(carrier)]
                local = base.actInv(data.oMf[frame]) * shape.placement
                clouds.setdefault(carrier, []).append(moved(local, _surface(shape)))
        return tuple(clouds), tuple(np.concatenate(parts) for parts in clouds.values())

    def _carrier(self, joint: int) -> str | None:
        """Return the first link that a joint moves; None for one that only turns about the base."""
        model = self._robot.model
        if joint <= 1:
            return None
        frames = (f for f in model.frames if f.type == pin.FrameType.BODY)
        return next((str(f.name) for f in frames if f.parentJoint == joint), None)


def moved(pose: pin.SE3, points: Array) -> Array:
    """Return points of a frame in the frame that its pose is given in, shape (n, 3)."""
    return np.asarray(points @ pose.rotation.T + pose.translation)


def held_points(width: float, height: float, below: float, tilt: pin.SE3) -> Array:
    """Return points of an upright cylinder that is held, in the tool frame, shape (n, 3).

    Args:
        width: its diameter [m].
        height: from foot to top [m].
        below: how far its foot is below the tool's origin [m].
        tilt: pose of the tool in the base frame when the cylinder stands upright.
    """
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    rim = width / 2 * np.column_stack([np.cos(turn), np.sin(turn)])
    levels = np.linspace(-below, height - below, 5)
    upright = np.concatenate([np.column_stack([rim, np.full(len(rim), z)]) for z in levels])
    return np.asarray(upright @ tilt.rotation)


def _at_least(low: Sequence[float], high: Sequence[float], obstacle: Obstacle) -> float:
    """Return a distance from an obstacle below which no point of a box is [m].

    Args:
        low: least coordinates of the box, shape (3,) [m].
        high: greatest coordinates, shape (3,) [m].
        obstacle: the obstacle.
    """
    x = max(low[0] - obstacle.x, obstacle.x - high[0], 0.0)
    y = max(low[1] - obstacle.y, obstacle.y - high[1], 0.0)
    aside, above = math.hypot(x, y) - obstacle.radius, low[2] - obstacle.top
    return math.hypot(aside, above) if min(aside, above) > 0 else max(aside, above)


def _distance(points: Array, obstacle: Obstacle) -> float:
    """Return the distance of the nearest point from an upright cylinder, negative inside [m]."""
    aside = np.hypot(points[:, 0] - obstacle.x, points[:, 1] - obstacle.y) - obstacle.radius
    above = points[:, 2] - obstacle.top
    outside = np.hypot(np.maximum(aside, 0), np.maximum(above, 0))
    return float((outside + np.minimum(np.maximum(aside, above), 0)).min())


def _surface(shape: LinkShape) -> Array:
    """Return points on the bounding box of a shape, shape (n, 3) [m]."""
    if shape.kind == "sphere":
        size = np.full(3, 2 * shape.size[0])
    elif shape.kind == "cylinder":
        size = np.array([2 * shape.size[0], 2 * shape.size[0], shape.size[1]])
    elif shape.kind == "box":
        size = np.array(shape.size)
    else:
        return np.zeros((0, 3))
    axes = [
        np.linspace(-edge / 2, edge / 2, max(int(np.ceil(edge / _SPACING)) + 1, 2)) for edge in size
    ]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    on_face = (np.abs(np.abs(grid) - size / 2) < 1e-9).any(axis=1)
    return np.asarray(grid[on_face])
