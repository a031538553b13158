"""A robot as the primitives that Foxglove draws: one entity a link, fixed to the link's frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm3dof.sim.world import World
from arm3dof.state import Array
from arm3dof.ui.facets import polygons
from arm3dof.ui.mcap_schemas import color, quaternion, vector
from arm3dof.ui.shapes import Shape
from arm3dof.ui.things import bin_parts, body_parts
from arm3dof.ui.visuals import Visual

Entity = dict[str, Any]

_NOW = {"sec": 0, "nsec": 0}
_Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])


def pose(transform: Array) -> dict[str, dict[str, float]]:
    """Return a (4, 4) pose as position and orientation."""
    x, y, z, *turn = pin.SE3ToXYZQUAT(pin.SE3(transform))
    return {"position": vector((x, y, z)), "orientation": quaternion(turn)}


def robot_entities(visuals: Iterable[Visual]) -> list[Entity]:
    """Return what is drawn of a robot, link by link."""
    entities: dict[str, Entity] = {}
    for each in visuals:
        entity = entities.setdefault(each.link, _entity(each.link, f"robot/{each.link}"))
        _add(entity, each.shape, each.placement, each.color)
    return list(entities.values())


def world_entities(world: World, frame: str) -> list[Entity]:
    """Return objects, each in a frame of its own (``thing_frame``), and bins.

    Args:
        world: what stands around the arm.
        frame: the base frame.
    """
    entities = []
    for body in world.bodies:
        entities.append(_entity(thing_frame(body.name), f"things/{body.name}"))
        for part in body_parts(body):
            _add(entities[-1], part.shape, _at(part.middle), body.colour)
    for tray in world.bins:
        entities.append(_entity(frame, f"bins/{tray.name}"))
        foot = np.array([tray.x, tray.y, world.table.height])
        for part in bin_parts(tray):
            _add(entities[-1], part.shape, _at(foot + part.middle), tray.colour)
    return entities


def thing_frame(name: str) -> str:
    """Return the frame of an object's middle."""
    return f"things/{name}"


def target_entity(frame: str, point: ArrayLike, radius: float, tone: Sequence[float]) -> Entity:
    """Return the target as a ball.

    Args:
        frame: the frame that the point is in.
        point: shape (3,) [m].
        radius: [m].
        tone: its colour.
    """
    ball = {"pose": pose(_at(point)), "size": vector([2 * radius] * 3), "color": color(tone)}
    return _entity(frame, "target") | {"spheres": [ball]}


def path_entity(frame: str, points: Array, tone: Sequence[float]) -> Entity:
    """Return a path as a line.

    Args:
        frame: the frame that the points are in.
        points: shape (n, 3) [m].
        tone: its colour.
    """
    line = {
        "type": 0,
        "pose": pose(np.eye(4)),
        "thickness": 2.0,
        "scale_invariant": True,
        "points": [vector(point) for point in points],
        "color": color(tone),
    }
    return _entity(frame, "path") | {"lines": [line]}


def _entity(frame: str, name: str) -> Entity:
    return {
        "timestamp": _NOW,
        "frame_id": frame,
        "id": name,
        "lifetime": _NOW,  # for ever
        "frame_locked": True,
        "cubes": [],
        "spheres": [],
        "cylinders": [],
        "lines": [],
        "triangles": [],
    }


def _at(point: ArrayLike) -> Array:
    place = np.eye(4)
    place[:3, 3] = point
    return place


def _add(entity: Entity, shape: Shape, placement: Array, tone: Sequence[float]) -> None:
    place = placement @ np.reshape(shape.matrix, (4, 4)).T
    data: Any = shape.data
    look = {"color": color(tone)}
    match data["type"]:
        case "BoxGeometry":
            size = (data["width"], data["height"], data["depth"])
            entity["cubes"].append({"pose": pose(place), "size": vector(size)} | look)
        case "SphereGeometry":
            size = (2 * data["radius"],) * 3
            entity["spheres"].append({"pose": pose(place), "size": vector(size)} | look)
        case "CylinderGeometry":  # about y in three.js, about z in Foxglove
            top, bottom = data["radiusTop"], data["radiusBottom"]
            widest = max(top, bottom)
            size = (2 * widest, 2 * widest, data["height"])
            scales = {"bottom_scale": bottom / widest, "top_scale": top / widest}
            upright = {"pose": pose(place @ _Y_TO_Z.T), "size": vector(size)}
            entity["cylinders"].append(upright | scales | look)
        case _:
            points, faces = polygons(shape)
            corners = [index for face in faces for index in face]
            listed = {"points": [vector(point) for point in points], "indices": corners}
            entity["triangles"].append({"pose": pose(place)} | listed | look)
