"""The table of a drawn scene: light wood, the soft shadows on it, and the wall behind it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from arm3dof.sim.shapes import Faces, Reals, Solid
from arm3dof.state import Array

# linear RGB
_WOOD_LIGHT = np.array([[0.72], [0.57], [0.41]])
_WOOD_DARK = np.array([[0.58], [0.43], [0.285]])
_WALL_LOW = np.array([[0.42], [0.46], [0.50]])
_WALL_HIGH = np.array([[0.74], [0.78], [0.81]])
_BOARD = 0.14  # width of a board [m]
_CELL = 0.0015  # grid on which shadows are computed [m]
_CELLS = 400  # and the most of its cells to a side, for the long shadows of a low lamp
_FOOT = 3.0  # how far the foot of a solid is dimmed [bounding radii]


@dataclass(frozen=True)
class Table:
    """A level table of light wood.

    Attributes:
        height: of its top in the base frame; the bundled arm stands on a table at -0.11 [m].
        centre: (x, y) of its middle [m].
        half_size: (x, y) of its half lengths [m].
    """

    height: float = -0.11
    centre: tuple[float, float] = (0.15, 0.0)
    half_size: tuple[float, float] = (0.80, 0.55)

    @property
    def glow(self) -> Array:
        """Colour of the light that the table throws back, linear RGB, shape (3, 1)."""
        return _WOOD_LIGHT * 0.8

    def meet(self, eye: Array, rays: Reals) -> Reals:
        """Find how far along each ray (3, n) the table is, shape (n,); infinite past its edge."""
        drop = self.height - float(eye[2])
        ahead = rays[2] * drop > 0
        distance = drop / np.where(ahead, rays[2], 1)
        met = ahead
        for axis in (0, 1):
            at = rays[axis] * distance + (float(eye[axis]) - self.centre[axis])
            met = met & (np.abs(at) <= self.half_size[axis])
        met_at: Reals = np.where(met, distance, np.inf).astype(rays.dtype)
        return met_at

    def colours(self, points: Reals) -> Reals:
        """Return the wood's colour, linear RGB, at points on the table, both of shape (3, n)."""
        x, y = points[0].astype(np.float32), points[1].astype(np.float32)
        across = y / _BOARD
        board = np.floor(across)
        tone_of_board = (0.5 + 0.5 * np.sin(board * 78.233)).astype(np.float32)
        x += 0.37 * board
        bend = np.sin(5.1 * x + board) + 0.4 * np.sin(13.7 * x + 9.0 * y)
        tone = 0.40 + 0.22 * np.sin(95.0 * y + 2.6 * bend)
        tone += 0.07 * np.sin(410.0 * y + 5.0 * bend + 7.0 * x) + 0.30 * tone_of_board
        seam = np.abs(across - board - 0.5)
        tone -= 0.9 * np.clip((seam - 0.493) / 0.007, 0, 1)
        dark, light = _WOOD_DARK.astype(np.float32), _WOOD_LIGHT.astype(np.float32)
        wood: Reals = dark + (light - dark) * tone
        return wood

    def wall(self, rays: Reals) -> Reals:
        """Return the wall's colour, linear RGB, along rays that miss the table, (3, n)."""
        rise = rays[2] / np.sqrt(np.square(rays).sum(axis=0))
        share = np.clip((rise + 0.6) / 0.9, 0, 1)
        share = share * share * (3 - 2 * share)
        colours: Reals = (_WALL_LOW + (_WALL_HIGH - _WALL_LOW) * share).astype(np.float32)
        return colours


