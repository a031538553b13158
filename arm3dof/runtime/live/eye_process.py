"""The process in which the eye looks, beside the arm's and never in its way."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

from arm3dof.errors import ArmError
from arm3dof.runtime.live.child import Child, offer, received
from arm3dof.runtime.live.eye import (
    Blind,
    DrawnCamera,
    Learned,
    Pick,
    PictureSource,
    SeenPicture,
    Watch,
    Watcher,
)
from arm3dof.runtime.live.footage import SourceCamera, played
from arm3dof.runtime.live.frames import Mode, Ring
from arm3dof.runtime.live.pace import WallClock
from arm3dof.runtime.parallel import PackedRobot
from arm3dof.runtime.tasks.sight import look_at_table
from arm3dof.runtime.tasks.signals import Sight
from arm3dof.sim.scene import Scene
from arm3dof.sim.world import World
from arm3dof.vision.camera import Camera
from arm3dof.vision.sources import frames

RATE = 21.0
"""Pictures that are aimed at [1/s]."""
LOOKS = 4.0
"""How often things are looked for in them at most [1/s]; it costs more than the pictures."""
RETRY = 2.0
"""How long after it was lost a camera is tried again [s]."""


@dataclass(frozen=True)
class EyeSpec:
    """What the eye looks through, as it is sent to its process.

    Attributes:
        camera: the camera.
        watch: what it looks for at first.
        source: the arm's own world, a drawn scene, or what ``frames`` takes: a folder, a video, a
            stream's address, a device's number.
    """

    camera: Camera
    watch: Watch
    source: World | Scene | Path | str | int

    def open(self, robot: PackedRobot, ring: Ring) -> PictureSource:
        """Open the source.

        Args:
            robot: the arm, as it may be seen in the picture.
            ring: its frames.
        """
        if isinstance(self.source, World):
            from arm3dof.runtime.live.physics import LiveCamera  # needs MuJoCo

            return LiveCamera(robot, self.source, self.camera, ring)
        if isinstance(self.source, Scene):
            return DrawnCamera(self.source, self.camera)
        play = partial(played, partial(frames, self.source), WallClock())
        return SourceCamera(play, self.camera)


class EyeProcess(Child):
    """The handle of a running eye; send it ``Watch``, ``Pick`` and a ``PackedRobot``."""

    def __init__(
        self,
        spec: EyeSpec,
        robot: PackedRobot,
        ring: Ring,
        on_message: Callable[[SeenPicture | Learned | Blind], None],
        sights: Connection | None = None,
    ) -> None:
        """Start the process.

        Args:
            spec: what it looks through.
            robot: the arm, as it may be seen in the picture.
            ring: the frames of the arm.
            sights: where what stands on the table is told to the arm.
            on_message: called from a thread with each picture and answer.
        """
        self.spec = spec
        super().__init__("arm3dof-eye", _look, (spec, robot, ring, sights), on_message)


def _look(
    spec: EyeSpec,
    robot: PackedRobot,
    ring: Ring,
    sights: Connection | None,
    pipe: Connection,
) -> None:
    """Be the eye's process."""
    try:
        source = spec.open(robot, ring)
        eye = Watcher(source.take, spec.camera, spec.watch)
        due = look_due = time.monotonic()
        blind = False
        while (messages := received(pipe, max(due - time.monotonic(), 0.0))) is not None:
            for message in messages:
                if isinstance(message, Watch):
                    eye.watch(message)
                elif isinstance(message, PackedRobot):
                    source.change_robot(message)
                elif isinstance(message, Pick):
                    pipe.send(eye.learn(message))
            if time.monotonic() < due:
                continue
            due = max(due + 1 / RATE, time.monotonic())
            anew = time.monotonic() >= look_due
            frame = ring.latest()
            try:
                sight = eye.see(anew)
            except ArmError as error:
                if not blind:
                    pipe.send(Blind(str(error)))
                blind, due = True, time.monotonic() + RETRY
                continue
            if sight is None:
                continue
            blind = False
            if anew:
                look_due = max(look_due + 1 / LOOKS, time.monotonic())
                if sights is not None and frame is not None and frame["mode"] == Mode.WORKING:
                    offer(sights, _known(eye, spec, float(frame["t"])))
            pipe.send(sight)
    except ArmError as error:  # there never was a camera
        pipe.send(Blind(str(error)))
    except (BrokenPipeError, ConnectionResetError):
        pass  # the page has gone


def _known(eye: Watcher, spec: EyeSpec, t: float) -> Sight:
    """Return what stands on the table in the last picture."""
    height = spec.source.table.height if isinstance(spec.source, World) else 0.0
    picture = eye.picture
    if picture is None:
        return Sight((), t)
    return Sight(look_at_table(picture, spec.camera, eye.watched, height).things, t)
