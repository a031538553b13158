"""See-through copies of the arm: light to draw, for there may be several and they move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from arm3dof.state import Array
from arm3dof.ui import shapes
from arm3dof.ui.facets import Facets, facets
from arm3dof.ui.meshcat_window import Command
from arm3dof.ui.robot_drawing import RobotDrawing

_SIDES = 8  # of a cylinder: nobody looks at a ghost closely


class Ghost:
    """A robot below one node of the scene, every link one mesh: a shape drawn costs as much."""

    def __init__(self, drawing: RobotDrawing, path: str, color: Sequence[float]) -> None:
        """Create a ghost that is not drawn yet.

        Args:
            drawing: the robot; any number of ghosts may share it.
            path: the node, for example ``/ghost``.
            color: red, green, blue and opacity from 0 to 1.
        """
        self._drawing, self._path = drawing, path
        self._look = shapes.material(color, "Lambert", flatShading=True)

    def objects(self, meshes: Mapping[str, Array]) -> list[Command]:
        """Return the commands that draw it.

        Args:
            meshes: of ``link_meshes``.
        """
        commands: list[Command] = []
        for link, corners in meshes.items():
            if corners.size:
                path = f"{self._path}/{link}/0"
                faces = np.arange(len(corners)).reshape(-1, 3)
                commands += [
                    shapes.draw(path, shapes.triangles(corners, faces), self._look),
                    shapes.set_property(f"{path}/<object>", "castShadow", False),
                ]
        return commands

    def poses(self, q: Array) -> list[Command]:
        """Return the commands that put it to a configuration, shape (nv,) [rad]."""
        links = zip(self._drawing.link_names, self._drawing.placements(q), strict=True)
        return [shapes.pose(f"{self._path}/{name}", place) for name, place in links]

    def seen(self, visible: bool) -> Command:
        """Return the command that shows or hides it."""
        return shapes.set_property(self._path, "visible", visible)


def link_meshes(drawing: RobotDrawing) -> dict[str, Array]:
    """Return each link as one mesh: the corners of its triangles, shape (3 n, 3) [m]."""
    cut = facets(drawing.pieces(), _SIDES)
    return {link: _triangles(cut, number) for number, link in enumerate(drawing.link_names)}


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
