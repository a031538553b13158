"""A small world drawn by casting rays: a table, coloured solids, one soft lamp, a noisy sensor.

It shares nothing with the package's eye. Perspective, silhouettes and shading come from the
rays alone, so a depth that the eye reads from such a picture is checked by an independent engine.
Points, directions and colours are columns, shape (3, n).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm3dof.errors import InputError
from arm3dof.sim.shapes import Faces, Reals, Solid
from arm3dof.sim.table import Shadow, Table
from arm3dof.state import Array, frozen_array

Image = NDArray[np.uint8]

_BLOCK = 1 << 14  # rays shaded at a time: the temporaries stay inside the second-level cache
_SUPERSAMPLE = 4  # rays to a side in a pixel on an edge
_LAMP_RAYS = 16  # places of the lamp that a shadow on the table is made of
_GAMMA = 2.2
_FACES = 8  # a surface's id is _FACES * owner + face; owner 0 is the wall, 1 the table
_WALL, _TABLE, _FIRST = 0, 1, 2
_TONES = 255 * np.linspace(0, 1, 4096, dtype=np.float32) ** np.float32(1 / _GAMMA)


@dataclass(frozen=True)
class Light:
    """One soft lamp far away, and the light that comes from all round.

    Attributes:
        direction: points from the scene to the lamp; any length.
        strength: how bright the lamp is; 0.62 exposes the picture well.
        ambient: light from all round.
        softness: angular radius of the lamp [rad]; it sets the width of a shadow's edge.

    Raises:
        InputError: the lamp is below the table, or a strength is negative.
    """

    direction: tuple[float, float, float] = (0.45, 0.30, 1.0)
    strength: float = 0.62
    ambient: float = 0.36
    softness: float = 0.12

    def __post_init__(self) -> None:
        direction = frozen_array(self.direction, 3, name="direction")
        if not (np.isfinite(direction).all() and direction[2] > 0):
            raise InputError(f"direction is {self.direction}; give a lamp above the table, z > 0")
        for name in ("strength", "ambient", "softness"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"{name} is {value}; give a number, 0 or more")

    @property
    def unit(self) -> Array:
        """Unit vector towards the lamp, shape (3, 1)."""
        direction = np.array(self.direction, dtype=np.float64)[:, None]
        result: Array = direction / np.linalg.norm(direction)
        return result

    def places(self, count: int) -> Array:
        """Spread unit vectors evenly over the lamp's disc, shape (3, count)."""
        index = np.arange(count) + 0.5
        radius = self.softness * np.sqrt(index / count)
        angle = index * math.pi * (3 - math.sqrt(5))
        # an orthonormal frame about the lamp's direction, which is never straight down
        x, y, z = self.unit[:, 0]
        aside = np.array([1 - x * x / (1 + z), -x * y / (1 + z), -x])[:, None]
        other = np.array([-x * y / (1 + z), 1 - y * y / (1 + z), -y])[:, None]
        rays = self.unit + aside * (radius * np.cos(angle)) + other * (radius * np.sin(angle))
        # a lamp near the horizon keeps all of its places above it
        rays[2] = np.maximum(rays[2], 0.05)
        result: Array = rays / np.linalg.norm(rays, axis=0)
        return result


@dataclass(frozen=True)
class Scene:
    """What stands on the table, and how it is lit and seen.

    Attributes:
        solids: the objects.
        table: the table they stand on.
        light: the light.
        noise: standard deviation of the sensor's noise [grey levels].
    """

    solids: tuple[Solid, ...]
    table: Table = field(default_factory=Table)
    light: Light = field(default_factory=Light)
    noise: float = 2.0


def draw(
    scene: Scene,
    camera_matrix: ArrayLike,
    transform_base_camera: ArrayLike,
    width: int,
    height: int,
    rng: np.random.Generator | None = None,
) -> Image:
    """Draw the scene as a pinhole camera without distortion sees it.

    Args:
        scene: what to draw.
        camera_matrix: intrinsics, shape (3, 3) [px].
        transform_base_camera: pose of the optical frame (x right, y down, z forward), (4, 4).
        width: picture width [px].
        height: picture height [px].
        rng: source of the sensor's noise; none without it.

    Returns:
        BGR picture, shape (height, width, 3), uint8.

    Raises:
        InputError: a matrix has another shape, or a size is less than 1.
    """
    if width < 1 or height < 1:
        raise InputError(f"the picture is {width} x {height} px; give sizes of 1 or more")
    picture = _Picture(
        scene,
        frozen_array(camera_matrix, 3, 3, name="camera_matrix"),
        frozen_array(transform_base_camera, 4, 4, name="transform_base_camera"),
        width,
        height,
    )
    linear = picture.linear()
    linear *= 4095
    linear += 0.5
    index = np.clip(linear, 0, 4095, out=linear).astype(np.int16)
    grey = _TONES.take(index[::-1].T)
    if rng is not None and scene.noise > 0:
        noise = rng.standard_normal(grey.shape, dtype=np.float32)
        noise *= np.float32(scene.noise)
        grey += noise
    grey += 0.5
    image: Image = np.clip(grey, 0, 255, out=grey).astype(np.uint8).reshape(height, width, 3)
    return image


