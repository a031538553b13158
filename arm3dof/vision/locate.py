"""From a blob's width to depth, to a point in the base frame, and to how far off it may be."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
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
    HsvRange,
    Image,
    Shape,
    check_image,
    find_blobs,
    find_colours,
)
from arm3dof.vision.outline import extent, trace
from arm3dof.vision.placing import LEAST_PX, Refusal, place

# what light and shade do to an edge beyond the noise that shows in it [px]
_EDGE_SIGMA_PX = 0.11
_KNOWN_EDGE_SIGMA_PX = 0.065  # where the camera's gamma is known


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


@dataclass(frozen=True)
class FocalReference:
    """A focal length from one reference picture, by (1).

    Attributes:
        focal_px: focal length [px].
        sigma_px: its standard deviation from the measured width alone [px].
        width_px: measured width of the object [px].
        box_px: its colour frame (u, v, width, height) [px].
    """

    focal_px: float
    sigma_px: float
    width_px: float
    box_px: tuple[int, int, int, int]


def focal_length(
    width_px: float, distance_m: float, width_m: float, shape: Shape = "flat"
) -> float:
    """Compute the focal length from one known view, F = P D / W, equation (1).

    Args:
        width_px: measured width P [px].
        distance_m: distance D along the optical axis, to the centre of what is round [m].
        width_m: true width W [m].
        shape: for a ball or a cylinder W is the width of the silhouette,
            W / sqrt(1 - (W / 2D)^2).

    Returns:
        Focal length F [px].

    Raises:
        InputError: a length is not positive, or the camera would be inside the object.
    """
    silhouette = _silhouette(width_px, distance_m, width_m, shape)
    return width_px * distance_m / silhouette


def depth_from_width(width_px: float, focal_px: float, width_m: float) -> float:
    """Compute a flat object's depth from its width in the picture, D' = W' F / P, equation (2).

    Args:
        width_px: measured width P [px].
        focal_px: focal length F [px].
        width_m: true width W' [m].

    Returns:
        Depth D' [m].

    Raises:
        InputError: a length is not positive.
    """
    _require_positive(width_px=width_px, focal_px=focal_px, width_m=width_m)
    return width_m * focal_px / width_px


def focal_from_picture(
    image: NDArray[np.generic],
    hsv_range: HsvRange,
    distance_m: float,
    width_m: float,
    *,
    shape: Shape = "flat",
    settings: BlobSettings | None = None,
) -> FocalReference | None:
    """Measure the focal length from a picture of one object at a known distance.

    The object is the largest patch of the colour that does not touch the border.

    Args:
        image: BGR picture, shape (h, w, 3), uint8.
        hsv_range: the object's colour.
        distance_m: distance along the optical axis [m].
        width_m: true width [m].
        shape: what ``width_m`` is the width of, as in ``ColourTarget``.
        settings: how pixels become blobs.

    Returns:
        The reference, or None when no whole object of the colour is seen.

    Raises:
        InputError: the picture is not one, or a length is not positive.
    """
    picture = check_image(image)
    _silhouette(1.0, distance_m, width_m, shape)
    for blob in find_blobs(picture, hsv_range, settings):
        points = None if blob.touches_border else trace(picture, blob)
        if points is not None:
            width = extent(points[:, 0], points[:, 1], 1.0)
            if width.size < LEAST_PX:
                continue
            focal = focal_length(width.size, distance_m, width_m, shape)
            sigma = focal * math.sqrt(2) * math.hypot(width.sigma, _EDGE_SIGMA_PX) / width.size
            return FocalReference(focal, sigma, width.size, blob.box_px)
    return None


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
    picture = check_image(image)
    height, width = picture.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise InputError(
            f"the picture is {width} x {height} px and the camera is calibrated for "
            f"{camera.width} x {camera.height}; take the picture at that size, or calibrate anew"
        )
    wanted = tuple(targets.values() if isinstance(targets, Mapping) else targets)
    blobs = find_colours(picture, [target.hsv for target in wanted], settings)
    found = [(blob, it) for it, mine in zip(wanted, blobs, strict=True) for blob in mine]
    found.sort(key=lambda pair: -pair[0].area_px)
    results = [locate(picture, camera, blob, target, table) for blob, target in found]
    return View(
        tuple(result for result in results if isinstance(result, Located)),
        tuple(result for result in results if isinstance(result, Refused)),
    )


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
        _EDGE_SIGMA_PX if camera.gamma is None else _KNOWN_EDGE_SIGMA_PX,
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


def _silhouette(width_px: float, distance_m: float, width_m: float, shape: Shape) -> float:
    """Return the width of a flat thing at the same distance that looks as wide."""
    _require_positive(width_px=width_px, distance_m=distance_m, width_m=width_m)
    if shape == "flat":
        return width_m
    sine = width_m / 2 / distance_m
    if sine >= 1:
        raise InputError(
            f"distance_m is {distance_m} and width_m is {width_m}; "
            "give the distance to the object's centre, which is more than half its width"
        )
    return width_m / math.sqrt(1 - sine * sine)


def _require_positive(**lengths: float) -> None:
    for name, value in lengths.items():
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name} is {value}; give a finite length above 0")
