"""The camera beside the live arm: takes a picture, looks at it, and draws what it saw.

It is given what to look for and answers with pictures; it knows no clock and no process.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import cv2
import numpy as np

from arm3dof.errors import ArmError, InputError
from arm3dof.runtime.parallel import PackedRobot
from arm3dof.sim.scene import Light, Scene, draw
from arm3dof.vision.annotate import annotate
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import ColourTarget, HsvRange, Image, blurred_hsv
from arm3dof.vision.learn import learn_colour
from arm3dof.vision.locate import View
from arm3dof.vision.looker import Looker

_QUALITY = 82  # of the JPEG
_NOISES = 6  # pictures of the same scene with noise of their own
_MASK_TINT = (150, 190, 0)  # BGR of what is inside the bounds: bluish green


@dataclass(frozen=True)
class Watch:
    """What the eye is to do from now on.

    Attributes:
        targets: what it looks for.
        shown: name of the target whose mask is drawn; empty for none.
        light: brightness of the simulated lamp, 1 is normal.
    """

    targets: tuple[ColourTarget, ...]
    shown: str = ""
    light: float = 1.0

    def __post_init__(self) -> None:
        if not 0.05 <= self.light <= 5:
            raise InputError(f"light is {self.light}; give 0.05 to 5")


@dataclass(frozen=True)
class Pick:
    """Tell the colour of what is at a pixel.

    Attributes:
        u: column [px].
        v: row [px].
        tab: who asks.
    """

    u: int
    v: int
    tab: str = ""


class Learned(NamedTuple):
    """The answer to ``Pick``.

    Attributes:
        pick: what was asked.
        hsv: the colour; ``None`` when none can be learned there.
        why: why not, in words.
    """

    pick: Pick
    hsv: HsvRange | None
    why: str = ""


class SeenPicture(NamedTuple):
    """One picture and what was seen in it.

    Attributes:
        number: how many pictures came before.
        jpeg: the picture with its frames and labels.
        mask: the pixels inside the shown target's bounds, as a JPEG; empty when none is shown.
        view: what was seen.
    """

    number: int
    jpeg: bytes
    mask: bytes
    view: View


class Blind(NamedTuple):
    """There are no pictures, until there are some again.

    Attributes:
        why: in words.
    """

    why: str


TakePicture = Callable[[Watch, bool], Image | None]
"""Takes the next picture, as the camera sees it now; ``None`` before there is one. It is told
whether the picture is to be measured, or only shown."""


class PictureSource(Protocol):
    """Where pictures come from."""

    def take(self, watch: Watch, measured: bool = True) -> Image | None:
        """Return the next picture; ``None`` before there is one.

        Args:
            watch: under what light, where that can be chosen.
            measured: whether things are measured in it; one that is only shown may be rougher.

        Raises:
            ArmError: there is none any more; a later call may have one again.
        """

    def change_robot(self, robot: PackedRobot) -> None:
        """See another arm from now on, where the source shows one."""


class Watcher:
    """Takes pictures and looks at them."""

    def __init__(self, take: TakePicture, camera: Camera, watch: Watch) -> None:
        """Open the eye.

        Args:
            take: takes a picture of the camera's size.
            camera: the camera.
            watch: what to look for at first.
        """
        self._take, self._camera = take, camera
        self.watch(watch)
        self._number = 0
        self._picture: Image | None = None

    def watch(self, watch: Watch) -> None:
        """Look for other things from now on."""
        self._watch = watch
        self._view: View | None = None
        self._looker = Looker(self._camera, watch.targets)

    @property
    def picture(self) -> Image | None:
        """The last picture that was looked at; the first one when there was none yet."""
        if self._picture is None:
            self._picture = self._take(self._watch, True)
        return self._picture

    @property
    def watched(self) -> tuple[ColourTarget, ...]:
        """What is looked for."""
        return self._watch.targets

    def see(self, anew: bool = True) -> SeenPicture | None:
        """Take the next picture and look at it; ``None`` before there is one.

        Args:
            anew: whether to look for things in it, which takes longer than to take it; otherwise
                what was seen last stands in for what there is to be seen.

        Raises:
            ArmError: there is none any more.
        """
        anew = anew or self._view is None
        picture = self._take(self._watch, anew)
        if picture is None:
            return None
        view = None if anew else self._view
        if view is None:
            self._picture = picture
            view = self._view = self._looker.look(picture)
        sight = SeenPicture(self._number, _jpeg(annotate(picture, view)), self._mask(picture), view)
        self._number += 1
        return sight

    def learn(self, pick: Pick) -> Learned:
        """Find the colour of what is at a pixel of the last picture."""
        try:
            if (picture := self.picture) is None:
                return Learned(pick, None, "there is no picture yet")
            return Learned(pick, learn_colour(picture, (pick.u, pick.v)).hsv)
        except ArmError as error:
            return Learned(pick, None, str(error))

    def _mask(self, picture: Image) -> bytes:
        shown = [it for it in self._watch.targets if it.name == self._watch.shown]
        if not shown:
            return b""
        inside = shown[0].hsv.mask(blurred_hsv(picture)) > 0
        dimmed = (picture // 5).astype(np.uint8)
        dimmed[inside] = picture[inside] // 2 + np.array(_MASK_TINT, np.uint8) // 2
        return _jpeg(dimmed)


def _jpeg(picture: Image) -> bytes:
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return data.tobytes()


# ---- where pictures come from ------------------------------------------------------------------


class DrawnCamera:
    """The drawn table, which stands still: it is drawn anew only for another light.

    The sensor's noise goes round in a few pictures.
    """

    def __init__(self, scene: Scene, camera: Camera, seed: int = 0) -> None:
        """Set the scene; ``seed`` decides the sensor's noise."""
        self._scene, self._camera = scene, camera
        self._rng = np.random.default_rng(seed)
        self._light, self._taken = float("nan"), 0
        self._pictures: list[Image] = []

    def take(self, watch: Watch, measured: bool = True) -> Image:
        """Return the scene under the light that is asked for, always as good as it can be."""
        if watch.light != self._light:
            self._light = watch.light
            self._pictures = self._draw(watch.light)
        self._taken += 1
        return self._pictures[self._taken % len(self._pictures)]

    def change_robot(self, robot: PackedRobot) -> None:
        """Do nothing: there is no arm in the scene."""

    def _draw(self, brightness: float) -> list[Image]:
        sun, camera = self._scene.light, self._camera
        strengths = brightness * sun.strength, brightness * sun.ambient
        light = Light(sun.direction, *strengths, sun.softness)
        clean = draw(
            Scene(self._scene.solids, self._scene.table, light, 0.0),
            camera.camera_matrix,
            camera.transform_base_camera,
            camera.width,
            camera.height,
        ).astype(np.float32)
        sigma = np.float32(self._scene.noise)
        noisy = (
            clean + sigma * self._rng.standard_normal(clean.shape, dtype=np.float32)
            for _ in range(_NOISES)
        )
        return [np.clip(each + 0.5, 0, 255).astype(np.uint8) for each in noisy]
