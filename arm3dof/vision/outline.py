"""Outlines to a fraction of a pixel.

The mask of a threshold lies a pixel or two inside or outside the true edge, wherever the bounds
and the light happen to put it. Here the edge is found anew from the colours on both its sides: a
pixel on the edge is a mixture of the two, and the outline runs where the mixture is half and half.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from arm3dof.state import Array
from arm3dof.vision.colour import Blob, Image, fill

# the true edge is looked for this far inside and outside the mask's edge [px]
_INSIDE, _OUTSIDE = 2, 3
# colours are carried this far, wide enough to span the band, and the nearest count most [px]
_REACH, _NEARNESS = 7, 2.0
SURROUNDINGS = _OUTSIDE + 2 * _REACH
"""How much around a blob's box has a share in its outline [px]."""
# noise of a pixel's light, 0 to 1, and how much light and shade vary near an edge
_LIGHT_SIGMA, _SHADE_SIGMA = 0.006, 0.6
# below this the two colours are one and the mixture says nothing
_LEAST_DETERMINANT = 1e-7
# an end of the outline needs this many points, none of them further from its parabola
_FEWEST, _TRIM_PX = 5, 0.5
# and this share of the outline's length along the end
_SUPPORT = 0.1
# noise throws a point of the outline this far out [px]
_THROW_PX = 1.5
# a point this much further from the mask's edge than its neighbours is stray [px]
_BUMP_PX = 1.25
# A lens mixes light, which cameras encode with a gamma of 2.2; renderers often mix the codes, with
# a gamma of 1. Halfway, either is wrong by a quarter of a pixel at most.
_HALFWAY = 1.5

Bits = NDArray[np.bool_]
Floats = NDArray[np.float32]


class Extent(NamedTuple):
    """Where an outline begins and ends along one direction, in the unit of its points."""

    low: float
    high: float
    sigma: float

    @property
    def middle(self) -> float:
        """The mean of both ends."""
        return (self.low + self.high) / 2

    @property
    def size(self) -> float:
        """The distance between both ends."""
        return self.high - self.low


def trace(image: Image, blob: Blob, gamma: float | None = None) -> Array | None:
    """Find the outline of a blob to a fraction of a pixel.

    Args:
        image: BGR picture, shape (h, w, 3).
        blob: a patch that was found in it.
        gamma: how the camera encodes light; halfway between the usual ones when not known.

    Returns:
        Points (u, v) on the outline, shape (n, 2) [px], in no particular order; None where the
        patch is too thin to have an inside.
    """
    pad = SURROUNDINGS
    u, v, w, h = blob.box_px
    left, top = max(u - pad, 0), max(v - pad, 0)
    right = min(u + w + pad, image.shape[1])
    bottom = min(v + h + pad, image.shape[0])
    body = fill(blob.contour, (left, top, right - left, bottom - top))
    cover = _coverage(_light(gamma or _HALFWAY)[image[top:bottom, left:right]], body)
    if cover is None:
        return None
    points = _crossings(cover, _largest_filled(cover >= 0.5))
    return points[_smooth(points, body)] + np.array([left, top], dtype=np.float64)


def extent(across: Array, along: Array, pixel: float) -> Extent:
    """Measure how far an outline reaches in one direction.

    Near each end a parabola is laid through the outline's points, so that the noise of one
    pixel does not decide the width, and neither a round nor a straight side is cut short.

    Args:
        across: the points' coordinates in the direction to measure, shape (n,).
        along: their coordinates in the other direction, shape (n,).
        pixel: the size of a pixel in the unit of ``across``.
    """
    low, noise_low = _end(across, along, pixel)
    high, noise_high = _end(-across, along, pixel)
    return Extent(low, -high, float(np.hypot(noise_low, noise_high) / np.sqrt(2)))


@lru_cache(maxsize=8)
def _light(gamma: float) -> Floats:
    """Return the light, 0 to 1, that each code of a camera stands for, shape (256,)."""
    return np.asarray(np.linspace(0.0, 1.0, 256) ** gamma, dtype=np.float32)


