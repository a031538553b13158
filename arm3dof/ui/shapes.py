"""MeshCat commands for shapes, lights and poses: plain data in three.js's object format.

Geometry ids are made from paths, so the same scene is the same bytes every time. Lengths are
metres; colours are (red, green, blue[, opacity]) from 0 to 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import msgpack
import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm3dof.state import Array
from arm3dof.ui.meshcat_window import Command

Color = Sequence[float]

# msgpack extension codes that the viewer turns into typed arrays
_TYPED = {
    "float32": (0x17, "Float32Array"),
    "float64": (0x18, "Float64Array"),
    "uint32": (0x16, "Uint32Array"),
}
# three.js cylinders stand on y, those of a URDF on z
_Z_FROM_Y = (1.0, 0, 0, 0, 0, 0, 1.0, 0, 0, -1.0, 0, 0, 0, 0, 0, 1.0)
_IDENTITY = tuple(np.eye(4).ravel().tolist())


@dataclass(frozen=True)
class Shape:
    """A geometry in three.js's terms.

    Attributes:
        data: type and parameters of the geometry.
        matrix: pose of the geometry in its node, 16 numbers column by column.
    """

    data: Mapping[str, object]
    matrix: tuple[float, ...] = _IDENTITY


def box(size: Sequence[float]) -> Shape:
    """Return a box with edges along the axes."""
    return Shape(
        {
            "type": "BoxGeometry",
            "width": float(size[0]),
            "height": float(size[1]),
            "depth": float(size[2]),
        }
    )


def cylinder(radius: float, length: float, top_radius: float | None = None) -> Shape:
    """Return a cylinder about z, centred; a cone when ``top_radius`` differs."""
    return Shape(
        {
            "type": "CylinderGeometry",
            "radiusTop": float(radius if top_radius is None else top_radius),
            "radiusBottom": float(radius),
            "height": float(length),
            "radialSegments": _sides(max(radius, top_radius or 0.0)),
        },
        _Z_FROM_Y,
    )


def _sides(radius: float) -> int:
    """Return how many flat sides stand for a round one: few where it is thin, up to 32."""
    return 2 * round(min(max(6 + 0.5 * radius / 1e-3, 6), 16))


def sphere(radius: float) -> Shape:
    """Return a sphere."""
    sides = 2 * round(min(max(5 + 0.3 * radius / 1e-3, 6), 14))
    return Shape(
        {
            "type": "SphereGeometry",
            "radius": float(radius),
            "widthSegments": sides,
            "heightSegments": round(0.64 * sides),
        }
    )


def torus(radius: float, tube: float) -> Shape:
    """Return a ring in the x-y plane."""
    return Shape(
        {
            "type": "TorusGeometry",
            "radius": float(radius),
            "tube": float(tube),
            "radialSegments": 6,
            "tubularSegments": 36,
        }
    )


def triangles(
    vertices: ArrayLike,
    faces: ArrayLike | None = None,
    *,
    colors: ArrayLike | None = None,
    normals: ArrayLike | None = None,
) -> Shape:
    """Return a mesh, or the points of lines when there are no faces.

    Args:
        vertices: points, shape (n, 3) [m].
        faces: indices of each triangle's corners, shape (m, 3).
        colors: colour of each vertex, shape (n, 3) or (n, 4).
        normals: unit normal of each vertex, shape (n, 3); the viewer makes them when missing.
    """
    attributes = {"position": _attribute(vertices)}
    if colors is not None:
        attributes["color"] = _attribute(colors)
    if normals is not None:
        attributes["normal"] = _attribute(normals)
    data: dict[str, object] = {"attributes": attributes}
    if faces is not None:
        corners = np.asarray(faces, dtype=np.uint32).ravel()
        data["index"] = {"type": "Uint32Array", "array": typed_array(corners), "itemSize": 1}
    return Shape({"type": "BufferGeometry", "data": data})


def typed_array(values: NDArray[np.generic]) -> msgpack.ExtType:
    """Return an array as the viewer's typed array of the same kind of number."""
    code, _ = _TYPED[values.dtype.name]
    return msgpack.ExtType(code, np.ascontiguousarray(values).tobytes())


