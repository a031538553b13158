"""Colour recognition, the chain of the paper's Fig. 2: blur, HSV, threshold, dilate, contour, box.

There is no erosion. Dilation closes small gaps so that one object gives one contour, and it grows
a blob by a known number of pixels, which the box takes off again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from arm3dof.errors import InputError

Image = NDArray[np.uint8]
Planes = Sequence[Image]
"""Hue, saturation and value of a picture, each of shape (h, w)."""
Shape = Literal["flat", "ball", "cylinder", "cube", "bottle"]
SHAPES: tuple[Shape, ...] = get_args(Shape)

# half the width of a streak, as a share of the square root of a patch's area
_STREAK = 0.035
# a patch that would lose more than the rest of this share is left as it is
_MOST = 0.7
_CHANNELS = (("hue", 179), ("saturation", 255), ("value", 255))


@dataclass(frozen=True)
class HsvRange:
    """Six bounds on colour in OpenCV's units: hue 0 to 179 (half degrees), the others 0 to 255.

    Bounds are inclusive. A low hue above the high hue wraps around red: (170, ...) to (10, ...)
    holds the hues 170 to 179 and 0 to 10.

    Attributes:
        low: least (hue, saturation, value).
        high: greatest (hue, saturation, value).

    Raises:
        InputError: a bound is no whole number in its range, or saturation or value is empty.
    """

    low: tuple[int, int, int]
    high: tuple[int, int, int]

    def __post_init__(self) -> None:
        for side in ("low", "high"):
            bounds = tuple(getattr(self, side))
            if len(bounds) != 3:
                raise InputError(f"hsv_{side} is {list(bounds)}; give hue, saturation and value")
            for (channel, top), bound in zip(_CHANNELS, bounds, strict=True):
                if bound != int(bound) or not 0 <= bound <= top:
                    half = " (OpenCV counts half degrees)" if channel == "hue" else ""
                    raise InputError(
                        f"hsv_{side} has {channel} {bound}; give a whole number from 0 to {top}"
                        + half
                    )
            object.__setattr__(self, side, tuple(int(bound) for bound in bounds))
        for index in (1, 2):
            if self.low[index] > self.high[index]:
                raise InputError(
                    f"hsv_low has {_CHANNELS[index][0]} {self.low[index]} above hsv_high's "
                    f"{self.high[index]}; swap them (only hue wraps around)"
                )

    @property
    def wraps(self) -> bool:
        """Whether the hues run through 0, as those of red do."""
        return self.low[0] > self.high[0]

    def mask(self, hsv: Image) -> Image:
        """Mark the pixels inside the bounds.

        Args:
            hsv: picture in OpenCV's HSV, shape (h, w, 3).

        Returns:
            255 inside and 0 outside, shape (h, w).
        """
        return self.mask_of(cv2.split(hsv))

    def mask_of(self, planes: Planes) -> Image:
        """Do what ``mask`` does from hue, saturation and value apart: quicker for many colours."""
        hue, saturation, value = planes
        if self.wraps:
            inside = cv2.bitwise_not(cv2.inRange(hue, self.high[0] + 1, self.low[0] - 1))
        else:
            inside = cv2.inRange(hue, self.low[0], self.high[0])
        for plane, low, high in zip((saturation, value), self.low[1:], self.high[1:], strict=True):
            cv2.bitwise_and(inside, cv2.inRange(plane, low, high), dst=inside)
        return np.asarray(inside, dtype=np.uint8)


@dataclass(frozen=True)
class ColourTarget:
    """A kind of object that the eye knows: its colour and its true width.

    Attributes:
        name: what the object is called.
        hsv: the colours that belong to it.
        width_m: its width across the line of sight: of a ball, cylinder or bottle the diameter, of
            a cube the edge [m].
        shape: ``"flat"`` measures as the paper does, for a face parallel to the picture; a
            ``"ball"``, and an upright ``"cylinder"``, ``"cube"`` or ``"bottle"``, is placed by
            its silhouette.
        width_sigma_m: standard deviation of ``width_m`` [m].

    Raises:
        InputError: the name is empty, a width cannot be one, or the shape is unknown.
    """

    name: str
    hsv: HsvRange
    width_m: float
    shape: Shape = "flat"
    width_sigma_m: float = 0.0

    def __post_init__(self) -> None:
        if not self.name:
            raise InputError("a target has no name; name it after its colour")
        if not (math.isfinite(self.width_m) and self.width_m > 0):
            raise InputError(f"width_m of '{self.name}' is {self.width_m}; give metres above 0")
        if not (math.isfinite(self.width_sigma_m) and self.width_sigma_m >= 0):
            raise InputError(
                f"width_sigma_m of '{self.name}' is {self.width_sigma_m}; give metres, 0 or more"
            )
        if self.shape not in SHAPES:
            raise InputError(
                f"shape of '{self.name}' is '{self.shape}'; give one of: " + ", ".join(SHAPES)
            )


@dataclass(frozen=True)
class BlobSettings:
    """How pixels become blobs.

    Attributes:
        blur_px: side of the Gaussian that quiets noise before the threshold, odd [px].
        dilate_px: how far dilation grows the mask to each side [px].
        min_area_px: smaller blobs are taken for noise [px^2].

    Raises:
        InputError: a setting is out of range.
    """

    blur_px: int = 5
    dilate_px: int = 2
    min_area_px: float = 100.0

    def __post_init__(self) -> None:
        if self.blur_px < 1 or self.blur_px % 2 == 0:
            raise InputError(f"blur_px is {self.blur_px}; give an odd number, 1 for no blur")
        if self.dilate_px < 0:
            raise InputError(f"dilate_px is {self.dilate_px}; give 0 or more")
        if not self.min_area_px >= 0:
            raise InputError(f"min_area_px is {self.min_area_px}; give 0 or more")


@dataclass(frozen=True, eq=False)
class Blob:
    """A patch of one colour.

    Attributes:
        box_px: the colour frame (u, v, width, height), without the growth by dilation [px].
        area_px: pixels inside its outline [px^2].
        contour: its outline, without the growth by dilation, shape (n, 2) of (u, v) [px].
        touches_border: whether the patch may go on outside the picture.
    """

    box_px: tuple[int, int, int, int]
    area_px: float
    contour: NDArray[np.int32]
    touches_border: bool


def check_image(image: NDArray[np.generic]) -> Image:
    """Refuse an array that is not a BGR picture.

    Args:
        image: shape (h, w, 3), uint8.

    Returns:
        The same picture, its rows contiguous in memory.

    Raises:
        InputError: the array has another shape or type, or no pixels.
    """
    right_form = isinstance(image, np.ndarray) and image.dtype == np.uint8 and image.ndim == 3
    if not right_form or image.shape[2] != 3 or image.size == 0:
        have = (
            f"shape {image.shape} and type {image.dtype}"
            if isinstance(image, np.ndarray)
            else f"a {type(image).__name__}"
        )
        raise InputError(
            f"the picture has {have}; give BGR bytes of shape (height, width, 3), "
            "for instance from read_image"
        )
    return np.ascontiguousarray(image, dtype=np.uint8)


def blurred_hsv(image: Image, blur_px: int = 5) -> Image:
    """Blur a BGR picture and turn it into OpenCV's HSV; both have shape (h, w, 3)."""
    quiet = cv2.GaussianBlur(image, (blur_px, blur_px), 0) if blur_px > 1 else image
    return np.asarray(cv2.cvtColor(quiet, cv2.COLOR_BGR2HSV), dtype=np.uint8)


