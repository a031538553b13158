"""The process in which the eye looks, beside the arm's and never in its way."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

from arm3dof.errors import ArmError
from arm3dof.runtime.live.child import Child, received
from arm3dof.runtime.live.eye import (
    DrawnCamera,
    Eye,
    Learned,
    Pick,
    Sight,
    SourceCamera,
    TakePicture,
    Watch,
    endless,
)
from arm3dof.runtime.live.process import News
from arm3dof.sim.scene import Scene
from arm3dof.vision.camera import Camera
from arm3dof.vision.sources import frames

RATE = 24.0
"""Pictures that are aimed at [1/s]."""
_NICE = 5  # the eye goes after the arm and the page, where the system lets it


@dataclass(frozen=True)
class EyeSpec:
    """What the eye looks through, as it is sent to its process.

    Attributes:
        camera: the camera.
        watch: what it looks for at first.
        source: a drawn scene, or what ``frames`` takes: a folder, a video, a device's number.
    """

    camera: Camera
    watch: Watch
    source: Scene | Path | int

    def open(self) -> TakePicture:
        """Open the source."""
        if isinstance(self.source, Scene):
            return DrawnCamera(self.source, self.camera).take
        return SourceCamera(endless(partial(frames, self.source)), self.camera).take


class EyeProcess(Child):
    """The handle of a running eye; send it ``Watch`` and ``Pick``."""

    def __init__(self, spec: EyeSpec, on_message: Callable[[Sight | Learned | News], None]) -> None:
        """Start the process.

        Args:
            spec: what it looks through.
            on_message: called from a thread with each picture and answer.
        """
        self.spec = spec
        super().__init__("arm3dof-eye", _look, (spec,), on_message)


def _look(spec: EyeSpec, pipe: Connection) -> None:
    """Be the eye's process."""
    with contextlib.suppress(OSError, AttributeError):
        os.nice(_NICE)
    try:
        eye = Eye(spec.open(), spec.camera, spec.watch)
        due = time.monotonic()
        while (messages := received(pipe, max(due - time.monotonic(), 0.0))) is not None:
            for message in messages:
                if isinstance(message, Watch):
                    eye.watch(message)
                elif isinstance(message, Pick):
                    pipe.send(eye.learn(message))
            if time.monotonic() >= due:
                due = max(due + 1 / RATE, time.monotonic())
                pipe.send(eye.see())
    except (ArmError, StopIteration) as error:
        pipe.send(News(str(error) or "the camera gives no more pictures", bad=True))
    except (BrokenPipeError, ConnectionResetError):
        pass  # the page has gone
