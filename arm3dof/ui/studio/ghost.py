"""See-through copies of the arm: light to draw, for there may be several and they move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from arm3dof.state import Array
from arm3dof.ui import shapes
from arm3dof.ui.facets import Facets, Piece, facets, polygons
from arm3dof.ui.meshcat_window import Command
from arm3dof.ui.robot_drawing import RobotDrawing

_SIDES = 8  # of a cylinder: nobody looks at a ghost closely
_SMALL = 0.2  # of its link's longest piece; nobody misses a ghost's screws


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
        self._look = shapes.material(color, "Lambert")

    def objects(self, meshes: Mapping[str, shapes.Shape]) -> list[Command]:
        """Return the commands that draw it.

        Args:
            meshes: of ``link_meshes``.
        """
        commands: list[Command] = []
        for link, mesh in meshes.items():
            path = f"{self._path}/{link}/0"
            commands += [
                shapes.draw(path, mesh, self._look),
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


def link_meshes(drawing: RobotDrawing) -> dict[str, shapes.Shape]:
    """Return each link that moves as one mesh, which has no small pieces."""
    pieces = drawing.pieces()
    meshes = {}
    for number, link in enumerate(drawing.link_names):
        mine = [piece for piece in pieces if piece.owner == number]
        cut = facets(_large(mine), _SIDES)
        if len(cut.count) and drawing.moves(link):
            meshes[link] = _mesh(cut)
    return meshes


def _large(pieces: Sequence[Piece]) -> list[Piece]:
    """Return the pieces that are worth a look."""
    corners = [polygons(piece.shape, _SIDES)[0] for piece in pieces]
    lengths = [np.linalg.norm(np.ptp(it, axis=0)) if len(it) else 0.0 for it in corners]
    least = _SMALL * max(lengths, default=0.0)
    return [piece for piece, length in zip(pieces, lengths, strict=True) if length >= least]


def _mesh(cut: Facets) -> shapes.Shape:
    """Return flat faces as triangles, each face with corners and a normal of its own."""
    points, normals, triangles = [], [], []
    total = 0
    for face, count in zip(cut.corners, cut.count, strict=True):
        corners = cut.points[face[:count]]
        points.append(corners)
        normals.append(np.tile(_normal(corners), (count, 1)))
        triangles += [(total, total + k, total + k + 1) for k in range(1, count - 1)]
        total += count
    return shapes.triangles(
        np.concatenate(points), np.array(triangles), normals=np.concatenate(normals)
    )


def _normal(corners: Array) -> Array:
    """Return the unit normal of a face, shape (3,), from its corners, shape (n, 3) [m]."""
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    result: Array = normal / max(float(np.linalg.norm(normal)), 1e-15)
    return result
