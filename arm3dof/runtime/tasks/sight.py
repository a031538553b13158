"""The eye of a task: pictures become things that stand on the table."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from arm3dof.runtime.tasks.pick_and_place import Sight
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import ColourTarget
from arm3dof.vision.locate import View, look
from arm3dof.vision.standing import Standing, stand

Image = NDArray[np.uint8]

_REACH = (0.09, 0.34)  # distance from the base's axis at which things may stand [m]
_WIDTHS = (0.012, 0.075)  # [m]
_HEIGHTS = (0.010, 0.110)  # [m]


def things_in(view: View, camera: Camera, table_height: float) -> tuple[Standing, ...]:
    """Return what stands on the table in a view; what does not, such as the robot, is left out."""
    things = (
        stand(located.target, located.outline_px, camera, table_height) for located in view.located
    )
    return tuple(thing for thing in things if thing is not None and _is_a_thing(thing))


def _is_a_thing(thing: Standing) -> bool:
    return (
        _REACH[0] <= thing.distance_to(0.0, 0.0) <= _REACH[1]
        and _WIDTHS[0] <= thing.width_m <= _WIDTHS[1]
        and _HEIGHTS[0] <= thing.height_m <= _HEIGHTS[1]
    )


class SimulatedEye:
    """An eye with a rhythm and a delay of its own, in simulated time.

    Pictures are taken every ``period``, and what they show is known ``delay`` later. So a slow
    camera makes what is known old, and never holds up the arm; runs repeat to the last bit.

    Attributes:
        ages: how old what was known was, at each control step in which it was asked for [s].
        pictures: how many were taken.
        latest: the latest picture and what was seen in it; None before the first.
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
        self.latest: tuple[Image, View] | None = None

    def sight(self, t: float, looking: bool) -> Sight | None:
        """Return the latest that is known at a time; None for nothing yet.

        Args:
            t: now [s].
            looking: whether pictures are wanted; without, none is taken.
        """
        if looking and t >= self._next - 1e-9:
            self._next = t + self._period
            picture = self._take()
            view = look(picture, self._camera, self._targets)
            self.pictures += 1
            self.latest = picture, view
            self._coming.append(Sight(things_in(view, self._camera, self._table), t))
        while self._coming and self._coming[0].taken_at + self._delay <= t + 1e-9:
            self._known = self._coming.popleft()
        if self._known is not None and looking:
            self.ages.append(t - self._known.taken_at)
        return self._known
