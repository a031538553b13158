"""From a blob's width to depth, to a point in the base frame, and to how far off it may be."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from arm3dof.errors import InputError
from arm3dof.state import Array, frozen_array
from arm3dof.vision.budget import Cause, Table, Verdict, causes, judge, stand
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import (
    Blob,
    BlobSettings,
    ColourTarget,
    Image,
    check_image,
    find_colours,
)
from arm3dof.vision.outline import trace
from arm3dof.vision.placing import Refusal, edge_sigma, place


@dataclass(frozen=True)
class Refused:
    """A patch of a target's colour that is not measured rather than measured wrong.

    Attributes:
        target: name of the target.
        box_px: colour frame (u, v, width, height) [px].
        reason: why.
    """

    target: str
    box_px: tuple[int, int, int, int]
    reason: Refusal


@dataclass(frozen=True, eq=False)
class Located:
    """An object that was found, and where.

    Attributes:
        target: name of the target.
        box_px: the colour frame (u, v, width, height) [px].
        outline_px: the depth frame (left, top, right, bottom) of the measured outline [px].
        depth_m: distance of the object's centre along the optical axis [m].
        depth_sigma_m: its standard deviation [m].
        p_camera: centre in the optical frame, shape (3,) [m].
        p_base: centre in the base frame, shape (3,) [m].
        covariance_base: covariance of ``p_base``, shape (3, 3) [m^2].
        budget: what that is made of, by cause, shape (3, 3) each [m^2].
    """

    target: str
    box_px: tuple[int, int, int, int]
    outline_px: tuple[float, float, float, float]
    depth_m: float
    depth_sigma_m: float
    p_camera: Array
    p_base: Array
    covariance_base: Array
    budget: Mapping[Cause, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("p_camera", "p_base"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), 3, name=name))
        covariance = frozen_array(self.covariance_base, 3, 3, name="covariance_base")
        object.__setattr__(self, "covariance_base", covariance)
        parts = {it: frozen_array(c, 3, 3, name=it.name) for it, c in self.budget.items()}
        object.__setattr__(self, "budget", MappingProxyType(parts))

    def __reduce__(self) -> tuple[Callable[[], Located], tuple[()]]:
        """Let a process send it to another one; a mapping's read-only view cannot be pickled."""
        values = {it.name: getattr(self, it.name) for it in fields(self)}
        return partial(Located, **{**values, "budget": dict(self.budget)}), ()

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the point in its least certain direction [m]."""
        return math.sqrt(max(float(np.linalg.eigvalsh(self.covariance_base)[-1]), 0.0))

    def judge(self, limit_m: float) -> Verdict:
        """Decide whether the point is certain enough to act on, and say what would help.

        Args:
            limit_m: the most that ``sigma_m`` may be [m].

        Raises:
            InputError: the limit is not above 0.
        """
        return judge(self.budget or {Cause.EDGE: self.covariance_base}, limit_m)


@dataclass(frozen=True)
class View:
    """All that the eye made of one picture.

    Attributes:
        located: the objects that were measured, the largest first.
        refused: patches of a target's colour that were not, and why.
    """

    located: tuple[Located, ...]
    refused: tuple[Refused, ...]


def look(
    image: NDArray[np.generic],
    camera: Camera,
    targets: Iterable[ColourTarget] | Mapping[str, ColourTarget],
    settings: BlobSettings | None = None,
    *,
    table: Table | None = None,
) -> View:
    """Find and measure every object of the targets' colours.

    Args:
        image: BGR picture of the camera's size, shape (h, w, 3), uint8.
        camera: the camera that took it.
        targets: what to look for.
        settings: how pixels become blobs.
        table: what solids stand on, which makes their places more certain, and refuses what does
            not stand there; without it they may be anywhere.

    Returns:
        What was located and what was refused, each with the largest patches first.

    Raises:
        InputError: the picture is not one, or not of the camera's size.
    """
    wanted = tuple(targets.values() if isinstance(targets, Mapping) else targets)
    picture, found = patches(image, camera, wanted, settings)
    results = [locate(picture, camera, blob, target, table) for blob, target in found]
    return View(
        tuple(result for result in results if isinstance(result, Located)),
        tuple(result for result in results if isinstance(result, Refused)),
    )


def patches(
    image: NDArray[np.generic],
    camera: Camera,
    targets: Sequence[ColourTarget],
    settings: BlobSettings | None = None,
) -> tuple[Image, list[tuple[Blob, ColourTarget]]]:
    """Find the patches of the targets' colours in a picture of the camera's size.

    Returns:
        The picture, checked, and each patch with its target, the largest first.

    Raises:
        InputError: the picture is not one, or not of the camera's size.
    """
    picture = check_image(image)
    height, width = picture.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise InputError(
            f"the picture is {width} x {height} px and the camera is calibrated for "
            f"{camera.width} x {camera.height}; take the picture at that size, or calibrate anew"
        )
    blobs = find_colours(picture, [target.hsv for target in targets], settings)
    found = [(blob, it) for it, mine in zip(targets, blobs, strict=True) for blob in mine]
    return picture, sorted(found, key=lambda pair: -pair[0].area_px)


def see(
    image: NDArray[np.generic],
    camera: Camera,
    targets: Iterable[ColourTarget] | Mapping[str, ColourTarget],
    settings: BlobSettings | None = None,
    *,
    table: Table | None = None,
) -> tuple[Located, ...]:
    """Return the objects that ``look`` locates, the largest first."""
    return look(image, camera, targets, settings, table=table).located


def locate(
    image: Image, camera: Camera, blob: Blob, target: ColourTarget, table: Table | None = None
) -> Located | Refused:
    """Measure one blob.

    Args:
        image: BGR picture, shape (h, w, 3).
        camera: the camera that took it.
        blob: a patch of the target's colour in it.
        target: what the patch is taken for.
        table: what it stands on, if it does.

    Returns:
        Where its centre is, or why that cannot be said.
    """
    if blob.touches_border:
        return Refused(target.name, blob.box_px, Refusal.BORDER)
    points = trace(image, blob, camera.gamma)
    if points is None:
        return Refused(target.name, blob.box_px, Refusal.THIN)
    found = place(
        camera.rays(points),
        target.shape,
        target.width_m,
        1 / camera.focal_px[0],
        camera.up,
        edge_sigma(camera.gamma),
    )
    if isinstance(found, Refusal):
        return Refused(target.name, blob.box_px, found)
    budget = causes(found, camera, target.width_sigma_m / target.width_m)
    stood = stand(found, budget, camera, table)
    if stood is None:
        return Refused(target.name, blob.box_px, Refusal.AFLOAT)
    p_camera = stood.p_camera
    covariance = np.sum(list(stood.budget.values()), axis=0)
    rotation = camera.transform_base_camera[:3, :3]
    left, top = points.min(axis=0)
    right, bottom = points.max(axis=0)
    return Located(
        target=target.name,
        box_px=blob.box_px,
        outline_px=(float(left), float(top), float(right), float(bottom)),
        depth_m=float(p_camera[2]),
        depth_sigma_m=math.sqrt(float(covariance[2, 2])),
        p_camera=p_camera,
        p_base=camera.to_base(p_camera),
        covariance_base=rotation @ covariance @ rotation.T,
        budget={it: rotation @ part @ rotation.T for it, part in stood.budget.items()},
    )
