"""An eye that sees at its own pace beside the control loop: the latest result wins."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from time import monotonic

from arm3dof.closing import Closing
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import ColourTarget, Image
from arm3dof.vision.latest import Latest, stamped
from arm3dof.vision.locate import View, look
from arm3dof.vision.sources import Frame


@dataclass(frozen=True, eq=False)
class Glance:
    """What the eye made of one picture, and when the picture was taken.

    Attributes:
        view: what was seen.
        frame: the picture.
        taken_at: monotonic time at which it came from the camera [s].
    """

    view: View
    frame: Frame
    taken_at: float

    def age(self, now: float | None = None) -> float:
        """Return how old the picture is [s], by the monotonic clock or at a given time of it."""
        return (monotonic() if now is None else now) - self.taken_at


class Eye(Closing):
    """Looks at the newest picture of a source, again and again, in threads of its own.

    One thread draws pictures, so that none waits in a queue and grows old; another looks at the
    newest. ``latest`` answers at once: a slow or missing picture never holds up who asks.
    Use it in a ``with`` block, or ``close`` it.
    """

    def __init__(
        self,
        source: Iterable[Frame],
        camera: Camera,
        targets: Iterable[ColourTarget] | Mapping[str, ColourTarget],
        *,
        looker: Callable[[Image], View] | None = None,
    ) -> None:
        """Open the eye.

        Args:
            source: pictures, for instance ``frames("http://127.0.0.1:8080/stream")``.
            camera: the camera that takes them.
            targets: what to look for.
            looker: what looks at a picture instead of ``look`` with this camera and targets.
        """
        wanted = tuple(targets.values() if isinstance(targets, Mapping) else targets)
        self._look = looker or (lambda image: look(image, camera, wanted))
        self._frames = Latest(stamped(source), "frames")
        self._glances = Latest(self._looking(), "eye")

    @property
    def latest(self) -> Glance | None:
        """The latest result; None before the first."""
        return self._glances.item

    @property
    def count(self) -> int:
        """How many pictures have been looked at."""
        return self._glances.count

    @property
    def failure(self) -> str | None:
        """Why there will be no more results, in one line; None while there may be."""
        if (reason := self._frames.failure or self._glances.failure) is not None:
            return reason
        return "the source has ended; start it again" if self._glances.ended else None

    def wait(self, count: int = 1, timeout: float | None = None) -> Glance | None:
        """Wait until some pictures have been looked at, or no more will be.

        Args:
            count: how many.
            timeout: the longest wait; for ever without it [s].

        Returns:
            The latest result then; None when there is none.
        """
        return self._glances.wait(count, timeout)

    def close(self) -> None:
        """Close the eye; a camera that does not answer is left to itself."""
        self._frames.close()
        self._glances.close()

    def _looking(self) -> Iterator[Glance]:
        for frame, taken_at in self._frames.fresh():
            yield Glance(self._look(frame.image), frame, taken_at)
