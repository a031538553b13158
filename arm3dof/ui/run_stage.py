"""All that stands in a run, as faces for the painter: the arm, its fingers, objects and bins."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from arm3dof.runtime.recording import Recording
from arm3dof.sim.world import World
from arm3dof.state import Array
from arm3dof.ui.facets import Facets, Piece, facets
from arm3dof.ui.replay import at_times
from arm3dof.ui.robot_drawing import RobotDrawing
from arm3dof.ui.things import Part, bin_parts, body_parts


class RunStage:
    """The faces of everything in a run, and where they are at any time.

    Args:
        recording: the run.

    Attributes:
        drawing: the robot's shapes.
        shape: all faces.
        floor: height of what all stands on [m].
    """

    def __init__(self, recording: Recording) -> None:
        self._run = recording
        self.drawing = RobotDrawing(recording.load_robot())
        self.floor = self.drawing.floor()
        pieces = self.drawing.pieces()
        if recording.world is not None:
            pieces += _world_pieces(recording.world, len(self.drawing.link_names))
        self.shape: Facets = facets(pieces)

    def joints(self, t: float) -> Array:
        """Return the joint positions at a time of the recording [s], shape (nv,) [rad]."""
        result: Array = at_times(self._run, self._run.q, np.array([t]))[0]
        return result

    def points(self, t: float) -> Array:
        """Return the corners of all faces at a time of the recording, shape (n, 3) [m]."""
        r = self._run
        row = int(np.searchsorted(r.t, t).clip(0, len(r) - 1))
        opening = None if r.gripper is None else float(r.gripper[row])
        frames = [self.drawing.placements(self.joints(t), opening)]
        if r.world is not None:
            for body in r.world.bodies:
                place = r.bodies[body.name][row] if body.name in r.bodies else None
                frames.append(_at_start(r.world, body.name) if place is None else _pose(place))
            frames.append(np.eye(4)[None])  # of the bins
        return self.shape.placed(np.concatenate(frames))


def _pose(row: Array) -> Array:
    result: Array = pin.XYZQUATToSE3(row).homogeneous[None]
    return result


def _at_start(world: World, name: str) -> Array:
    body = next(each for each in world.bodies if each.name == name)
    place = np.eye(4)
    place[:3, :3] = pin.utils.rotate("z", body.yaw)
    place[:3, 3] = body.x, body.y, world.table.height + body.height_m / 2
    return place[None]


def _world_pieces(world: World, first: int) -> Iterator[Piece]:
    """Return objects, each owned by a frame of its own from ``first`` on, then bins by one more."""
    for number, body in enumerate(world.bodies):
        for part in body_parts(body):
            yield Piece(first + number, part.shape, _moved(part), body.colour)
    for tray in world.bins:
        foot = np.array([tray.x, tray.y, world.table.height])
        for part in bin_parts(tray):
            yield Piece(first + len(world.bodies), part.shape, _moved(part, foot), tray.colour)


def _moved(part: Part, foot: Array | None = None) -> Array:
    place = np.eye(4)
    place[:3, 3] = part.middle
    if foot is not None:
        place[:3, 3] += foot
    return place
