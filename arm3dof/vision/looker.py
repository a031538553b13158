"""Looking at picture after picture: what looks as it did is not measured anew."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import BlobSettings, ColourTarget, Image
from arm3dof.vision.locate import Located, Refused, View, locate, patches
from arm3dof.vision.outline import SURROUNDINGS

_BLUR = (9, 9)  # quiets the noise of single pixels
# a change of the blurred picture [grey levels]: noise of 2 levels stays well below, an edge of 80
# levels that moves by a third of a pixel does not
_CHANGE = 5.0
_JITTER = 3  # how far noise moves the sides of a patch [px]


class _Measured(NamedTuple):
    """A patch as it was when it was measured, with what its measurement made use of."""

    result: Located | Refused
    window: tuple[slice, slice]
    quiet: Image


class Looker:
    """Does what ``look`` does, for pictures that follow each other.

    A patch is measured again when it, or what is near it, has changed since it was measured.
    """

    def __init__(
        self,
        camera: Camera,
        targets: Iterable[ColourTarget] | Mapping[str, ColourTarget],
        settings: BlobSettings | None = None,
    ) -> None:
        """Begin without a picture.

        Args:
            camera: the camera that takes them.
            targets: what to look for.
            settings: how pixels become blobs.
        """
        self._camera, self._settings = camera, settings
        self._targets = tuple(targets.values() if isinstance(targets, Mapping) else targets)
        self._known: list[_Measured] = []

    def look(self, image: NDArray[np.generic]) -> View:
        """Find every object of the targets' colours, and measure what has changed.

        Args:
            image: BGR picture of the camera's size, shape (h, w, 3), uint8.

        Raises:
            InputError: the picture is not one, or not of the camera's size.
        """
        picture, found = patches(image, self._camera, self._targets, self._settings)
        known = []
        for blob, target in found:
            seen = self._as_before(picture, target, blob.box_px)
            if seen is None:
                result = locate(picture, self._camera, blob, target)
                window = _around(result.box_px)
                seen = _Measured(result, window, _quiet(picture[window]))
            known.append(seen)
        self._known = known
        return View(
            tuple(it.result for it in known if isinstance(it.result, Located)),
            tuple(it.result for it in known if isinstance(it.result, Refused)),
        )

    def _as_before(
        self, picture: Image, target: ColourTarget, box: tuple[int, int, int, int]
    ) -> _Measured | None:
        """Return what is known of a patch, unless it has changed."""
        for it in self._known:
            if it.result.target != target.name or _apart(it.result.box_px, box) > _JITTER:
                continue
            if cv2.norm(it.quiet, _quiet(picture[it.window]), cv2.NORM_INF) <= _CHANGE:
                return it
        return None


def _around(box: tuple[int, int, int, int]) -> tuple[slice, slice]:
    u, v, width, height = box
    pad = SURROUNDINGS
    return slice(max(v - pad, 0), v + height + pad), slice(max(u - pad, 0), u + width + pad)


def _apart(first: tuple[int, int, int, int], second: tuple[int, int, int, int]) -> int:
    """Return how far the sides of two boxes are apart at most [px]."""
    (a, b, c, d), (e, f, g, h) = first, second
    return max(abs(a - e), abs(b - f), abs(a + c - e - g), abs(b + d - f - h))


def _quiet(picture: Image) -> Image:
    return np.asarray(cv2.GaussianBlur(picture, _BLUR, 0), np.uint8)
