"""The error budget: what makes a point uncertain, by cause, and whether it is good enough.

An error moves an object's centre and the height of its foot together, so each cause is a covariance
of four numbers, the centre in the optical frame and that height [m^2]. A table of known height
then tells a part of the error from the truth, as a measurement does in a Kalman filter.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from arm3dof.errors import InputError
from arm3dof.state import Array
from arm3dof.vision.camera import Camera
from arm3dof.vision.placing import Placement

_WORTH_SAYING = 0.25  # a cause of this share of the variance is named


class Cause(enum.Enum):
    """What makes a point uncertain; the value is the cure."""

    NOISE = "use more light"
    EDGE = "move the camera nearer"
    WIDTH = "measure the object's width"
    LENS = "calibrate the focal length"
    POSE = "calibrate the camera's pose"
    TABLE = "measure the table's height"


@dataclass(frozen=True)
class Table:
    """A level table top on which objects stand.

    Attributes:
        height_m: of its top in the base frame [m].
        sigma_m: standard deviation of that [m].

    Raises:
        InputError: a number is not finite, or the deviation is not above 0.
    """

    height_m: float
    sigma_m: float = 0.001

    def __post_init__(self) -> None:
        if not math.isfinite(self.height_m):
            raise InputError(f"the table's height_m is {self.height_m}; give finite metres")
        if not (math.isfinite(self.sigma_m) and self.sigma_m > 0):
            raise InputError(f"the table's sigma_m is {self.sigma_m}; give metres above 0")


Budget = Mapping[Cause, Array]
"""Covariance by cause, shape (4, 4) or, of a point alone, (3, 3) [m^2]."""


class Stood(NamedTuple):
    """A point after a table's height was taken into account.

    Attributes:
        p_camera: the point, shape (3,) [m].
        budget: covariance of the point in the optical frame by cause, shape (3, 3) [m^2].
    """

    p_camera: Array
    budget: dict[Cause, Array]


def causes(placement: Placement, camera: Camera, relative_width: float) -> dict[Cause, Array]:
    """Return the covariance of centre and foot by cause, shape (4, 4) [m^2].

    Args:
        placement: where the thing is, with what its outline says about errors.
        camera: the camera, with its doubt.
        relative_width: standard deviation of the true width over the width.
    """
    p, doubt = placement.p_camera, camera.doubt
    focal, depth = camera.focal_px[0], float(p[2])
    rigid = np.vstack([np.eye(3), camera.up])
    grown = relative_width * np.append(
        p, rigid[3] @ p if placement.foot is None else placement.foot
    )
    lens = np.diag([doubt.centre_px, doubt.centre_px, doubt.focal_px]) * depth / focal
    turned = doubt.rotation_rad**2 * (p @ p * np.eye(3) - np.outer(p, p))
    return {
        Cause.NOISE: placement.noise,
        Cause.EDGE: placement.light,
        Cause.WIDTH: np.outer(grown, grown),
        Cause.LENS: rigid @ lens**2 @ rigid.T,
        Cause.POSE: rigid @ (turned + doubt.position_m**2 * np.eye(3)) @ rigid.T,
    }


def stand(
    placement: Placement, budget: Budget, camera: Camera, table: Table | None
) -> Stood | None:
    """Let a thing stand on a table; None when its foot is not there, by four deviations.

    Without a table, or for a thing that shows no foot, the point stays where it was seen.
    """
    keep = np.eye(3, 4)
    if table is None or placement.foot is None:
        return Stood(placement.p_camera, {it: keep @ c @ keep.T for it, c in budget.items()})
    total = np.sum(list(budget.values()), axis=0)
    variance = float(total[3, 3]) + table.sigma_m**2
    miss = table.height_m - float(camera.position[2]) - placement.foot
    if miss**2 > 16 * variance:
        return None
    gain = total[:3, 3] / variance
    keep[:, 3] = -gain
    left = {it: keep @ c @ keep.T for it, c in budget.items()}
    left[Cause.TABLE] = table.sigma_m**2 * np.outer(gain, gain)
    return Stood(placement.p_camera + gain * miss, left)


@dataclass(frozen=True)
class Verdict:
    """Whether a point is certain enough to act on.

    Attributes:
        good: whether it is.
        sigma_m: standard deviation in the least certain direction [m].
        limit_m: the most that is good enough [m].
        by_cause: standard deviation that each cause adds in that direction, the largest first [m].
    """

    good: bool
    sigma_m: float
    limit_m: float
    by_cause: Mapping[Cause, float]

    @property
    def sentence(self) -> str:
        """What to tell a person."""
        sigma, limit = _mm(self.sigma_m), _mm(self.limit_m)
        if self.good:
            return f"target certain enough: sigma {sigma} mm of {limit} mm"
        total = self.sigma_m**2
        cures = [it.value for it, s in self.by_cause.items() if s * s > _WORTH_SAYING * total]
        return f"target too uncertain: sigma {sigma} mm > {limit} mm; " + " or ".join(cures)


def judge(budget: Budget, limit_m: float) -> Verdict:
    """Decide whether a point is certain enough.

    Args:
        budget: covariance of the point by cause, shape (3, 3) [m^2].
        limit_m: the most that is good enough, in the least certain direction [m].

    Raises:
        InputError: the limit is not above 0.
    """
    if not limit_m > 0:
        raise InputError(f"limit_m is {limit_m}; give metres above 0")
    values, vectors = np.linalg.eigh(np.sum(list(budget.values()), axis=0))
    worst = vectors[:, -1]
    parts = {it: math.sqrt(max(float(worst @ c @ worst), 0.0)) for it, c in budget.items()}
    ordered = dict(sorted(parts.items(), key=lambda item: -item[1]))
    sigma = math.sqrt(max(float(values[-1]), 0.0))
    return Verdict(sigma <= limit_m, sigma, limit_m, ordered)


def _mm(metres: float) -> str:
    return f"{1000 * metres:.1f}" if metres < 0.01 else f"{1000 * metres:.0f}"