def material(
    color: Color,
    kind: Literal["Standard", "Phong", "Basic", "Lambert"] = "Standard",
    **properties: object,
) -> dict[str, object]:
    """Return a material; a fourth number in the colour makes it see-through.

    Args:
        color: (red, green, blue[, opacity]).
        kind: which of three.js's mesh materials.
        properties: further properties of that material.
    """
    look: dict[str, object] = {"type": f"Mesh{kind}Material", "color": hex_color(color)}
    if kind == "Standard":
        look |= {"roughness": 0.55, "metalness": 0.05}
    if len(color) > 3 and color[3] < 1:
        look |= {"opacity": float(color[3]), "transparent": True, "depthWrite": False}
    return look | properties


def line_material(color: Color, **properties: object) -> dict[str, object]:
    """Return a material for lines."""
    look: dict[str, object] = {"type": "LineBasicMaterial", "color": hex_color(color)}
    if len(color) > 3 and color[3] < 1:
        look |= {"opacity": float(color[3]), "transparent": True}
    return look | properties


def hex_color(color: Color) -> int:
    """Return a colour as 0xRRGGBB."""
    red, green, blue = (round(255 * min(1.0, max(0.0, float(part)))) for part in color[:3])
    return red << 16 | green << 8 | blue


def draw(
    path: str,
    shape: Shape,
    look: Mapping[str, object],
    kind: Literal["Mesh", "LineSegments", "Line"] = "Mesh",
) -> Command:
    """Return the command that puts a shape at a path.

    Args:
        path: node of the scene.
        shape: the geometry.
        look: the material.
        kind: how the vertices are joined.
    """
    geometry, surface = f"{path}#geometry", f"{path}#material"
    return {
        "type": "set_object",
        "path": path,
        "object": {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [{"uuid": geometry, **shape.data}],
            "materials": [{"uuid": surface, **look}],
            "object": {
                "uuid": path,
                "type": kind,
                "geometry": geometry,
                "material": surface,
                "matrix": list(shape.matrix),
            },
        },
    }


def draw_light(path: str, light: Mapping[str, object], position: Sequence[float]) -> Command:
    """Return the command that puts a light at a path, shining on the origin.

    Args:
        path: node of the scene.
        light: type and parameters of three.js's light.
        position: where it stands, (x, y, z) [m].
    """
    matrix = [*_IDENTITY[:12], *map(float, position), 1.0]
    return {
        "type": "set_object",
        "path": path,
        "object": {
            "metadata": {"version": 4.5, "type": "Object"},
            "object": {"uuid": path, "matrix": matrix, **light},
        },
    }


def pose(path: str, transform: Array) -> Command:
    """Return the command that sets a node's pose in its parent, from a (4, 4) matrix."""
    return {"type": "set_transform", "path": path, "matrix": transform.T.ravel().tolist()}


def move(path: str, point: ArrayLike) -> Command:
    """Return the command that moves a node to a point of its parent, shape (3,) [m]."""
    transform = np.eye(4)
    transform[:3, 3] = point
    return pose(path, transform)


def set_property(path: str, name: str, value: object) -> Command:
    """Return the command that sets a property of a node."""
    return {"type": "set_property", "path": path, "property": name, "value": value}


def delete(path: str) -> Command:
    """Return the command that removes a node and all below it."""
    return {"type": "delete", "path": path}


def _attribute(values: ArrayLike) -> dict[str, object]:
    numbers = np.asarray(values, dtype=np.float32)
    return {
        "itemSize": int(numbers.shape[1]),
        "type": "Float32Array",
        "array": typed_array(numbers),
        "normalized": False,
    }
