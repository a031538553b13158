"""Random drawn scenes whose truth is known, for the tests of the eye."""

from __future__ import annotations

import colorsys
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arm3dof.sim.scene import Light, Scene, draw
from arm3dof.sim.shapes import Ball, Box, Cylinder, Solid
from arm3dof.sim.table import Table
from arm3dof.vision.camera import Camera, intrinsics, look_at
from arm3dof.vision.colour import ColourTarget, HsvRange, Shape

WIDTH, HEIGHT = 640, 480

# name: hue of the paint, as a share of the circle, and the range that the eye is told
COLOURS = {
    "red": (0.0, HsvRange((173, 120, 40), (6, 255, 255))),
    "yellow": (0.14, HsvRange((20, 110, 50), (33, 255, 255))),
    "green": (0.36, HsvRange((45, 90, 30), (85, 255, 255))),
    "blue": (0.62, HsvRange((98, 100, 30), (128, 255, 255))),
    "purple": (0.79, HsvRange((132, 80, 30), (160, 255, 255))),
}
SHAPES: dict[str, Shape] = {"ball": "ball", "cylinder": "cylinder", "card": "flat"}
DULL = ((0.9, 0.9, 0.88), (0.5, 0.5, 0.5), (0.12, 0.12, 0.13), (0.45, 0.32, 0.22))


@dataclass(frozen=True)
class Trial:
    """A drawn picture and what is in it."""

    image: NDArray[np.uint8]
    camera: Camera
    target: ColourTarget
    solid: Solid
    centre: NDArray[np.float64]  # of the object, or of a card's near face, in the base frame


def paint(rng: np.random.Generator, name: str) -> tuple[float, float, float]:
    hue = (COLOURS[name][0] + rng.uniform(-0.01, 0.01)) % 1.0
    return colorsys.hsv_to_rgb(hue, rng.uniform(0.8, 0.97), rng.uniform(0.65, 0.95))


def random_trial(rng: np.random.Generator) -> Trial:
    """Draw one object of the target's colour among clutter, 0.15 to 0.6 m away."""
    name = str(rng.choice(list(COLOURS)))
    kind = str(rng.choice(["ball", "cylinder", "card"], p=[0.4, 0.4, 0.2]))
    focal = rng.uniform(520, 760)
    azimuth = rng.uniform(-math.pi, math.pi)
    pitch = 0.0 if kind == "card" else rng.uniform(0.15, 1.05)
    forward = np.array(
        [
            math.cos(azimuth) * math.cos(pitch),
            math.sin(azimuth) * math.cos(pitch),
            -math.sin(pitch),
        ]
    )
    eye = rng.uniform([-0.2, -0.3, 0.1], [0.3, 0.3, 0.3])
    matrix = intrinsics(focal, focal, 319.5 + rng.uniform(-8, 8), 239.5 + rng.uniform(-8, 8))
    camera = Camera(WIDTH, HEIGHT, matrix, np.zeros(0), look_at(eye, eye + forward))
    while True:
        depth = rng.uniform(0.15, 0.6)
        width = rng.uniform(0.02, 0.045)
        tall = rng.uniform(0.8, 1.8) * width
        # the whole of it is in the picture, and its centre below the lens as on a table
        margin = 0.5 * math.hypot(width, tall) * focal / (depth - 0.03) + 12
        spot = rng.uniform([0, 0], [WIDTH, HEIGHT])
        centre = camera.deproject(spot, depth)
        if min(*spot, *(WIDTH, HEIGHT) - spot) > margin and centre[2] < eye[2] - 0.02:
            break
    colour = paint(rng, name)
    at = (float(centre[0]), float(centre[1]), float(centre[2]))
    solid: Solid
    if kind == "ball":
        solid = Ball(at, width / 2, colour)
    elif kind == "cylinder":
        solid = Cylinder(at, width / 2, tall, colour)
    else:
        middle = centre + forward * 0.00005
        at = (float(middle[0]), float(middle[1]), float(middle[2]))
        solid = Box(at, (0.0001, width, tall), azimuth, colour)
    table = Table(height=at[2] - solid.half_height, centre=(at[0], at[1]), half_size=(0.7, 0.7))
    clutter = _clutter(rng, name, solid, camera, table.height)
    lamp = rng.uniform(0, 2 * math.pi)
    tilt = rng.uniform(0.0, 0.9)
    light = Light(
        direction=(
            math.cos(lamp) * math.sin(tilt),
            math.sin(lamp) * math.sin(tilt),
            math.cos(tilt),
        ),
        strength=rng.uniform(0.3, 0.75),
        ambient=rng.uniform(0.2, 0.45),
        softness=rng.uniform(0.02, 0.2),
    )
    scene = Scene((solid, *clutter), table, light, noise=rng.uniform(0.5, 5.0))
    image = draw(scene, matrix, camera.transform_base_camera, WIDTH, HEIGHT, rng)
    target = ColourTarget(name, COLOURS[name][1], width, SHAPES[kind])
    return Trial(image, camera, target, solid, centre)


def _clutter(
    rng: np.random.Generator, name: str, target: Solid, camera: Camera, table: float
) -> list[Solid]:
    """Stand up to six things of other colours about the target, none of them in its way."""
    others = [other for other in COLOURS if other != name]
    placed: list[Solid] = []
    for _ in range(int(rng.integers(2, 7))):
        for _ in range(20):
            size = float(rng.uniform(0.012, 0.05))
            height = float(rng.uniform(0.01, 0.06))
            x, y = np.asarray(target.centre[:2]) + rng.uniform(-0.2, 0.2, 2)
            dull = rng.random() < 0.4
            colour = DULL[rng.integers(len(DULL))] if dull else paint(rng, str(rng.choice(others)))
            thing: Solid
            match rng.integers(3):
                case 0:
                    thing = Ball((x, y, table + size / 2), size / 2, colour)
                case 1:
                    thing = Cylinder((x, y, table + height / 2), size / 2, height, colour)
                case _:
                    yaw = float(rng.uniform(0, math.pi))
                    thing = Box((x, y, table + height / 2), (size, size, height), yaw, colour)
            if all(_apart(thing, other) for other in (target, *placed)) and _clear(
                thing, target, camera
            ):
                placed.append(thing)
                break
    return placed


def _apart(first: Solid, second: Solid) -> bool:
    gap = float(np.linalg.norm(np.subtract(first.centre[:2], second.centre[:2])))
    return gap > first.bounding_radius + second.bounding_radius


def _clear(thing: Solid, target: Solid, camera: Camera) -> bool:
    """Whether a thing leaves the camera free and does not overlap the target in the picture."""
    points = camera.to_camera(np.array([thing.centre, target.centre]))
    ranges = np.linalg.norm(points, axis=1)
    if ranges[0] < thing.bounding_radius + 0.05:
        return False
    angle = math.acos(float(np.clip(points[0] @ points[1] / ranges.prod(), -1, 1)))
    reach = math.asin(thing.bounding_radius / ranges[0])
    reach += math.asin(target.bounding_radius / ranges[1])
    return angle > reach + 0.006