def hsv_planes(image: Image, blur_px: int = 5) -> Planes:
    """Blur a BGR picture, shape (h, w, 3), and return its hue, saturation and value apart."""
    return cv2.split(blurred_hsv(image, blur_px))


def find_blobs(
    image: NDArray[np.generic], hsv_range: HsvRange, settings: BlobSettings | None = None
) -> tuple[Blob, ...]:
    """Find the patches of one colour, the largest first.

    Args:
        image: BGR picture, shape (h, w, 3), uint8.
        hsv_range: the colour.
        settings: how pixels become blobs.

    Raises:
        InputError: ``image`` is not a BGR picture.
    """
    return find_colours(image, [hsv_range], settings)[0]


def find_colours(
    image: NDArray[np.generic],
    hsv_ranges: Iterable[HsvRange],
    settings: BlobSettings | None = None,
) -> tuple[tuple[Blob, ...], ...]:
    """Find the patches of several colours, which share the blur and the conversion.

    Args:
        image: BGR picture, shape (h, w, 3), uint8.
        hsv_ranges: the colours.
        settings: how pixels become blobs.

    Returns:
        The patches of each colour, the largest first.

    Raises:
        InputError: ``image`` is not a BGR picture.
    """
    settings = settings or BlobSettings()
    planes = hsv_planes(check_image(image), settings.blur_px)
    return tuple(blobs_in(planes, it, settings) for it in hsv_ranges)


