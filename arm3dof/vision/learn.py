"""A colour learned from one click on a thing, or from a box drawn inside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from arm3dof.errors import InputError
from arm3dof.vision.colour import (
    Blob,
    BlobSettings,
    HsvRange,
    Image,
    Planes,
    blobs_in,
    check_image,
    hsv_planes,
)

_SEED = 3  # a click speaks for the pixels this near [px]
_LEAST_SATURATION, _LEAST_VALUE = 45, 25
# how far a pixel may be from the colour so far and still belong to the thing
_HUES, _SATURATIONS, _DARKER = 10, 90, 0.3
# how much of these tolerances and margins is tried in turn, until the patch ends before the border
_ATTEMPTS = ((1.0, 1.0), (0.7, 1.0), (0.7, 0.4), (0.5, 1.0), (0.5, 0.4), (0.35, 0.0))
_ROUNDS = 3
# what the bounds hold of the thing, and what is added for other light [OpenCV's units]
_TAILS = (1.0, 99.0)
_HUE_MARGIN, _SATURATION_MARGIN, _VALUE_MARGIN = 3, 30, 30
_FEWEST = 12  # pixels that a colour can be learned from


@dataclass(frozen=True, eq=False)
class LearnedColour:
    """A colour, and the thing that it was learned from.

    Attributes:
        hsv: the bounds.
        blob: the patch of that colour at the place that was shown.
        others: how many other patches of it are in the picture.
    """

    hsv: HsvRange
    blob: Blob
    others: int


def learn_colour(
    picture: NDArray[np.generic], place: Sequence[int], settings: BlobSettings | None = None
) -> LearnedColour:
    """Learn the colour of a thing.

    The thing is what is connected to the place and has its hue, however shaded; the bounds hold
    nearly all of it and leave a margin for other light.

    Args:
        picture: BGR picture, shape (h, w, 3), uint8.
        place: a point (u, v) on the thing, or a box (u, v, width, height) inside it [px].
        settings: how pixels become patches.

    Raises:
        InputError: the picture is not one, the place is outside it, or what is there is grey, dark
            or too small.
    """
    image = check_image(picture)
    settings = settings or BlobSettings()
    u, v, width, height = _box(place, image)
    planes = hsv_planes(image, settings.blur_px)
    seed = np.zeros(image.shape[:2], np.uint8)
    seed[v : v + height, u : u + width] = 255
    first = None
    for tolerance, margin in _ATTEMPTS:
        learned = _attempt(planes, seed, tolerance, margin, settings)
        if learned is not None and not learned.blob.touches_border:
            return learned
        first = first or learned
    if first is None:
        raise InputError(
            f"what is at {list(place)} is smaller than {settings.min_area_px:g} pixels; "
            "show a larger thing"
        )
    return first


def _attempt(
    planes: Planes, seed: Image, tolerance: float, margin: float, settings: BlobSettings
) -> LearnedColour | None:
    """Learn the colour of what the seed grows to; None when no patch of it is there."""
    region = seed
    for _ in range(_ROUNDS):
        region = _grown(planes, region, seed, tolerance)
    hsv = _bounds(planes, region, margin)
    patches = blobs_in(planes, hsv, settings)
    mine = [it for it in patches if _meets(it, cv2.boundingRect(seed))]
    return LearnedColour(hsv, mine[0], len(patches) - 1) if mine else None


def _box(place: Sequence[int], image: Image) -> tuple[int, int, int, int]:
    """Return the box that is meant, cut to the picture."""
    rows, columns = image.shape[:2]
    if len(place) not in (2, 4) or any(value != int(value) for value in place):
        raise InputError(f"place is {list(place)}; give a point u, v or a box u, v, width, height")
    u, v = int(place[0]), int(place[1])
    if not (0 <= u < columns and 0 <= v < rows):
        raise InputError(f"({u}, {v}) is outside the picture of {columns} x {rows} px")
    if len(place) == 2:
        left, top = max(u - _SEED, 0), max(v - _SEED, 0)
        return left, top, min(u + _SEED + 1, columns) - left, min(v + _SEED + 1, rows) - top
    width, height = min(int(place[2]), columns - u), min(int(place[3]), rows - v)
    if width < 1 or height < 1:
        raise InputError(f"the box {list(place)} is empty; give a width and a height of 1 or more")
    return u, v, width, height


def _grown(planes: Planes, region: Image, seed: Image, tolerance: float) -> Image:
    """Return what is connected to the seed and has the colour of a region."""
    hue, saturation, value = (plane[region > 0].astype(np.float64) for plane in planes)
    vivid = (saturation >= _LEAST_SATURATION) & (value >= _LEAST_VALUE)
    if np.count_nonzero(vivid) < min(_FEWEST, len(hue)) or not vivid.any():
        raise InputError(
            f"what is there is grey or dark (saturation {np.median(saturation):.0f}, "
            f"value {np.median(value):.0f}); show a vivid part, or use more light"
        )
    middle = _middle_hue(hue[vivid])
    usual = float(np.median(saturation[vivid])), float(np.median(value[vivid]))
    hues, darker = round(tolerance * _HUES), 1 - tolerance * (1 - _DARKER)
    near = HsvRange(
        (
            (middle - hues) % 180,
            max(round(usual[0] - tolerance * _SATURATIONS), _LEAST_SATURATION),
            max(round(darker * usual[1]), _LEAST_VALUE),
        ),
        ((middle + hues) % 180, 255, 255),
    ).mask_of(planes)
    _, labels = cv2.connectedComponents(near, connectivity=8)
    touched = labels[(seed > 0) & (near > 0)]
    if touched.size == 0:
        return seed
    chosen = np.isin(labels, np.unique(touched))
    return np.asarray(chosen, dtype=np.uint8) * np.uint8(255)


def _bounds(planes: Planes, region: Image, margin: float) -> HsvRange:
    """Return bounds that hold a region, its rim left out, with a share of the margins."""
    core = cv2.erode(region, np.ones((3, 3), np.uint8))
    inside = core > 0 if np.count_nonzero(core) >= _FEWEST else region > 0
    hue, saturation, value = (plane[inside].astype(np.float64) for plane in planes)
    middle = _middle_hue(hue)
    low, high = np.percentile((hue - middle + 90) % 180 - 90, _TAILS)
    return HsvRange(
        (
            round(middle + low - margin * _HUE_MARGIN) % 180,
            max(round(np.percentile(saturation, _TAILS[0]) - margin * _SATURATION_MARGIN), 30),
            max(round(np.percentile(value, _TAILS[0]) - margin * _VALUE_MARGIN), 15),
        ),
        (round(middle + high + margin * _HUE_MARGIN) % 180, 255, 255),
    )


def _middle_hue(hue: NDArray[np.float64]) -> int:
    """Return the hue in the middle of some, on their circle."""
    turn = np.exp(1j * np.pi * hue / 90)
    mean = float(np.angle(turn.mean())) * 90 / np.pi
    middle: float = mean + float(np.median((hue - mean + 90) % 180 - 90))
    return round(middle) % 180


def _meets(blob: Blob, box: tuple[int, int, int, int]) -> bool:
    """Whether the middle of a box lies in a patch, or nearly."""
    u, v, width, height = box
    point = (u + (width - 1) / 2, v + (height - 1) / 2)
    contour = blob.contour.reshape(-1, 1, 2)
    return cv2.pointPolygonTest(contour, point, measureDist=True) > -max(width, height, 6)
