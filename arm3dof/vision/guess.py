"""What to take for granted about a picture that nobody has calibrated.

One picture cannot tell a small thing nearby from a large one far away, nor what its lens was.
These guesses make any photograph usable for a demonstration; a measured camera and a true width
make it a measurement.
"""

from __future__ import annotations

from itertools import product

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import (
    Blob,
    BlobSettings,
    HsvRange,
    Image,
    blobs_in,
    check_image,
    find_blobs,
    hsv_planes,
)

FOCAL_SHARE = 1.1
"""Focal length over the picture's longer side: an ordinary lens, 49 degrees wide."""
DISTANCE = 0.2
"""How far from the lens an object of unknown width is taken to stand [m]."""

_HUES = range(0, 180, 6)
_HALF_WIDTHS = (6, 10)  # [OpenCV's hue]
_SATURATIONS = (90, 140, 190)
_LEAST_VALUE = 60
_SIDE = 640  # larger pictures are shrunk to this before the search [px]
_LEAST_SHARE = 0.004  # of the picture that an object fills


def guess_camera(image: NDArray[np.generic], transform_base_camera: ArrayLike) -> Camera:
    """Return an ordinary camera of the picture's size at a given pose.

    Args:
        image: BGR picture, shape (h, w, 3), uint8.
        transform_base_camera: the pose, shape (4, 4).

    Raises:
        InputError: ``image`` is not a BGR picture.
    """
    height, width = check_image(image).shape[:2]
    return Camera.pinhole(width, height, FOCAL_SHARE * max(width, height), transform_base_camera)


def guess_colour(image: NDArray[np.generic]) -> HsvRange | None:
    """Find the colour of the most conspicuous object: its largest, most compact whole patch.

    A patch that touches the border is background, or not seen whole, and does not count. A patch
    is worth its area times the square of its solidity (its share of its convex hull).

    Args:
        image: BGR picture, shape (h, w, 3), uint8.

    Returns:
        The colour, or None when no vivid object lies inside the picture.

    Raises:
        InputError: ``image`` is not a BGR picture.
    """
    planes = hsv_planes(_shrunk(check_image(image)))
    settings = BlobSettings(min_area_px=_LEAST_SHARE * planes[0].size)
    best, best_worth = None, 0.0
    for hue, half, saturation in product(_HUES, _HALF_WIDTHS, _SATURATIONS):
        low = ((hue - half) % 180, saturation, _LEAST_VALUE)
        colour = HsvRange(low, ((hue + half) % 180, 255, 255))
        for blob in blobs_in(planes, colour, settings):
            if not blob.touches_border and (worth := _worth(blob)) > best_worth:
                best, best_worth = colour, worth
    return best


def guess_width(
    image: NDArray[np.generic], camera: Camera, hsv: HsvRange, distance_m: float = DISTANCE
) -> float | None:
    """Return how wide the largest whole patch of a colour is if it stands at a distance, by (2).

    Args:
        image: BGR picture, shape (h, w, 3), uint8.
        camera: the camera that took it.
        hsv: the colour.
        distance_m: distance along the optical axis [m].

    Returns:
        Width [m], or None when no whole patch is seen.

    Raises:
        InputError: ``image`` is not a BGR picture.
    """
    for blob in find_blobs(image, hsv):
        if not blob.touches_border:
            return blob.box_px[2] * distance_m / camera.focal_px[0]
    return None


def _shrunk(picture: Image) -> Image:
    height, width = picture.shape[:2]
    scale = _SIDE / max(height, width)
    if scale >= 1:
        return picture
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return check_image(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))


def _worth(blob: Blob) -> float:
    hull = cv2.contourArea(cv2.convexHull(blob.contour.reshape(-1, 1, 2)))
    return blob.area_px * float(blob.area_px / max(hull, blob.area_px)) ** 2
