"""Fitting a solid to an outline: where it must stand for its silhouette to be what was measured.

A solid is made of convex parts, each the hull of points X(s) of the optical frame that depend on
its state s: its centre, and how high it is or how it is turned. The part's silhouette is the convex
hull of their images (X / Z, Y / Z), and the solid's is the union of its parts'. A point p of the
outline lies outside the silhouette by n . (p - a), with the outward normal n of the side nearest to
it and the end a of that side. When the state changes, both ends of the side move, and at p the side
moves outwards by what is between the motions of its ends along n.
With these derivatives Gauss-Newton makes the distances small.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np

from arm3dof.state import Array

Part = tuple[Array, Array]
"""Points, shape (k, 3) [m], and their derivatives by the state, shape (k, 3, m)."""
Solid = Callable[[Array], tuple[Part, ...]]
"""Takes a state, shape (m,), to the parts."""

_COUNT = 48  # corners of the polygon that stands in for a circle
# of that size the polygon is on average as wide as the circle
_GROWN = 1 / (1 - (math.pi / _COUNT) ** 2 / 3)
_TURN = np.linspace(0, 2 * math.pi, _COUNT, endpoint=False)
CIRCLE = _GROWN * np.column_stack([np.cos(_TURN), np.sin(_TURN)])
"""Corners of the polygon that stands in for a circle of radius 1, shape (k, 2)."""
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
_STEPS, _HALVINGS = 12, 4
_SMALL = 1e-3  # a step that moves no part of the outline by more ends the search [px]
_DOUBT_PX = 0.6  # points this far off count half


class Fit(NamedTuple):
    """A solid that was fitted to an outline.

    Attributes:
        state: its state, shape (m,).
        off_px: how far each point of the outline lies outside its silhouette, shape (n,) [px].
        slope: by how much ``off_px`` changes with the state, shape (n, m) [px / state].
        normals: outward normal of the silhouette at each point, shape (n, 2).
    """

    state: Array
    off_px: Array
    slope: Array
    normals: Array

    def loss(self, doubt_px: float = _DOUBT_PX) -> float:
        """Return what the search makes small: the mean of log(1 + (off / doubt)^2)."""
        return float(np.log1p((self.off_px / doubt_px) ** 2).mean())

    def gain(self, doubt_px: float = _DOUBT_PX) -> Array:
        """Return what the state makes of errors of the points, shape (m, n) [state / px]."""
        weighted: Array = self.slope / (1 + (self.off_px / doubt_px) ** 2)[:, None]
        normal = weighted.T @ self.slope
        normal += 1e-12 * np.trace(normal) * np.eye(len(normal))
        return -np.asarray(np.linalg.solve(normal, weighted.T), dtype=np.float64)


def fit(solid: Solid, state: Array, points: Array, pixel: float, steps: int = _STEPS) -> Fit:
    """Move a solid until its silhouette is the measured outline.

    Args:
        solid: the solid.
        state: where to begin, shape (m,).
        points: the outline, (x, y) at depth 1, shape (n, 2).
        pixel: the size of a pixel in them, 1 / focal length.
        steps: after so many it is left where it is.
    """
    found = compare(solid, state, points, pixel)
    for _ in range(steps):
        # far from the goal every point may be far off, and none is stray yet
        doubt = max(_DOUBT_PX, 2 * float(np.median(np.abs(found.off_px))))
        step, loss = found.gain(doubt) @ found.off_px, found.loss(doubt)
        for _ in range(_HALVINGS):
            tried = compare(solid, found.state + step, points, pixel)
            if tried.loss(doubt) < loss:
                break
            step = step / 2
        else:
            break
        settled = float(np.abs(found.slope @ step).max()) < _SMALL
        found = tried
        if settled:
            break
    return found


def moved(solid: Solid, state: Array, points: Array) -> Array:
    """Move a solid until its silhouette has the outline's area and middle, near enough to fit it.

    Args:
        solid: the solid.
        state: its state, whose first three numbers are its centre, shape (m,).
        points: the outline, (x, y) at depth 1, shape (n, 2).
    """
    state = state.copy()
    area, middle = _area(points)
    for _ in range(4):
        body = np.concatenate([part for part, _ in solid(state)])
        size, centre = _area(body[:, :2] / np.maximum(body[:, 2:], 1e-6))
        state[:2] += (middle - centre) * state[2]
        state[:3] *= math.sqrt(max(size, 1e-12) / max(area, 1e-12))
    return state


def ball(radius: float) -> Solid:
    """Return a ball, by its state: its centre, shape (3,)."""

    def at(state: Array) -> tuple[Part, ...]:
        distance = float(np.linalg.norm(state))
        axis = state / distance
        sine = min(radius / distance, 0.99)
        rim = radius * math.sqrt(1 - sine * sine) * CIRCLE @ _across(axis)
        return ((state - radius * sine * axis + rim, _tangents(_COUNT, 3)),)

    return at


def disc(radius: float, up: Array) -> Solid:
    """Return a level disc, by its state: its centre, shape (3,)."""
    rim = radius * CIRCLE @ _across(up)
    tangents = _tangents(_COUNT, 3)
    return lambda state: ((state[:3] + rim, tangents),)


def cylinder(radius: float, up: Array) -> Solid:
    """Return an upright cylinder, by its state: its centre and its height, shape (4,)."""
    return _stack(up, [(radius, -0.5, 0.5)])


def bottle(radius: float, up: Array) -> Solid:
    """Return an upright bottle, by its state: its centre and its height, shape (4,).

    Its neck is 0.4 as wide as its belly and takes the upper 0.3 of its height.
    """
    return _stack(up, [(radius, -0.5, 0.2), (0.4 * radius, 0.2, 0.5)])


def cube(edge: float, up: Array) -> Solid:
    """Return an upright cube, by its state: its centre and its turn about ``up``, shape (4,)."""
    first, second = _across(up)
    tangents = _tangents(len(_CORNERS), 4)

    def at(state: Array) -> tuple[Part, ...]:
        c, s = math.cos(state[3]), math.sin(state[3])
        axes = np.array([c * first + s * second, c * second - s * first, up])
        turned = np.array([axes[1], -axes[0], np.zeros(3)])
        slopes = tangents.copy()
        slopes[:, :, 3] = edge * _CORNERS @ turned
        return ((state[:3] + edge * _CORNERS @ axes, slopes),)

    return at


def _stack(up: Array, drums: list[tuple[float, float, float]]) -> Solid:
    """Stack upright drums: the radius of each, and its ends as shares of the height."""
    across = _across(up)
    made = []
    for radius, low, high in drums:
        rim = radius * CIRCLE @ across
        share = np.repeat([low, high], _COUNT)
        tangents = _tangents(2 * _COUNT, 4)
        tangents[:, :, 3] = share[:, None] * up
        made.append((np.concatenate([rim, rim]), share[:, None] * up, tangents))
    return lambda state: tuple(
        (state[:3] + rims + state[3] * rise, tangents) for rims, rise, tangents in made
    )


def compare(solid: Solid, state: Array, points: Array, pixel: float) -> Fit:
    """Return how far an outline is from a solid's silhouette; arguments as of ``fit``."""
    parts = [_part_off(part, points) for part in solid(state)]
    off, slope, normals = parts[0]
    for other in parts[1:]:
        # outside a union is what is outside all of it
        nearer = other[0] < off
        off = np.where(nearer, other[0], off)
        slope, normals = (
            np.where(nearer[:, None], new, old)
            for new, old in zip(other[1:], (slope, normals), strict=True)
        )
    return Fit(state, off / pixel, slope / pixel, normals)


