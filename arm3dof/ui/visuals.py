"""What a robot looks like: the visual shapes of its URDF, link by link."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from arm3dof.model.geometry import LinkShape, link_shapes
from arm3dof.model.robot import Description
from arm3dof.state import Array
from arm3dof.ui import shapes

if TYPE_CHECKING:
    from arm3dof.ui.mesh_files import MeshPart

Color = tuple[float, float, float, float]

DEFAULT_COLOR: Color = (0.75, 0.78, 0.82, 1.0)
JOINT_COLOR: Color = (0.0, 0.447, 0.698, 1.0)

# points that bound unit shapes: a cube's corners, a cylinder's rims, a sphere
_CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
_TURN = np.linspace(0, 2 * np.pi, 16, endpoint=False)
_RIMS = np.array([(np.cos(a), np.sin(a), z) for a in _TURN for z in (-1.0, 1.0)])
_COMPASS = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
_DIRECTIONS = _COMPASS / np.linalg.norm(_COMPASS, axis=1, keepdims=True)


@dataclass(frozen=True)
class Visual:
    """One shape fixed to a link.

    Attributes:
        link: the link's name.
        shape: the geometry.
        color: its colour (red, green, blue, opacity).
        placement: pose of the shape in the link's frame, shape (4, 4).
        outline: points in the link's frame that bound the shape closely, shape (k, 3) [m].
        is_mesh: whether the shape comes from a mesh file.
    """

    link: str
    shape: shapes.Shape
    color: Color
    placement: Array
    outline: Array
    is_mesh: bool = False


def read_visuals(description: Description) -> tuple[tuple[Visual, ...], tuple[str, ...]]:
    """Read the visual shapes of a robot.

    Args:
        description: the URDF text and the folders of its meshes.

    Returns:
        The shapes, and the names of links whose meshes could not be found or read.
    """
    visuals: list[Visual] = []
    missing: list[str] = []
    for shape in link_shapes(description, "visual"):
        found = _visual(shape)
        visuals.extend(found)
        if not found and shape.link not in missing:
            missing.append(shape.link)
    return tuple(visuals), tuple(missing)


def _visual(shape: LinkShape) -> list[Visual]:
    placement = shape.placement.homogeneous
    if shape.kind == "mesh":
        from arm3dof.ui.mesh_files import read_mesh  # trimesh takes a second to import

        parts = read_mesh(shape.file)
        return [_mesh(shape.link, part, shape.colour, placement, shape.size) for part in parts]
    primitive, points = _primitive(shape)
    color = shape.colour or DEFAULT_COLOR
    return [Visual(shape.link, primitive, color, placement, _to(placement, points))]


def _primitive(shape: LinkShape) -> tuple[shapes.Shape, Array]:
    """Return a primitive and points that bound it, in its own frame."""
    if shape.kind == "box":
        return shapes.box(shape.size), _CORNERS * np.array(shape.size) / 2
    if shape.kind == "sphere":
        (radius,) = shape.size
        return shapes.sphere(radius), radius * _DIRECTIONS
    radius, length = shape.size
    return shapes.cylinder(radius, length), _RIMS * (radius, radius, length / 2)


def _mesh(
    link: str, part: MeshPart, color: Color | None, placement: Array, scale: Sequence[float]
) -> Visual:
    vertices = part.vertices * scale
    farthest = np.unique(np.argmax(vertices @ _DIRECTIONS.T, axis=0))
    return Visual(
        link,
        shapes.triangles(vertices, part.faces, normals=part.normals),
        color or part.color or DEFAULT_COLOR,
        placement,
        _to(placement, vertices[farthest]),
        is_mesh=True,
    )


def _to(placement: Array, points: Array) -> Array:
    """Take points from a frame to the one it is placed in."""
    return np.asarray(points @ placement[:3, :3].T + placement[:3, 3])


# ---- stand-ins ---------------------------------------------------------------------------------


def stick_figure(model: pin.Model, tool_frame: str, drawn: set[str]) -> tuple[Visual, ...]:
    """Return bars and balls for the bodies of a robot that have nothing else to show.

    Args:
        model: the robot's model.
        tool_frame: where the last bar ends.
        drawn: links that have shapes of their own.
    """
    ends: dict[int, list[Array]] = {joint: [] for joint in range(model.njoints)}
    for joint in range(1, model.njoints):
        ends[model.parents[joint]].append(np.array(model.jointPlacements[joint].translation))
    tool = model.frames[model.getFrameId(tool_frame)]
    ends[tool.parentJoint].append(np.array(tool.placement.translation))
    size = sum(float(np.linalg.norm(end)) for group in ends.values() for end in group)
    radius = 0.03 * (size or 1.0)
    bodies: dict[int, list[pin.Frame]] = {joint: [] for joint in range(model.njoints)}
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            bodies[frame.parentJoint].append(frame)
    figure: list[Visual] = []
    for joint, frames in bodies.items():
        if frames and not any(frame.name in drawn for frame in frames):
            figure += _stick_body(frames[0], ends[joint], radius)
    return tuple(figure)


def _stick_body(frame: pin.Frame, ends: Sequence[Array], radius: float) -> list[Visual]:
    """Return a ball at a body's joint and a bar to each end, in the frame of its first link."""
    to_link = frame.placement.inverse()
    place = to_link.homogeneous
    ball = _to(place, radius * _DIRECTIONS)
    figure = [Visual(frame.name, shapes.sphere(radius), JOINT_COLOR, place, ball)]
    for end in ends:
        length = float(np.linalg.norm(end))
        if length > radius:
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end).matrix()
            place = (to_link * pin.SE3(turn, end / 2)).homogeneous
            rims = _to(place, _RIMS * (0.6 * radius, 0.6 * radius, length / 2))
            bar = shapes.cylinder(0.6 * radius, length)
            figure.append(Visual(frame.name, bar, DEFAULT_COLOR, place, rims))
    return figure
