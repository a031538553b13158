"""See-through copies of the arm: light to draw, for there may be several and they move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from arm3dof.model.robot import Robot
from arm3dof.state import Array
from arm3dof.ui import shapes
from arm3dof.ui.facets import Facets, facets
from arm3dof.ui.meshcat_scene import RobotDrawing
from arm3dof.ui.meshcat_window import Command


class Ghost:
    """A robot below one node of the scene, every link one mesh: a shape drawn costs as much."""

    def __init__(self, robot: Robot, path: str, color: Sequence[float]) -> None:
        """Create a ghost that is not drawn yet.

        Args:
            robot: what to draw.
            path: the node, for example ``/ghost``.
            color: red, green, blue and opacity from 0 to 1.
        """
        self._drawing, self._path = RobotDrawing(robot, path, color), path
        self._look = shapes.material(color, "Lambert", flatShading=True)

    def objects(self) -> list[Command]:
        """Return the commands that draw it."""
        cut = facets(self._drawing.pieces())
        commands: list[Command] = []
        for number, link in enumerate(self._drawing.link_names):
            corners = _triangles(cut, number)
            if corners.size:
                path = f"{self._drawing.node(link)}/0"
                faces = np.arange(len(corners)).reshape(-1, 3)
                commands += [
                    shapes.draw(path, shapes.triangles(corners, faces), self._look),
                    shapes.set_property(f"{path}/<object>", "castShadow", False),
                ]
        return commands

    def poses(self, q: Array) -> list[Command]:
        """Return the commands that put it to a configuration, shape (nv,) [rad]."""
        return self._drawing.poses(q)

    def seen(self, visible: bool) -> Command:
        """Return the command that shows or hides it."""
        return shapes.set_property(self._path, "visible", visible)


def _triangles(cut: Facets, owner: int) -> Array:
    """Return the corners of an owner's triangles, shape (3 n, 3) [m]."""
    mine = [
        face[:count]
        for face, count in zip(cut.corners, cut.count, strict=True)
        if cut.owner[face[0]] == owner
    ]
    fans = [(face[0], face[k], face[k + 1]) for face in mine for k in range(1, len(face) - 1)]
    corners: Array = cut.points[np.array(fans, dtype=np.intp).ravel()]
    return corners
