"""Mesh files (STL, DAE, OBJ) as triangles that are light enough for a page.

A robot's meshes can hold millions of triangles. They are thinned by merging the vertices of each
cell of a fine grid, and the normals are made so that curved faces look round and edges sharp.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from arm3dof.state import Array

Faces = NDArray[np.int64]
Color = tuple[float, float, float, float]

MAX_FACES = 6000  # of one file
MIN_CELLS = 24  # along the longest side, below which thinning would spoil the shape
CREASE = np.cos(np.deg2rad(35.0))  # faces that meet at a sharper angle keep their edge


@dataclass(frozen=True)
class MeshPart:
    """Triangles of one colour.

    Attributes:
        vertices: points, shape (n, 3) [m].
        faces: corners of each triangle, shape (m, 3).
        normals: unit normal at each vertex, shape (n, 3).
        color: (red, green, blue, opacity), or ``None`` when the file says nothing.
    """

    vertices: Array
    faces: Faces
    normals: Array
    color: Color | None


@lru_cache(maxsize=64)
def read_mesh(path: Path | None) -> tuple[MeshPart, ...]:
    """Read a mesh file and thin it.

    Args:
        path: the file; ``None`` stands for a file that is missing.

    Returns:
        Its parts; none when the file is missing, of an unknown format, or damaged.
    """
    if path is None:
        return ()
    try:
        loaded = trimesh.load_scene(path)
    except (OSError, ValueError, KeyError, IndexError, AttributeError, TypeError):
        return ()  # the readers behind trimesh raise any of these for a damaged file
    meshes = [mesh for mesh in loaded.dump() if isinstance(mesh, trimesh.Trimesh)]
    total = sum(len(mesh.faces) for mesh in meshes)
    parts = []
    for mesh in meshes:
        vertices, faces = _merge(np.asarray(mesh.vertices, float), np.asarray(mesh.faces))
        budget = MAX_FACES * len(mesh.faces) / total
        vertices, faces = thin(vertices, faces, int(budget))
        if len(faces):
            parts.append(MeshPart(*crease(vertices, faces), _color(mesh)))
    return tuple(parts)


def thin(vertices: Array, faces: Faces, budget: int) -> tuple[Array, Faces]:
    """Merge vertices on ever coarser grids until a mesh has at most ``budget`` faces.

    Args:
        vertices: points, shape (n, 3).
        faces: corners, shape (m, 3).
        budget: how many faces may stay; a small part keeps more than that.

    Returns:
        Vertices and faces of the lighter mesh.
    """
    extent = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    cells, light = 512, (vertices, faces)
    while len(light[1]) > budget and cells >= MIN_CELLS and extent > 0:
        light = _cluster(vertices, faces, extent / cells)
        cells = int(cells / 1.4)
    return light


def crease(vertices: Array, faces: Faces) -> tuple[Array, Faces, Array]:
    """Give each corner the mean normal of the faces that meet there smoothly.

    Args:
        vertices: points, each of them once, shape (n, 3).
        faces: corners, shape (m, 3), m > 0.

    Returns:
        Vertices (split along sharp edges), faces and unit normals of the vertices.
    """
    corners = vertices[faces]
    area_normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(area_normal, axis=1, keepdims=True)
    unit = area_normal / np.where(length > 0, length, 1.0)
    # every pair (corner, face) that shares a vertex
    order = np.argsort(faces.ravel(), kind="stable")
    count = np.bincount(faces.ravel(), minlength=len(vertices))
    start = np.cumsum(count) - count
    repeats = count[faces.ravel()]
    corner = np.repeat(np.arange(faces.size), repeats)
    step = np.arange(corner.size) - np.repeat(np.cumsum(repeats) - repeats, repeats)
    neighbour = order[start[faces.ravel()[corner]] + step] // 3
    smooth = np.einsum("ij,ij->i", unit[corner // 3], unit[neighbour]) > CREASE
    total = np.zeros((faces.size, 3))
    np.add.at(total, corner[smooth], area_normal[neighbour[smooth]])
    norm = np.linalg.norm(total, axis=1, keepdims=True)
    normals = np.where(norm > 0, total / np.where(norm > 0, norm, 1.0), unit.repeat(3, axis=0))
    _, first, inverse = np.unique(
        _key(np.column_stack([faces.ravel(), np.round(normals * 64).astype(np.int64) + 64])),
        return_index=True,
        return_inverse=True,
    )
    return vertices[faces.ravel()[first]], inverse.reshape(-1, 3), normals[first]


def _merge(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Make one vertex of all that lie on the same spot."""
    extent = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    return _cluster(vertices, faces, max(extent, 1e-12) / (1 << 20))


def _cluster(vertices: Array, faces: Faces, cell: float) -> tuple[Array, Faces]:
    """Merge the vertices of each cell of a grid into their mean."""
    grid = np.floor((vertices - vertices.min(axis=0, initial=np.inf)) / cell).astype(np.int64)
    _, inverse, count = np.unique(_key(grid), return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(inverse, column) for column in vertices.T], axis=1)
    return mean / count[:, None], _proper(inverse[faces])


def _proper(faces: Faces) -> Faces:
    """Drop triangles that have become lines or points, and doubles."""
    a, b, c = faces.T
    kept = faces[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(_key(np.sort(kept, axis=1)), return_index=True)
    proper: Faces = kept[np.sort(first)]
    return proper


def _key(rows: Faces) -> Faces:
    """Pack each row of small non-negative integers into one: sorting those is far faster."""
    key = rows[:, 0]
    for column in rows.T[1:]:
        key = key * (int(column.max(initial=0)) + 1) + column
    return key


def _color(mesh: trimesh.Trimesh) -> Color | None:
    material = getattr(mesh.visual, "material", None)
    if material is None:
        return None
    red, green, blue, alpha = (float(part) / 255 for part in material.main_color)
    return red, green, blue, alpha