def blobs_in(planes: Planes, hsv_range: HsvRange, settings: BlobSettings) -> tuple[Blob, ...]:
    """Do what ``find_blobs`` does from the planes of a picture."""
    mask = hsv_range.mask_of(planes)
    if settings.dilate_px:
        mask = np.asarray(cv2.dilate(mask, _square(settings.dilate_px)), dtype=np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    blobs = (
        _blob(contour, mask.shape, settings.dilate_px)
        for contour in contours
        if len(contour) > 3 and cv2.contourArea(contour) >= settings.min_area_px
    )
    kept = [blob for blob in blobs if blob and blob.area_px >= settings.min_area_px]
    return tuple(sorted(kept, key=lambda blob: -blob.area_px))


def fill(contour: NDArray[np.int32], window: tuple[int, int, int, int]) -> Image:
    """Fill an outline.

    Args:
        contour: shape (n, 2) of (u, v) [px].
        window: the part of the picture (u, v, width, height) that the result covers [px].

    Returns:
        255 inside and on the outline and 0 outside, shape (height, width) of the window.
    """
    u, v, width, height = window
    filled = np.zeros((height, width), dtype=np.uint8)
    cv2.drawContours(filled, [contour], -1, 255, cv2.FILLED, offset=(-u, -v))
    return filled


def _blob(contour: NDArray[np.int32], shape: tuple[int, ...], grown: int) -> Blob | None:
    """Take the growth by dilation off a contour, and streaks that hang on to the patch.

    Nothing is left of a thread that runs along the border.
    """
    height, width = shape[:2]
    window = cv2.boundingRect(contour)
    body = fill(contour, window)
    if grown:
        body = _eroded(body, _square(grown))
    body = _without_streaks(body)
    outlines, _ = cv2.findContours(
        body, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE, offset=window[:2]
    )
    if not outlines:
        return None
    outline = np.asarray(max(outlines, key=cv2.contourArea), dtype=np.int32).reshape(-1, 2)
    outline.flags.writeable = False
    left, top = outline.min(axis=0).tolist()
    right, bottom = (outline.max(axis=0) + 1).tolist()
    # nothing tells a patch that ends within the growth of the border from one that goes on
    at_border = (left <= grown, top <= grown, right >= width - grown, bottom >= height - grown)
    left, top = (0 if at_border[0] else left), (0 if at_border[1] else top)
    right, bottom = (width if at_border[2] else right), (height if at_border[3] else bottom)
    area = float(np.count_nonzero(fill(outline, window)))
    return Blob((left, top, right - left, bottom - top), area, outline, any(at_border))


def _without_streaks(body: Image) -> Image:
    """Cut off streaks much thinner than the patch: reflections and stains of its colour."""
    area = cv2.countNonZero(body)
    radius = round(_STREAK * math.sqrt(area))
    if radius < 2:
        return body
    tool = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    core = _eroded(body, tool)
    outlines, _ = cv2.findContours(core, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not outlines:
        return body
    if len(outlines) > 1:
        core = fill(max(outlines, key=cv2.contourArea), (0, 0, core.shape[1], core.shape[0]))
    # what lies within a radius of the core's reach, corners among it, stays
    kept = cv2.bitwise_and(body, cv2.dilate(core, tool, iterations=2))
    return np.asarray(kept if cv2.countNonZero(kept) > _MOST * area else body, dtype=np.uint8)


def _eroded(mask: Image, tool: Image) -> Image:
    result = cv2.erode(mask, tool, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return np.asarray(result, dtype=np.uint8)


def _square(radius: int) -> Image:
    return np.ones((2 * radius + 1, 2 * radius + 1), dtype=np.uint8)
