"""Faces in perspective with a depth buffer and a shadow on the floor, in numpy and OpenCV.

A face is flat, so the inverse of its depth is linear in the pixel: on the plane ``n . p = d`` of
the camera's frame, the ray ``r = K^-1 (u, v, 1)`` through a pixel meets ``1 / z = n . r / d``.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from arm3dof.state import Array
from arm3dof.ui.facets import Facets

Picture = NDArray[np.uint8]

_SHIFT = 4  # bits of a pixel that OpenCV's corners are given in
_SUN = np.array([0.42, -0.62, 1.0]) / np.linalg.norm([0.42, -0.62, 1.0])
_SKY = np.array([-0.55, 0.35, 0.45]) / np.linalg.norm([-0.55, 0.35, 0.45])


@dataclass(frozen=True, eq=False)
class Perspective:
    """A camera without distortion.

    Attributes:
        camera_matrix: intrinsics, shape (3, 3) [px].
        transform_camera_base: takes the base frame to the optical frame, shape (4, 4).
    """

    camera_matrix: Array
    transform_camera_base: Array

    @staticmethod
    def look_at(
        eye: Array, target: Array, focal: float, middle: tuple[float, float]
    ) -> Perspective:
        """Return the view from one point at another, up being +z.

        Args:
            eye: where the camera is, shape (3,) [m].
            target: what is seen at ``middle``, shape (3,) [m].
            focal: focal length [px].
            middle: (u, v) of the optical axis [px].
        """
        z = (target - eye) / np.linalg.norm(target - eye)
        x = np.cross(z, [0.0, 0.0, 1.0])
        x /= np.linalg.norm(x)
        turn = np.stack([x, np.cross(z, x), z])
        transform = np.eye(4)
        transform[:3, :3], transform[:3, 3] = turn, -turn @ eye
        return Perspective(
            np.array([[focal, 0, middle[0]], [0, focal, middle[1]], [0, 0, 1]]), transform
        )

    def to_camera(self, points: Array) -> Array:
        """Take points of the base frame to the optical frame, shape (n, 3) [m]."""
        transform = self.transform_camera_base
        result: Array = points @ transform[:3, :3].T + transform[:3, 3]
        return result

    def project(self, points: Array) -> Array:
        """Return the pixels of points of the base frame, shape (n, 2)."""
        image = self.to_camera(points) @ self.camera_matrix.T
        result: Array = image[:, :2] / image[:, 2:]
        return result


class Canvas:
    """A picture being painted, and how near each of its pixels is.

    Args:
        picture: what is painted over, shape (height, width, 3), uint8; it is copied.
        view: the camera.
    """

    def __init__(self, picture: Picture, view: Perspective) -> None:
        self.picture = picture.copy()
        self._view = view
        self._nearness = np.zeros(picture.shape[:2])  # 1 / z [1/m]
        self._from_pixel = np.linalg.inv(view.camera_matrix)

    def paint(self, shape: Facets, points: Array) -> None:
        """Paint the faces that look at the camera, hidden parts left out.

        Args:
            shape: the faces.
            points: their points in the base frame, shape (n, 3) [m].
        """
        normals = _normals(shape, points)
        tones = 255 * np.clip(shape.color * _brightness(normals)[:, None], 0, 1)
        normals = normals @ self._view.transform_camera_base[:3, :3].T
        anchors = self._view.to_camera(points)[shape.corners[:, 0]]
        distance = np.einsum("fi,fi->f", normals, anchors)
        planes = normals @ self._from_pixel / np.where(distance == 0, 1, distance)[:, None]
        pixels = self._view.project(points)
        for face in np.flatnonzero(distance < -1e-9):
            corners = shape.corners[face, : shape.count[face]]
            self._fill(pixels[corners], planes[face], tones[face, ::-1])

    def cast_shadow(self, shape: Facets, points: Array, floor: float, depth: float = 0.42) -> None:
        """Darken the floor where faces stand between it and the sun.

        Args:
            shape: the faces.
            points: their points in the base frame, shape (n, 3) [m].
            floor: height of the floor [m].
            depth: how dark the shadow is, from 0 to 1.
        """
        above = np.maximum(points[:, 2] - floor, 0.0)
        fallen = points - above[:, None] * _SUN / _SUN[2]
        pixels = self._view.project(fallen)
        lit = _normals(shape, points) @ _SUN > 0
        mask = np.zeros(self.picture.shape[:2], np.uint8)
        for face in np.flatnonzero(lit):
            corners = shape.corners[face, : shape.count[face]]
            cv2.fillConvexPoly(mask, _fixed_point(pixels[corners]), 255, cv2.LINE_8, _SHIFT)
        x, y, wide, high = map(int, cv2.boundingRect(mask))
        if wide == 0:
            return
        soft = 1 + 2 * (self.picture.shape[0] // 360)
        part = np.s_[max(0, y - soft) : y + high + soft, max(0, x - soft) : x + wide + soft]
        blurred = cv2.GaussianBlur(mask[part], (2 * soft + 1, 2 * soft + 1), 0)
        share = 1 - blurred[..., None].astype(np.float32) * np.float32(depth / 255)
        self.picture[part] = (self.picture[part] * share).astype(np.uint8)

    def line(self, points: Array, color: tuple[float, float, float], width: float) -> None:
        """Paint a line through points of the base frame, hidden parts left out.

        Args:
            points: shape (n, 3) [m].
            color: red, green, blue from 0 to 1.
            width: [px].
        """
        if len(points) < 2:
            return
        pixels, near = self._view.project(points), 1 / self._view.to_camera(points)[:, 2]
        tone = 255 * np.array(color[::-1])
        for k in range(len(points) - 1):
            along = pixels[k + 1] - pixels[k]
            length = float(np.hypot(*along))
            if length < 1e-6:
                continue
            aside = width / (2 * length) * np.array([-along[1], along[0]])
            slope = (near[k + 1] - near[k]) / length**2 * along
            plane = np.array([*slope, near[k] - slope @ pixels[k]])
            ends = pixels[k] - 0.3 * width / length * along, pixels[k + 1]
            quad = [ends[0] + aside, ends[1] + aside, ends[1] - aside, ends[0] - aside]
            self._fill(np.array(quad), plane, tone)

    def _fill(self, corners: Array, plane: Array, tone: Array) -> None:
        """Paint one convex polygon; ``plane @ (u, v, 1)`` is its nearness."""
        height, width = self.picture.shape[:2]
        low = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
        high = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + 1, (width, height))
        if (high <= low).any():
            return
        part = np.s_[low[1] : high[1], low[0] : high[0]]
        mask = np.zeros((high[1] - low[1], high[0] - low[0]), np.uint8)
        cv2.fillConvexPoly(mask, _fixed_point(corners - low), 1, cv2.LINE_8, _SHIFT)
        across = plane[0] * np.arange(low[0], high[0]) + plane[2]
        near = across + (plane[1] * np.arange(low[1], high[1]))[:, None]
        seen = (near > self._nearness[part]) & mask.view(bool)
        np.copyto(self._nearness[part], near, where=seen)
        np.copyto(self.picture[part], tone.astype(np.uint8), where=seen[..., None])


def _fixed_point(corners: Array) -> NDArray[np.int32]:
    return np.rint(np.clip(corners, -1e5, 1e5) * (1 << _SHIFT)).astype(np.int32)


def _normals(shape: Facets, points: Array) -> Array:
    """Return the outward unit normal of each face, from three corners far apart."""
    rows = np.arange(len(shape.corners))
    third = np.maximum(shape.count // 3, 1)
    a, b, c = (points[shape.corners[rows, k]] for k in (0 * third, third, 2 * third))
    normals = np.cross(b - a, c - a)
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    result: Array = normals / np.where(size == 0, 1, size)
    return result


def _brightness(normals: Array) -> Array:
    sun, sky = np.maximum(normals @ _SUN, 0), np.maximum(normals @ _SKY, 0)
    result: Array = 0.52 + 0.08 * normals[:, 2] + 0.46 * sun + 0.12 * sky
    return result
