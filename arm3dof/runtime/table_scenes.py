"""Random scenes on a table whose truth is known, to find out how well the eye sees.

A camera 0.15 to 0.6 m away looks at one to three objects of colours that it knows, among clutter
of other colours, under a lamp that may be bright, dim, high or low.
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from arm3dof.sim.scene import Light, Scene
from arm3dof.sim.shapes import Ball, Box, Cylinder, Solid
from arm3dof.sim.table import Table
from arm3dof.state import Array
from arm3dof.vision.camera import Camera, intrinsics, look_at
from arm3dof.vision.colour import ColourTarget, HsvRange, Shape

WIDTH, HEIGHT = 640, 480
NEAREST, FARTHEST = 0.15, 0.6
"""Depths of the objects' centres [m]."""

# name: hue of the paint, as a share of the circle, and the range that the eye is told
COLOURS = {
    "red": (0.0, HsvRange((173, 120, 20), (6, 255, 255))),
    "yellow": (0.14, HsvRange((20, 110, 20), (33, 255, 255))),
    "green": (0.36, HsvRange((45, 90, 20), (85, 255, 255))),
    "blue": (0.62, HsvRange((98, 100, 20), (128, 255, 255))),
    "purple": (0.79, HsvRange((132, 80, 20), (160, 255, 255))),
}
SHAPES: dict[str, Shape] = {
    "ball": "ball",
    "cylinder": "cylinder",
    "card": "flat",
    "cube": "cube",
    "bottle": "bottle",
}
_DULL = ((0.9, 0.9, 0.88), (0.5, 0.5, 0.5), (0.12, 0.12, 0.13), (0.45, 0.32, 0.22))
_KNOWN = 3  # colours that the eye looks for in each picture


@dataclass(frozen=True)
class Placed:
    """An object that the eye ought to find.

    Attributes:
        target: what the eye is told about it.
        solid: the object.
        centre: of the object, or of a card's near face, in the base frame, shape (3,) [m].
    """

    target: ColourTarget
    solid: Solid
    centre: Array


@dataclass(frozen=True)
class TableScene:
    """A scene, the camera before it, and what is to be found.

    Attributes:
        scene: all that stands on the table, and the light.
        camera: the camera.
        placed: the objects of known colours, all of them wholly in view.
        targets: what the eye looks for: their colours, and others that are not there.
        exposure: brightness of the light over that which exposes the picture well.
    """

    scene: Scene
    camera: Camera
    placed: tuple[Placed, ...]
    targets: tuple[ColourTarget, ...]
    exposure: float


def random_scene(
    rng: np.random.Generator,
    kinds: Sequence[str] = ("ball", "cylinder", "cube", "card"),
    most: int = 3,
) -> TableScene:
    """Set a table.

    Args:
        rng: decides everything.
        kinds: the shapes that objects may have, of ``SHAPES``.
        most: the greatest number of objects to be found.
    """
    colours = [str(name) for name in rng.permutation(list(COLOURS))]
    known, others = colours[:_KNOWN], colours[_KNOWN:]
    kind = str(rng.choice(list(kinds)))
    camera = _camera(rng, level=kind == "card")
    first = _first(rng, camera, kind, known[0])
    z = first.solid.centre[2] - first.solid.half_height
    table = Table(height=z, centre=first.solid.centre[:2], half_size=(0.7, 0.7))
    placed = [first]
    for name in known[1 : 1 + int(rng.integers(0, most))]:
        kind = str(rng.choice([it for it in kinds if it != "card"] or ["cylinder"]))
        if (other := _beside(rng, camera, kind, name, table, placed)) is not None:
            placed.append(other)
    absent = [ColourTarget(it, COLOURS[it][1], 0.03, "cylinder") for it in known]
    targets = {it.name: it for it in absent} | {it.target.name: it.target for it in placed}
    light, exposure = _light(rng)
    clutter = _clutter(rng, camera, others, table, [it.solid for it in placed])
    scene = Scene(
        (*(it.solid for it in placed), *clutter), table, light, noise=float(rng.uniform(0.5, 5.0))
    )
    return TableScene(scene, camera, tuple(placed), tuple(targets.values()), exposure)


def paint(rng: np.random.Generator, name: str) -> tuple[float, float, float]:
    """Mix a paint of one of ``COLOURS``, sRGB, 0 to 1."""
    hue = (COLOURS[name][0] + rng.uniform(-0.01, 0.01)) % 1.0
    return colorsys.hsv_to_rgb(hue, rng.uniform(0.8, 0.97), rng.uniform(0.65, 0.95))


def _camera(rng: np.random.Generator, *, level: bool) -> Camera:
    focal = rng.uniform(520, 760)
    azimuth = rng.uniform(-math.pi, math.pi)
    pitch = 0.0 if level else rng.uniform(0.15, 1.05)
    flat = math.cos(pitch)
    forward = np.array([math.cos(azimuth) * flat, math.sin(azimuth) * flat, -math.sin(pitch)])
    eye = rng.uniform([-0.2, -0.3, 0.1], [0.3, 0.3, 0.3])
    matrix = intrinsics(focal, focal, 319.5 + rng.uniform(-8, 8), 239.5 + rng.uniform(-8, 8))
    pose = look_at(eye, eye + forward)
    return Camera(WIDTH, HEIGHT, matrix, np.zeros(0), pose)


