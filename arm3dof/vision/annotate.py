"""The picture with what was found in it, as in the paper's Fig. 7.

A blue frame shows the colour that was recognised, a red one the outline that depth was measured
on, and a label the place in the camera's frame. They nearly overlap, for one follows the other.
"""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from arm3dof.vision.colour import Image, check_image
from arm3dof.vision.locate import Located, Refused, View
from arm3dof.vision.placing import Refusal

BLUE, RED, GREY = (235, 105, 20), (40, 40, 230), (120, 120, 120)  # BGR
_INK, _PAPER = (255, 255, 255), (32, 28, 24)
_LEAST_SIDE = 480  # smaller pictures are enlarged, so that labels can be read [px]
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_SHORT = {
    Refusal.BORDER: "cut off by the border",
    Refusal.THIN: "too thin",
    Refusal.AFLOAT: "not on the table",
    Refusal.PARTIAL: "partly hidden",
}

Box = tuple[int, int, int, int]


def annotate(image: NDArray[np.generic], seen: View | Iterable[Located | Refused]) -> Image:
    """Draw frames and labels over a picture.

    Args:
        image: BGR picture, shape (h, w, 3), uint8; it stays as it is.
        seen: what was found in it.

    Returns:
        A new picture, enlarged by a whole number when the given one is too small to label.

    Raises:
        InputError: ``image`` is not a BGR picture.
    """
    picture = check_image(image)
    scale = max(1, -(-_LEAST_SIDE // max(picture.shape[:2])))
    size = (picture.shape[1] * scale, picture.shape[0] * scale)
    canvas = np.array(cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST), dtype=np.uint8)
    everything: tuple[Located | Refused, ...] = (
        (*seen.located, *seen.refused) if isinstance(seen, View) else tuple(seen)
    )
    line = max(1, round(max(size) / 400))
    for it in everything:
        left, top, width, height = _scaled(it.box_px, scale)
        colour = BLUE if isinstance(it, Located) else GREY
        # outside the box, so that the red frame stays in sight
        corner = (left - line, top - line)
        far = (left + width + line - 1, top + height + line - 1)
        cv2.rectangle(canvas, corner, far, colour, line, cv2.LINE_AA)
        if isinstance(it, Located):
            _frame(canvas, it.outline_px, scale, line)
    taken = [_scaled(it.box_px, scale) for it in everything]
    for it in everything:
        taken.append(_label(canvas, it, scale, line, taken))
    return canvas


def label(seen: Located | Refused) -> str:
    """Write what a frame shows: ``name (x, y, depth) cm`` in the camera's frame."""
    if isinstance(seen, Refused):
        return f"{seen.target}: {_SHORT[seen.reason]}"
    x, y, depth = 100 * seen.p_camera
    return f"{seen.target} ({x:.1f}, {y:.1f}, {depth:.1f}) cm"


def _frame(
    canvas: Image, outline: tuple[float, float, float, float], scale: int, line: int
) -> None:
    """Draw the depth frame at a sixteenth of a pixel; pixel centres are whole numbers."""
    ends = [round(16 * ((value + 0.5) * scale - 0.5)) for value in outline]
    cv2.rectangle(canvas, ends[:2], ends[2:], RED, line, cv2.LINE_AA, 4)


def _label(canvas: Image, seen: Located | Refused, scale: int, line: int, taken: list[Box]) -> Box:
    """Write a label by its frame where no other label is, and return its place."""
    height, width = canvas.shape[:2]
    text = label(seen)
    size = max(0.45, max(width, height) / 1150)
    weight = max(1, round(1.6 * size))
    (wide, tall), drop = cv2.getTextSize(text, _FONT, size, weight)
    if wide + 4 * line > width:
        size *= max(width - 4 * line, 1) / wide
        (wide, tall), drop = cv2.getTextSize(text, _FONT, size, weight)
    pad = max(2, round(0.35 * tall))
    plate = (wide + 2 * pad, tall + drop + 2 * pad)
    u, v, w, h = _scaled(seen.box_px, scale)
    gap = 3 * line
    above, below, step = v - gap - plate[1], v + h + gap, plate[1] + line
    columns = (u - 2 * line, u + w + 2 * line - plate[0], u + w // 2 - plate[0] // 2)
    rows = (above, below, above - step, below + step, above - 2 * step, below + 2 * step)
    places = [
        (
            min(max(column, 0), max(width - plate[0], 0)),
            min(max(row, 0), max(height - plate[1], 0)),
        )
        for row in rows
        for column in columns
    ]
    free = (it for it in places if not any(_meet((*it, *plate), box) for box in taken))
    left, top = next(free, places[0])
    part = canvas[top : top + plate[1], left : left + plate[0]]
    part[:] = (0.25 * part + 0.75 * np.array(_PAPER)).astype(np.uint8)
    stripe = BLUE if isinstance(seen, Located) else GREY
    part[:, : max(2, line)] = stripe
    foot = (left + pad + line, top + pad + tall)
    cv2.putText(canvas, text, foot, _FONT, size, _INK, weight, cv2.LINE_AA)
    return (left, top, *plate)


def _scaled(box: Box, scale: int) -> Box:
    u, v, width, height = box
    return u * scale, v * scale, width * scale, height * scale


def _meet(first: Box, second: Box) -> bool:
    return (
        first[0] < second[0] + second[2]
        and second[0] < first[0] + first[2]
        and first[1] < second[1] + second[3]
        and second[1] < first[1] + first[3]
    )
