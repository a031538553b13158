"""The eye of a task: pictures become things that stand on the table."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from arm3dof.runtime.tasks.signals import Sight
from arm3dof.state import Array
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import Blob, ColourTarget
from arm3dof.vision.locate import Located, Refused, View, patches
from arm3dof.vision.outline import trace
from arm3dof.vision.overlap import stand_both
from arm3dof.vision.placing import Refusal
from arm3dof.vision.standing import SHAPE_SIGMA_M, Standing, guess, stand

Image = NDArray[np.uint8]

_REACH = (0.09, 0.34)  # distance from the base's axis at which things may stand [m]
_WIDTHS = (0.012, 0.075)  # [m]
_HEIGHTS = (0.010, 0.110)  # [m]
_ROUGHLY = 0.02  # by how much a guess may err [m]


@dataclass(frozen=True, eq=False)
class TableView:
    """What stands on the table in one picture.

    Attributes:
        image: the picture.
        things: what stands there; also, as ``hidden`` ones, what is seen in part.
        view: the whole ones as located objects, each at the middle of its thing, in the same order;
            and the others with the reason why they are not measured.
    """

    image: Image
    things: tuple[Standing, ...]
    view: View


def look_at_table(
    image: Image, camera: Camera, targets: Iterable[ColourTarget], table_height: float
) -> TableView:
    """Find what stands on the table; what does not, such as parts of the robot, is left out.

    Only the colours of the targets are used: how wide and high a thing is follows from where it
    meets the table.

    Args:
        image: BGR picture, shape (h, w, 3), uint8.
        camera: the camera that took it.
        targets: what to look for.
        table_height: of the table in the base frame [m].

    Raises:
        InputError: the picture is not one, or not of the camera's size.
    """
    picture, found = patches(image, camera, tuple(targets))
    things: list[Standing] = []
    located: list[Located] = []
    refused: list[Refused] = []
    for blob, target in found:
        outline = trace(picture, blob, camera.gamma)
        if outline is None:
            continue
        for thing in _stood(target.name, blob, outline, camera, table_height):
            things.append(thing)
            if thing.hidden:
                reason = Refusal.BORDER if blob.touches_border else Refusal.PARTIAL
                refused.append(Refused(target.name, blob.box_px, reason))
            else:
                located.append(_as_located(blob, outline, thing, camera, table_height))
    return TableView(image, tuple(things), View(tuple(located), tuple(refused)))


def _stood(
    name: str, blob: Blob, outline: Array, camera: Camera, table_height: float
) -> tuple[Standing, ...]:
    """Return what stands on the table where a patch is: one thing, two that overlap, or nothing.

    What may be a thing but is not explained is still something to keep clear of.
    """
    where = outline, camera, table_height
    rough = guess(name, *where)
    if rough is None or not _is_a_thing(rough, _ROUGHLY):
        return ()
    thing = stand(name, *where)
    if thing is None or not _is_a_thing(thing):
        thing = rough
    if blob.touches_border:
        thing = replace(thing, hidden=True)
    elif thing.hidden:
        both = stand_both(name, outline, blob.contour, camera, table_height)
        if both is not None and all(map(_is_a_thing, both)):
            return both
    return (thing,) if _is_a_thing(thing) else ()


def _as_located(
    blob: Blob, outline: Array, thing: Standing, camera: Camera, table_height: float
) -> Located:
    p_base = np.array([thing.x, thing.y, table_height + thing.height_m / 2])
    p_camera = camera.to_camera(p_base)
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = thing.covariance
    covariance[2, 2] = SHAPE_SIGMA_M**2
    ahead = camera.transform_base_camera[:3, 2]
    left, top = outline.min(axis=0).tolist()
    right, bottom = outline.max(axis=0).tolist()
    return Located(
        target=thing.target,
        box_px=blob.box_px,
        outline_px=(left, top, right, bottom),
        depth_m=float(p_camera[2]),
        depth_sigma_m=float(np.sqrt(ahead @ covariance @ ahead)),
        p_camera=p_camera,
        p_base=p_base,
        covariance_base=covariance,
    )


def _is_a_thing(thing: Standing, slack: float = 0.0) -> bool:
    """Whether a thing is where things stand, and of their size, but for a slack [m]."""
    spans = (
        (thing.distance_to(0.0, 0.0), _REACH),
        (thing.width_m, _WIDTHS),
        (thing.height_m, _HEIGHTS),
    )
    return all(low - slack <= value <= high + slack for value, (low, high) in spans)


class SimulatedEye:
    """An eye with a rhythm and a delay of its own, in simulated time.

    Pictures are taken every ``period``, and what they show is known ``delay`` later. So a slow
    camera makes what is known old, and never holds up the arm; runs repeat to the last bit.

    Attributes:
        ages: how old what was known was, at each control step in which it was asked for [s].
        pictures: how many were taken.
        first: what was seen first; None before it.
    """

    def __init__(
        self,
        take: Callable[[], Image],
        camera: Camera,
        targets: Iterable[ColourTarget],
        table_height: float,
        *,
        period: float = 0.1,
        delay: float = 0.03,
    ) -> None:
        """Open the eye.

        Args:
            take: takes a picture now.
            camera: the camera that it is taken by.
            targets: what to look for.
            table_height: of the table in the base frame [m].
            period: time between two pictures [s].
            delay: from taking a picture to knowing what it shows [s].
        """
        self._take, self._camera, self._targets = take, camera, tuple(targets)
        self._table, self._period, self._delay = table_height, period, delay
        self._next = -np.inf
        self._coming: deque[Sight] = deque()
        self._known: Sight | None = None
        self.ages: list[float] = []
        self.pictures = 0
        self.first: TableView | None = None

    def sight(self, t: float, looking: bool) -> Sight | None:
        """Return the latest that is known at a time; None for nothing yet.

        Args:
            t: now [s].
            looking: whether pictures are wanted; without, none is taken.
        """
        if looking and t >= self._next - 1e-9:
            self._next = t + self._period
            seen = look_at_table(self._take(), self._camera, self._targets, self._table)
            self.pictures += 1
            self.first = self.first or seen
            self._coming.append(Sight(seen.things, t))
        while self._coming and self._coming[0].taken_at + self._delay <= t + 1e-9:
            self._known = self._coming.popleft()
        if self._known is not None and looking:
            self.ages.append(t - self._known.taken_at)
        return self._known