def _light(rng: np.random.Generator) -> tuple[Light, float]:
    """Hang a lamp, from 0.3 to 2 times as bright as the picture would like."""
    turn, tilt = rng.uniform(0, 2 * math.pi), rng.uniform(0.0, 0.9)
    aside = math.sin(tilt)
    exposure = float(np.exp(rng.uniform(math.log(0.3), math.log(2.0))))
    share = rng.uniform(0.25, 0.45)  # of the light that comes from all round
    lamp = Light(
        direction=(math.cos(turn) * aside, math.sin(turn) * aside, math.cos(tilt)),
        strength=exposure * (1 - share),
        ambient=exposure * share,
        softness=rng.uniform(0.02, 0.2),
    )
    return lamp, exposure


def _first(rng: np.random.Generator, camera: Camera, kind: str, name: str) -> Placed:
    """Put an object into the picture, and by that decide how high the table is."""
    forward = camera.transform_base_camera[:3, 2]
    while True:
        width, tall = _size(rng, kind)
        spot, depth = rng.uniform([0, 0], [WIDTH, HEIGHT]), rng.uniform(NEAREST, FARTHEST)
        centre = camera.deproject(spot, depth)
        if _whole(camera, centre, width, tall) and centre[2] < camera.position[2] - 0.02:
            break
    if kind == "card":
        yaw = math.atan2(forward[1], forward[0])
        middle = _point(centre + forward * 0.00005)
        solid: Solid = Box(middle, (0.0001, width, tall), yaw, paint(rng, name))
    else:
        solid = _solid(rng, kind, _point(centre), width, tall, name)
    target = ColourTarget(name, COLOURS[name][1], width, SHAPES[kind])
    return Placed(target, solid, centre)


def _beside(
    rng: np.random.Generator,
    camera: Camera,
    kind: str,
    name: str,
    table: Table,
    placed: Sequence[Placed],
) -> Placed | None:
    """Put another object on the table, wholly in view; none when there is no room."""
    for _ in range(60):
        width, tall = _size(rng, kind)
        x, y = np.asarray(table.centre) + rng.uniform(-0.25, 0.25, 2)
        centre = np.array([x, y, table.height + tall / 2])
        depth = float(camera.to_camera(centre)[2])
        if not (NEAREST <= depth <= FARTHEST and _whole(camera, centre, width, tall)):
            continue
        solid = _solid(rng, kind, _point(centre), width, tall, name)
        if all(_apart(solid, it.solid) and _parted(solid, it.solid, camera) for it in placed):
            target = ColourTarget(name, COLOURS[name][1], width, SHAPES[kind])
            return Placed(target, solid, centre)
    return None


def _size(rng: np.random.Generator, kind: str) -> tuple[float, float]:
    """Choose a width and a height [m]."""
    width = float(rng.uniform(0.02, 0.045))
    return width, width if kind in ("ball", "cube") else float(rng.uniform(0.8, 1.8)) * width


def _solid(
    rng: np.random.Generator,
    kind: str,
    at: tuple[float, float, float],
    width: float,
    tall: float,
    name: str,
) -> Solid:
    colour = paint(rng, name)
    match kind:
        case "ball":
            return Ball(at, width / 2, colour)
        case "cylinder" | "bottle":
            return Cylinder(at, width / 2, tall, colour)
        case _:
            return Box(at, (width, width, tall), float(rng.uniform(0, math.pi / 2)), colour)


def _whole(camera: Camera, centre: Array, width: float, tall: float) -> bool:
    """Whether an object is wholly in the picture, with some pixels to spare."""
    depth = float(camera.to_camera(centre)[2])
    if depth < 0.06:
        return False
    spot = camera.project(centre)
    margin = 0.5 * math.hypot(1.42 * width, tall) * camera.focal_px[0] / (depth - 0.03) + 12
    return bool(min(*spot, *(WIDTH, HEIGHT) - spot) > margin)


def _clutter(
    rng: np.random.Generator,
    camera: Camera,
    colours: Sequence[str],
    table: Table,
    targets: Sequence[Solid],
) -> list[Solid]:
    """Stand up to six things of other colours about the targets, none of them in their way."""
    placed: list[Solid] = []
    for _ in range(int(rng.integers(2, 7))):
        for _ in range(20):
            size, height = float(rng.uniform(0.012, 0.05)), float(rng.uniform(0.01, 0.06))
            x, y = np.asarray(table.centre) + rng.uniform(-0.2, 0.2, 2)
            lying, standing = (x, y, table.height + size / 2), (x, y, table.height + height / 2)
            dull = rng.random() < 0.4
            colour = _DULL[rng.integers(len(_DULL))] if dull else paint(rng, rng.choice(colours))
            thing: Solid
            match rng.integers(3):
                case 0:
                    thing = Ball(lying, size / 2, colour)
                case 1:
                    thing = Cylinder(standing, size / 2, height, colour)
                case _:
                    yaw = float(rng.uniform(0, math.pi))
                    thing = Box(standing, (size, size, height), yaw, colour)
            if all(_apart(thing, other) for other in (*targets, *placed)) and all(
                _parted(thing, target, camera) for target in targets
            ):
                placed.append(thing)
                break
    return placed


def _apart(first: Solid, second: Solid) -> bool:
    gap = float(np.linalg.norm(np.subtract(first.centre[:2], second.centre[:2])))
    return gap > first.bounding_radius + second.bounding_radius


def _parted(thing: Solid, target: Solid, camera: Camera) -> bool:
    """Whether a thing leaves the camera free and does not overlap the target in the picture."""
    points = camera.to_camera(np.array([thing.centre, target.centre]))
    ranges = np.linalg.norm(points, axis=1)
    if ranges[0] < thing.bounding_radius + 0.05:
        return False
    angle = math.acos(float(np.clip(points[0] @ points[1] / ranges.prod(), -1, 1)))
    reach = math.asin(thing.bounding_radius / ranges[0])
    reach += math.asin(target.bounding_radius / ranges[1])
    return angle > reach + 0.006


def _point(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
