"""The focal length from one picture of a thing whose width and distance are known, (1) and (2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arm3dof.errors import InputError
from arm3dof.vision.colour import BlobSettings, HsvRange, Shape, check_image, find_blobs
from arm3dof.vision.outline import extent, trace
from arm3dof.vision.placing import LEAST_PX

_EDGE_SIGMA_PX = 0.18  # what light and shade do to an edge beyond the noise that shows in it


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
