"""Pictures of a folder, a video, a device or a stream, as if a camera took them now."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import cv2
import numpy as np

from arm3dof.errors import CameraLost
from arm3dof.runtime.live.eye import Watch
from arm3dof.runtime.live.pace import Clock
from arm3dof.runtime.parallel import PackedRobot
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import Image
from arm3dof.vision.latest import Latest
from arm3dof.vision.sources import Frame

STILL = 1.0
"""How long a picture lasts that nothing says more of [s]."""
_MOMENT = 0.02  # how long a first picture is waited for [s]


class SourceCamera:
    """The newest picture of a source, brought to the camera's size.

    A thread draws them, so that whoever asks never waits and none grows old in a queue.
    """

    def __init__(self, play: Callable[[], Iterator[Frame]], camera: Camera) -> None:
        """Take the pictures of a source.

        Args:
            play: opens the source; its frames come when they are due.
            camera: the camera whose size they get.
        """
        self._play, self._size = play, (camera.width, camera.height)
        self._newest: Latest[Frame] | None = None

    def take(self, watch: Watch, measured: bool = True) -> Image | None:
        """Return the newest picture; ``None`` before the first.

        Raises:
            CameraLost: there are no more; the next call opens the source anew.
        """
        if self._newest is None:
            self._newest = Latest(self._play(), "arm3dof-pictures")
        frame = self._newest.wait(1, _MOMENT)
        if self._newest.ended:
            why, self._newest = self._newest.failure, None
            raise CameraLost(why or "the camera gives no more pictures")
        return None if frame is None else fitted(frame.image, *self._size)

    def change_robot(self, robot: PackedRobot) -> None:
        """Do nothing: the arm in the picture, if there is one, is what it is."""

    def close(self) -> None:
        """Let go of the source."""
        if self._newest is not None:
            self._newest.close()
            self._newest = None


def played(open_source: Callable[[], Iterator[Frame]], clock: Clock) -> Iterator[Frame]:
    """Go through a source over and over, each frame at its time; end when it gives nothing.

    What comes later than its time, as from a device, is given at once.

    Args:
        open_source: opens it.
        clock: what time is kept by.
    """
    while True:
        begin, lasts = clock.now(), STILL
        last: Frame | None = None
        for frame in open_source():
            clock.wait_until(begin + frame.t)
            yield frame
            if last is not None:
                lasts = frame.t - last.t
            last = frame
        if last is None:
            return
        clock.wait_until(begin + last.t + lasts)


def fitted(image: Image, width: int, height: int) -> Image:
    """Bring a picture to a size without distorting it: cut to its proportions about the middle.

    Args:
        image: BGR picture, shape (h, w, 3), uint8.
        width: wanted [px].
        height: wanted [px].
    """
    rows, columns = image.shape[:2]
    if (columns, rows) == (width, height):
        return image
    scale = max(width / columns, height / rows)
    wide, high = min(round(width / scale), columns), min(round(height / scale), rows)
    left, top = (columns - wide) // 2, (rows - high) // 2
    middle = image[top : top + max(high, 1), left : left + max(wide, 1)]
    return np.asarray(cv2.resize(middle, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