def _coverage(pixels: Floats, body: Image) -> Array | None:
    """Estimate how much of each pixel the object covers, shape (h, w), 0 to 1.

    A pixel's light is taken for a f + b g, with the colours f of the object and g of what lies
    behind it near by. Shade scales f and shadow scales g, so neither a nor b says much, but
    a / (a + b) does. Where f and g differ in brightness alone, a + b = 1 must help.
    """
    core = cv2.erode(body, _disc(_INSIDE), borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0
    outer = cv2.dilate(body, _disc(_OUTSIDE)) == 0
    if not core.any():
        return None
    f, known_f = _spread(pixels, core)
    g, known_g = _spread(pixels, outer)
    quiet = cv2.GaussianBlur(pixels, (3, 3), 0)
    weight = np.float32((_LIGHT_SIGMA / _SHADE_SIGMA) ** 2)
    ff, gg, fg = _dot(f, f) + weight, _dot(g, g) + weight, _dot(f, g) + weight
    fi, gi = _dot(f, quiet) + weight, _dot(g, quiet) + weight
    # Cramer's rule; the determinant is common to both
    a = np.maximum(gg * fi - fg * gi, 0)
    b = np.maximum(ff * gi - fg * fi, 0)
    legible = known_f & known_g & (ff * gg - fg * fg > _LEAST_DETERMINANT) & (a + b > 0)
    cover = np.where(legible, a / np.maximum(a + b, 1e-12), body > 0)
    cover[core], cover[outer] = 1.0, 0.0
    return cover.astype(np.float64)


def _dot(first: Floats, second: Floats) -> Floats:
    return np.asarray(np.einsum("ijk,ijk->ij", first, second), dtype=np.float32)


def _spread(pixels: Floats, known: Bits) -> tuple[Floats, Bits]:
    """Carry the colours of the known pixels into their surroundings, shape (h, w, 3)."""
    weight = known.astype(np.float32)
    side = (2 * _REACH + 1, 2 * _REACH + 1)
    border = cv2.BORDER_CONSTANT
    total = cv2.GaussianBlur(pixels * weight[:, :, None], side, _NEARNESS, borderType=border)
    share = np.asarray(cv2.GaussianBlur(weight, side, _NEARNESS, borderType=border), np.float32)
    return total / np.maximum(share, 1e-12)[:, :, None], share > 1e-6


def _largest_filled(region: Bits) -> Bits:
    """Keep the largest connected part of a region and fill its holes."""
    contours, _ = cv2.findContours(
        region.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    largest = max(contours, key=cv2.contourArea)
    filled = np.zeros(region.shape, dtype=np.uint8)
    cv2.drawContours(filled, [largest], -1, 1, cv2.FILLED)
    return np.asarray(filled > 0)


def _crossings(cover: Array, inside: Bits) -> Array:
    """Interpolate where the coverage passes one half between neighbours, shape (n, 2)."""
    rows, columns = np.nonzero(inside[:, 1:] != inside[:, :-1])
    step = _fraction(cover[rows, columns], cover[rows, columns + 1])
    flat = np.column_stack([columns + step, rows])
    rows, columns = np.nonzero(inside[1:] != inside[:-1])
    step = _fraction(cover[rows, columns], cover[rows + 1, columns])
    return np.concatenate([flat, np.column_stack([columns, rows + step])])


def _smooth(points: Array, body: Image) -> Bits:
    """Mark the points that keep the distance to the mask's edge that their neighbours keep.

    Light and shade shift the mask's edge gradually along an outline. A bump shows where the scene
    behind changes colour and the mixture was taken for another.
    """
    beyond = cv2.distanceTransform(255 - body, cv2.DIST_L2, 5)
    within = cv2.distanceTransform(body, cv2.DIST_L2, 5)
    columns, rows = np.rint(points).astype(np.int64).T
    offset = np.asarray(beyond - within)[rows, columns]
    total = np.zeros(body.shape, dtype=np.float32)
    count = np.zeros(body.shape, dtype=np.float32)
    np.add.at(total, (rows, columns), offset)
    np.add.at(count, (rows, columns), 1)
    side = (2 * _REACH + 1, 2 * _REACH + 1)
    total = cv2.boxFilter(total, -1, side, normalize=False, borderType=cv2.BORDER_CONSTANT)
    count = cv2.boxFilter(count, -1, side, normalize=False, borderType=cv2.BORDER_CONSTANT)
    usual = total[rows, columns] / count[rows, columns]
    return np.asarray(np.abs(offset - usual) < _BUMP_PX)


def _fraction(first: Array, second: Array) -> Array:
    change = second - first
    safe = np.where(np.abs(change) < 1e-9, 1.0, change)
    fraction: Array = np.where(np.abs(change) < 1e-9, 0.5, (0.5 - first) / safe)
    return np.clip(fraction, 0.0, 1.0)


def _end(across: Array, along: Array, pixel: float) -> tuple[float, float]:
    """Find the least ``across`` of an outline, and its standard deviation."""
    window = max(1.2 * pixel, 0.02 * float(np.ptp(across)))
    least = _supported_minimum(across, window, _SUPPORT * float(np.ptp(along)) / pixel, pixel)
    # in pixels from there, and along the end from -1 to 1
    s = (across - least) / pixel
    chosen = (s >= 0) & (s < window / pixel)
    middle = (along[chosen].max() + along[chosen].min()) / 2
    half = float(np.ptp(along[chosen])) / 2
    if np.count_nonzero(chosen) < _FEWEST or half == 0:
        return least + pixel * float(s[chosen].mean()), pixel * (float(s[chosen].std()) + 0.3)
    x = (along - middle) / half
    beside = np.abs(x) < 1 + 1e-9
    s, x, chosen = s[beside], x[beside], chosen[beside]
    powers = np.column_stack([np.ones_like(x), x, x * x])
    fit = _fit(powers[chosen], s[chosen])
    for _ in range(4):
        # corners and other sides are no part of this end; what noise threw inward or outward is
        again = np.abs(s - powers @ fit) < _TRIM_PX
        if np.count_nonzero(again) < _FEWEST or np.array_equal(again, chosen):
            break
        chosen = again
        fit = _fit(powers[chosen], s[chosen])
    places = [float(x[chosen].min()), float(x[chosen].max())]
    if fit[2] > 0:
        places.append(float(np.clip(-fit[1] / (2 * fit[2]), places[0], places[1])))
    value = min(float(fit[0] + fit[1] * place + fit[2] * place**2) for place in places)
    residual, count = s[chosen] - powers[chosen] @ fit, np.count_nonzero(chosen)
    sigma = math.sqrt(float(residual @ residual) / (count - 3) * 3 / count)
    return least + pixel * value, pixel * sigma


def _supported_minimum(across: Array, window: float, support: float, pixel: float) -> float:
    """Find the least value that has enough points within a window above it.

    A stray bump, where the scene behind changes colour, is passed over, and so are the outermost
    points that noise threw out, when most points crowd together a little further in.
    """
    ordered = np.sort(across)
    count = np.searchsorted(ordered, ordered + window) - np.arange(len(ordered))
    enough = np.flatnonzero(count >= max(_FEWEST, support))
    first = int(enough[0]) if len(enough) else 0
    near = count[first : np.searchsorted(ordered, ordered[first] + _THROW_PX * pixel, "right")]
    return float(ordered[first + int(np.argmax(near >= near.max() / 2))])


def _fit(powers: Array, values: Array) -> Array:
    return np.asarray(np.linalg.lstsq(powers, values, rcond=None)[0], dtype=np.float64)


def _disc(radius: int) -> Image:
    side = 2 * radius + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return np.asarray(disc, dtype=np.uint8)