def _part_off(part: Part, points: Array) -> tuple[Array, Array, Array]:
    """Return how far points lie outside a part, its change with the state, and the normals."""
    body, tangents = part
    depth = np.maximum(body[:, 2], 1e-6)
    image = body[:, :2] / depth[:, None]
    first = cv2.convexHull(image.astype(np.float32), clockwise=False, returnPoints=False).ravel()
    begins = image[first]
    ends = _next(begins)
    sides = ends - begins
    length = np.maximum(np.hypot(sides[:, 0], sides[:, 1]), 1e-12)
    sides = sides / length[:, None]
    normals = np.column_stack([sides[:, 1], -sides[:, 0]])
    if begins[:, 0] @ ends[:, 1] < begins[:, 1] @ ends[:, 0]:  # the hull runs from y to x
        normals = -normals
    outside = points @ normals.T - (begins * normals).sum(axis=1)
    nearest = outside.argmax(axis=1)
    off = outside[np.arange(len(points)), nearest]
    # how both ends of each side move outwards, and how far along its side each point is
    slopes = _image_slopes(image, depth, tangents, first)
    rate = np.einsum("ij,ijk->ik", normals, slopes)
    other = np.einsum("ij,ijk->ik", normals, _next(slopes))
    along = ((points - begins[nearest]) * sides[nearest]).sum(axis=1) / length[nearest]
    share = np.clip(along, 0, 1)[:, None]
    slope = -((1 - share) * rate[nearest] + share * other[nearest])
    return off, slope, normals[nearest]


def _next(around: Array) -> Array:
    """Return for each corner of a hull what belongs to the next one, shape (k, ...)."""
    return np.concatenate([around[1:], around[:1]])


def _image_slopes(image: Array, depth: Array, tangents: Array, which: Array) -> Array:
    """Return by how much images of points change with the state, shape (k, 2, m)."""
    moved = tangents[which]
    slopes = moved[:, :2] - image[which][:, :, None] * moved[:, 2:]
    return np.asarray(slopes / depth[which][:, None, None], dtype=np.float64)


def _area(points: Array) -> tuple[float, Array]:
    """Return the area and the middle, shape (2,), of the convex hull of points (n, 2)."""
    moments = cv2.moments(cv2.convexHull(points.astype(np.float32).reshape(-1, 1, 2)))
    area = max(float(moments["m00"]), 1e-12)
    return area, np.array([moments["m10"], moments["m01"]]) / area


def _tangents(count: int, size: int) -> Array:
    """Return the derivatives of points that move with the first three numbers of a state."""
    tangents = np.zeros((count, 3, size))
    tangents[:, :, :3] = np.eye(3)
    return tangents


def _across(axis: Array) -> Array:
    """Return two unit vectors at right angles to an axis and to each other, shape (2, 3)."""
    other = np.eye(3)[int(np.abs(axis).argmin())]
    first = np.cross(axis, other)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first)])
