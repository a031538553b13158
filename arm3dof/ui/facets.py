"""The shapes of a robot as flat convex faces, for drawing without a browser."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

from arm3dof.state import Array
from arm3dof.ui.shapes import Shape

SIDES = 28  # of a cylinder
_RINGS = 10  # of a sphere from pole to pole
_MAX_TRIANGLES = 900  # of one mesh; a finer one is made coarser
_QUADS = ((0, 1, 2, 3), (7, 6, 5, 4), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))


@dataclass(frozen=True, eq=False)
class Facets:
    """Flat convex faces, each fixed to one of several frames.

    Attributes:
        points: corners, each in the frame of its owner, shape (n, 3) [m].
        owner: index of each point's frame, shape (n,).
        corners: indices of each face's points, counter-clockwise from outside; a face of fewer
            corners repeats its last one, shape (f, k).
        count: how many corners each face has, shape (f,).
        color: of each face, red, green, blue from 0 to 1, shape (f, 3).
    """

    points: Array
    owner: NDArray[np.intp]
    corners: NDArray[np.intp]
    count: NDArray[np.intp]
    color: Array

    def placed(self, transforms: Array) -> Array:
        """Return the points in the frame that the owners' poses, shape (m, 4, 4), are in."""
        turned = np.einsum("nij,nj->ni", transforms[self.owner, :3, :3], self.points)
        result: Array = turned + transforms[self.owner, :3, 3]
        return result


@dataclass(frozen=True, eq=False)
class Piece:
    """One shape in the frame of its owner.

    Attributes:
        owner: index of the frame.
        shape: the geometry.
        placement: its pose in that frame, shape (4, 4).
        color: red, green, blue from 0 to 1.
    """

    owner: int
    shape: Shape
    placement: Array
    color: Sequence[float]


def facets(pieces: Iterable[Piece], sides: int = SIDES) -> Facets:
    """Cut shapes into flat convex faces.

    Args:
        pieces: the shapes.
        sides: of a cylinder, at most.
    """
    points, owner, faces, colors = [np.zeros((0, 3))], [], [], []
    total = 0
    for piece in pieces:
        corners, cut = polygons(piece.shape, sides)
        place = piece.placement @ np.reshape(piece.shape.matrix, (4, 4)).T
        points.append(corners @ place[:3, :3].T + place[:3, 3])
        owner += [piece.owner] * len(corners)
        faces += [[total + index for index in polygon] for polygon in cut]
        colors += [piece.color[:3]] * len(cut)
        total += len(corners)
    longest = max(map(len, faces), default=3)
    padded = [face + face[-1:] * (longest - len(face)) for face in faces]
    return Facets(
        np.concatenate(points),
        np.array(owner, dtype=np.intp),
        np.array(padded, dtype=np.intp).reshape(-1, longest),
        np.array([len(face) for face in faces], dtype=np.intp),
        np.array(colors, dtype=np.float64).reshape(-1, 3),
    )


# ---- shapes in three.js's terms ----------------------------------------------------------------

_Polygons = tuple[Array, Sequence[Sequence[int]]]


def polygons(shape: Shape, sides: int = SIDES) -> _Polygons:
    """Return the corners, shape (n, 3), and faces of a shape in its own frame.

    Args:
        shape: the shape.
        sides: of a cylinder, at most.
    """
    data: Mapping[str, Any] = shape.data
    match data["type"]:
        case "BoxGeometry":
            return _box(data["width"], data["height"], data["depth"])
        case "CylinderGeometry":
            sides = min(sides, data["radialSegments"])
            return _cylinder(data["radiusTop"], data["radiusBottom"], data["height"], sides)
        case "SphereGeometry":
            return _sphere(data["radius"])
        case "BufferGeometry" if "index" in data["data"]:
            return _mesh(data["data"])
        case _:  # lines and rings have no faces
            return np.zeros((0, 3)), ()


def _box(x: float, y: float, z: float) -> _Polygons:
    signs = [(-1, -1), (-1, 1), (1, 1), (1, -1)]
    corners = [(*sign, level) for level in (-1, 1) for sign in signs]
    return np.array(corners) * (x / 2, y / 2, z / 2), _QUADS


def _cylinder(top: float, bottom: float, height: float, sides: int) -> _Polygons:
    """Return a cylinder about y, as three.js has it."""
    angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    rim = np.column_stack([np.sin(angles), np.zeros(sides), np.cos(angles)])
    up = np.array([0.0, height / 2, 0.0])
    after = [(k + 1) % sides for k in range(sides)]
    walls = [(k, after[k], sides + after[k], sides + k) for k in range(sides)]
    caps = [tuple(range(sides - 1, -1, -1)), tuple(range(sides, 2 * sides))]
    return np.concatenate([bottom * rim - up, top * rim + up]), [*walls, *caps]


def _sphere(radius: float) -> _Polygons:
    turn = np.linspace(0, 2 * np.pi, 2 * _RINGS, endpoint=False)
    tilt = np.linspace(0, np.pi, _RINGS + 1)[:, None]
    shape = (len(tilt), len(turn))
    rings = [np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn)]
    points = radius * np.stack([*rings, np.broadcast_to(np.cos(tilt), shape)], axis=-1)
    wide = len(turn)
    faces = []
    for ring in range(_RINGS):
        for k in range(wide):
            a, b = ring * wide + k, ring * wide + (k + 1) % wide
            faces.append((a, a + wide, b + wide, b))
    return points.reshape(-1, 3), faces


def _mesh(data: Mapping[str, Any]) -> _Polygons:
    points = _unpacked(data["attributes"]["position"]["array"], np.float32).reshape(-1, 3)
    faces = _unpacked(data["index"]["array"], np.uint32).reshape(-1, 3).astype(np.intp)
    points, faces = _coarser(points.astype(np.float64), faces)
    return points, faces.tolist()


def _unpacked(packed: msgpack.ExtType, kind: type[np.generic]) -> NDArray[Any]:
    return np.frombuffer(packed.data, kind)


def _coarser(points: Array, faces: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
    """Merge points of a mesh on ever coarser grids until few enough triangles are left."""
    size = float(np.ptp(points, axis=0).max(initial=0.0))
    cells = 48
    while len(faces) > _MAX_TRIANGLES and cells > 4:
        keys = np.floor((points - points.min(axis=0)) / (size / cells)).astype(np.int64)
        _, first, merged = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        mapped = merged.reshape(-1)[faces]
        a, b, c = mapped.T
        kept = mapped[(a != b) & (b != c) & (c != a)]
        if len(kept) <= _MAX_TRIANGLES or cells <= 6:
            return points[first], np.unique(kept, axis=0)
        cells = cells * 3 // 4
    return points, faces