@dataclass(frozen=True, eq=False)
class Shadow:
    """How one solid dims the table, on a grid of cells.

    Attributes:
        corner: (x, y) of the first cell [m].
        cell: distance of neighbouring cells [m].
        lamp: share of the lamp that each cell sees, shape (rows, columns).
        sky: share of the sky that each cell sees, shape (rows, columns).
    """

    corner: Array
    cell: float
    lamp: Reals
    sky: Reals

    @classmethod
    def cast(cls, solid: Solid, height: float, lamps: Array) -> Shadow:
        """Follow the light from places of the lamp to the cells about a solid.

        Args:
            solid: what stands in the way.
            height: of the table [m].
            lamps: unit vectors to places of the lamp, shape (3, k).
        """
        centre, radius = np.asarray(solid.centre), solid.bounding_radius
        rise = max(float(centre[2]) - height, 0.0)
        middles = centre[:2, None] - lamps[:2] / lamps[2] * rise
        reach = radius / float(lamps[2].min())
        low, high = middles.min(axis=1) - reach, middles.max(axis=1) + reach
        corner = np.minimum(low, centre[:2] - _FOOT * radius)
        far = np.maximum(high, centre[:2] + _FOOT * radius)
        cell = max(_CELL, float((far - corner).max()) / _CELLS)
        counts = np.ceil((far - corner) / cell).astype(int) + 2
        x, y = (corner[k] + cell * np.arange(counts[k]) for k in (0, 1))
        lamp = np.ones((counts[0], counts[1]), np.float32)
        rows, columns = (
            slice(*np.searchsorted(axis, [low[k], high[k]])) for k, axis in enumerate((x, y))
        )
        dimmed = lamp[rows, columns]
        feet = np.empty((3, dimmed.size), np.float32)
        feet[0] = np.repeat(x[rows], dimmed.shape[1])
        feet[1] = np.tile(y[columns], dimmed.shape[0])
        feet[2] = height
        # from beyond the solid downwards, so that a cell underneath it is in the dark too
        length = 2 * (rise + 2 * radius) / float(lamps[2].min())
        for lamp_ray in lamps.T.astype(np.float32):
            light = np.broadcast_to(-lamp_ray[:, None], feet.shape)
            met = solid.meet(feet + length * lamp_ray[:, None], light).distance < length
            dimmed -= met.reshape(dimmed.shape) / lamps.shape[1]
        sky = _sky_share(solid, height, x[:, None], y[None, :])
        return cls(corner, cell, lamp, sky.astype(np.float32))

    def dim(self, points: Reals, lamp: Reals, sky: Reals) -> None:
        """Multiply the shares of the lamp and the sky, (n,), at points on the table, (3, n)."""
        inside = self._inside(points)
        if not inside.size:
            return
        place = (points[:2, inside] - self.corner.astype(points.dtype)[:, None]) / self.cell
        cell = place.astype(np.int32)
        s, t = place - cell
        stride = self.lamp.shape[1]
        first = cell[0] * stride + cell[1]
        for share, grid in ((lamp, self.lamp), (sky, self.sky)):
            flat = grid.ravel()
            low = flat[first] * (1 - t) + flat[first + 1] * t
            high = flat[first + stride] * (1 - t) + flat[first + stride + 1] * t
            share[inside] *= low * (1 - s) + high * s

    def _inside(self, points: Reals) -> Faces:
        far = self.corner + self.cell * (np.array(self.lamp.shape) - 1.01)
        (x0, y0), (x1, y1) = self.corner.tolist(), far.tolist()
        x, y = points[0], points[1]
        return np.flatnonzero((x > x0) & (x < x1) & (y > y0) & (y < y1))


def _sky_share(solid: Solid, height: float, x: Array, y: Array) -> Array:
    """Darken the foot of a solid as a stack of balls of its width would."""
    bound = solid.bounding_radius
    wide = math.sqrt(max(bound**2 - solid.half_height**2, 0.0)) or bound
    count = max(1, round(solid.half_height / wide))
    foot = max(solid.centre[2] - solid.half_height - height, 0.0)
    flat = (x - solid.centre[0]) ** 2 + (y - solid.centre[1]) ** 2
    share = np.ones(flat.shape)
    for k in range(count):
        rise = foot + wide * (2 * k + 1)
        share *= 1 - 0.85 * np.minimum(wide**2 * rise / (flat + rise * rise) ** 1.5, 1.0)
    fade = np.clip((_FOOT * bound - np.sqrt(flat)) / (1.5 * bound), 0, 1)
    result: Array = 1 - (1 - share) * fade
    return result