class _Picture:
    """One picture in the making."""

    def __init__(self, scene: Scene, matrix: Array, pose: Array, width: int, height: int) -> None:
        self.scene, self.matrix, self.pose = scene, matrix, pose
        self.width, self.height = width, height
        self.eye = pose[:3, 3]
        lamps = scene.light.places(_LAMP_RAYS)
        self.shadows = [Shadow.cast(solid, scene.table.height, lamps) for solid in scene.solids]
        self.bounds = [self._bounds(solid) for solid in scene.solids]

    def linear(self) -> Reals:
        """Cast one ray a pixel, and more where surfaces meet; linear RGB, shape (3, n)."""
        width, height = self.width, self.height
        u = np.arange(width, dtype=np.float32)[None, :]
        v = np.arange(height, dtype=np.float32)[:, None]
        rays = self._rays(u, v)
        numbers = np.arange(width * height).reshape(height, width)
        inside = [numbers[rows, columns].ravel() for rows, columns in self.bounds]
        ids, distance = self._cast(rays, inside)
        colours = self._shade(rays, ids, distance)
        edges = np.flatnonzero(_on_edge(ids.reshape(height, width)))
        step = (np.arange(_SUPERSAMPLE, dtype=np.float32) + 0.5) / _SUPERSAMPLE - 0.5
        du, dv = (grid.ravel() for grid in np.meshgrid(step, step))
        row, column = np.divmod(edges, width)
        fine = self._rays(
            column.astype(np.float32)[:, None] + du, row.astype(np.float32)[:, None] + dv
        )
        inside = [
            np.flatnonzero(
                np.repeat(
                    (row >= rows.start)
                    & (row < rows.stop)
                    & (column >= columns.start)
                    & (column < columns.stop),
                    len(du),
                )
            )
            for rows, columns in self.bounds
        ]
        shaded = self._shade(fine, *self._cast(fine, inside))
        colours[:, edges] = shaded.reshape(3, len(edges), len(du)).mean(axis=2)
        return colours

    def _rays(self, u: Reals, v: Reals) -> Reals:
        """Return lines of sight in the base frame, depth 1 each, shape (3, n)."""
        matrix = self.matrix.astype(u.dtype)
        rotation = self.pose[:3, :3].astype(u.dtype)
        y = (v - matrix[1, 2]) / matrix[1, 1]
        x = (u - matrix[0, 2] - matrix[0, 1] * y) / matrix[0, 0]
        rays = np.empty((3, *np.broadcast_shapes(x.shape, y.shape)), dtype=u.dtype)
        for axis in range(3):
            rays[axis] = rotation[axis, 0] * x + (rotation[axis, 1] * y + rotation[axis, 2])
        return rays.reshape(3, -1)

    def _cast(self, rays: Reals, inside: list[Faces]) -> tuple[Faces, Reals]:
        """Find the surface that each ray meets, each solid tried only by the rays inside."""
        distance = self.scene.table.meet(self.eye, rays)
        ids = _FACES * np.isfinite(distance).astype(np.int64)
        eye = self.eye.astype(rays.dtype)[:, None]
        for owner, (solid, where) in enumerate(
            zip(self.scene.solids, inside, strict=True), start=_FIRST
        ):
            hit = solid.meet(eye, rays[:, where])
            wins = np.flatnonzero(hit.distance < distance[where])
            distance[where[wins]] = hit.distance[wins]
            ids[where[wins]] = _FACES * owner + hit.face[wins]
        return ids, distance

    def _shade(self, rays: Reals, ids: Faces, distance: Reals) -> Reals:
        """Compute the light that comes along each ray, linear RGB, shape (3, n)."""
        colours = np.empty(rays.shape, np.float32)
        for start in range(0, rays.shape[1], _BLOCK):
            part = slice(start, start + _BLOCK)
            colours[:, part] = self._shade_block(rays[:, part], ids[part], distance[part])
        return colours

    def _shade_block(self, rays: Reals, ids: Faces, distance: Reals) -> Reals:
        owners = ids // _FACES
        eye = self.eye.astype(rays.dtype)[:, None]
        light, table = self.scene.light, self.scene.table
        # nearly every ray ends on the table: shading all as if they did saves sorting them out
        colours = self._shade_table(eye + rays * np.where(owners == _TABLE, distance, 0))
        for owner in np.flatnonzero(np.bincount(owners)).tolist():
            if owner == _TABLE:
                continue
            mine = np.flatnonzero(owners == owner)
            if owner == _WALL:
                colours[:, mine] = table.wall(rays[:, mine]) * (light.ambient + light.strength)
            else:
                points = eye + rays[:, mine] * distance[mine]
                face = ids[mine] % _FACES
                colours[:, mine] = self._shade_solid(owner - _FIRST, points, face, rays[:, mine])
        return colours

    def _shade_table(self, points: Reals) -> Reals:
        light = self.scene.light
        lamp = np.full(points.shape[1], light.strength * float(light.unit[2, 0]), np.float32)
        sky = np.full(points.shape[1], light.ambient, np.float32)
        for shadow in self.shadows:
            shadow.dim(points, lamp, sky)
        return self.scene.table.colours(points) * (lamp + sky)

    def _shade_solid(self, index: int, points: Reals, face: Faces, rays: Reals) -> Reals:
        """Light a solid: Lambert's law, a highlight, sky above and the table's glow below."""
        scene, light, table = self.scene, self.scene.light, self.scene.table
        solid = scene.solids[index]
        normals = solid.normals(points, face)
        lamp = self._lamp_share(index, points + 1e-4 * normals)
        facing = np.maximum((normals * light.unit).sum(axis=0), 0)
        upward = 0.5 + 0.5 * normals[2]
        height = np.clip((points[2] - table.height) / solid.bounding_radius, 0, 1)
        glow = table.glow * (0.15 + 0.75 * np.sqrt(height))
        ambient = light.ambient * (upward + (1 - upward) * glow)
        albedo = (np.array(solid.colour) ** _GAMMA)[:, None]
        halfway = light.unit - rays / np.linalg.norm(rays, axis=0)
        halfway /= np.linalg.norm(halfway, axis=0)
        shine = 0.28 * np.maximum((normals * halfway).sum(axis=0), 0) ** 60 * (facing > 0)
        result: Reals = albedo * (light.strength * facing * lamp + ambient)
        result = result + light.strength * shine * lamp
        return result

    def _lamp_share(self, index: int, points: Reals) -> Reals:
        """Find how much of the lamp the other solids leave to points on one solid, (n,)."""
        scene = self.scene
        mine = scene.solids[index]
        lamps = scene.light.places(5).astype(points.dtype)
        share = np.ones(points.shape[1], dtype=points.dtype)
        for other, solid in enumerate(scene.solids):
            if other == index or not _may_shade(solid, mine, scene.light):
                continue
            for lamp_ray in lamps.T:
                light = np.broadcast_to(lamp_ray[:, None], points.shape)
                share -= np.isfinite(solid.meet(points, light).distance) / lamps.shape[1]
        return np.maximum(share, 0)

    def _bounds(self, solid: Solid) -> tuple[slice, slice]:
        """Return the rows and columns of the picture that can show a solid."""
        x, y, z = (np.asarray(solid.centre) - self.eye) @ self.pose[:3, :3]
        spans = []
        for offset, axis, size in ((y, 1, self.height), (x, 0, self.width)):
            reach = solid.bounding_radius / max(math.hypot(offset, z), 1e-12)
            angle, half = math.atan2(offset, z), math.asin(min(reach, 1.0))
            if reach >= 1 or abs(angle) + half >= math.pi / 2:
                spans.append(slice(0, size))
                continue
            focal, middle = self.matrix[axis, axis], self.matrix[axis, 2]
            slack = 2 + abs(self.matrix[0, 1]) * (axis == 0)
            low = int(middle + focal * math.tan(angle - half) - slack)
            high = int(middle + focal * math.tan(angle + half) + slack) + 1
            spans.append(slice(min(max(low, 0), size), min(max(high, 0), size)))
        return spans[0], spans[1]


def _may_shade(blocker: Solid, solid: Solid, light: Light) -> bool:
    """Whether one solid may stand between another and the lamp."""
    offset = np.asarray(blocker.centre) - np.asarray(solid.centre)
    along = float(offset @ light.unit[:, 0])
    aside = math.sqrt(max(float(offset @ offset) - along * along, 0.0))
    reach = blocker.bounding_radius + solid.bounding_radius
    return along > -reach and aside < reach + light.softness * max(along, 0.0)


def _on_edge(ids: Faces) -> NDArray[np.bool_]:
    """Mark pixels that have a neighbour on another surface."""
    edge = np.zeros(ids.shape, dtype=bool)
    across = ids[:, 1:] != ids[:, :-1]
    down = ids[1:] != ids[:-1]
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    return edge
