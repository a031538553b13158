"""A lens that distorts: which ray each pixel looks along, and the picture that it makes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm3dof.errors import InputError
from arm3dof.state import Array, frozen_array

_LENGTHS = (4, 5, 8)
_STEPS = 40
_CLOSE = 1e-9  # [focal lengths]


class Lens:
    """Bends pictures of a pinhole camera as a lens with OpenCV's coefficients does.

    Attributes:
        matrix: intrinsics of the pinhole picture that it needs, shape (3, 3) [px].
        width: of that picture [px].
        height: of that picture [px].
    """

    def __init__(
        self, camera_matrix: ArrayLike, distortion: ArrayLike, width: int, height: int
    ) -> None:
        """Find the ray of every pixel once, and how large the pinhole picture must be.

        Args:
            camera_matrix: intrinsics of the camera, shape (3, 3) [px].
            distortion: k1 k2 p1 p2 [k3 [k4 k5 k6]], shape (4,), (5,) or (8,).
            width: of the camera's picture [px].
            height: of the camera's picture [px].

        Raises:
            InputError: there are other coefficients, or two rays meet in one pixel.
        """
        matrix = frozen_array(camera_matrix, 3, 3, name="camera_matrix")
        given = frozen_array(distortion, None, name="distortion")
        if given.size not in _LENGTHS or not np.isfinite(given).all():
            raise InputError(
                f"distortion is {given.tolist()}; give 4, 5 or 8 finite coefficients in OpenCV's "
                "order k1 k2 p1 p2 k3 k4 k5 k6"
            )
        u, v = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
        y = (v - matrix[1, 2]) / matrix[1, 1]
        x = (u - matrix[0, 2] - matrix[0, 1] * y) / matrix[0, 0]
        x, y = _straighten(x, y, np.concatenate([given, np.zeros(8 - given.size)]))
        fx, fy = matrix[0, 0], matrix[1, 1]
        left, top = np.floor(x.min() * fx) - 1, np.floor(y.min() * fy) - 1
        self.width = int(np.ceil(x.max() * fx) - left) + 2
        self.height = int(np.ceil(y.max() * fy) - top) + 2
        self.matrix = np.array([[fx, 0.0, -left], [0.0, fy, -top], [0.0, 0.0, 1.0]])
        columns, rows = x * fx - left, y * fy - top
        i, k = np.floor(rows).astype(np.int64), np.floor(columns).astype(np.int64)
        down, across = (rows - i)[..., None], (columns - k)[..., None]
        first = i * self.width + k
        self._corners = [
            (first, ((1 - down) * (1 - across)).astype(np.float32)),
            (first + 1, ((1 - down) * across).astype(np.float32)),
            (first + self.width, (down * (1 - across)).astype(np.float32)),
            (first + self.width + 1, (down * across).astype(np.float32)),
        ]

    def bend(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the camera's picture from the pinhole one, both (rows, columns, 3)."""
        pixels = picture.reshape(-1, 3)
        bent = sum(
            (pixels[index] * weight for index, weight in self._corners),
            np.float32(0.5),
        )
        return np.asarray(bent).astype(np.uint8)


def _bend(x: Array, y: Array, k: Array) -> tuple[Array, Array]:
    """Distort normalised coordinates (Brown and Conrady's model with a rational radial part)."""
    r2 = x * x + y * y
    radial = (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (
        1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))
    )
    return (
        x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
        y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y,
    )


def _straighten(x_bent: Array, y_bent: Array, k: Array) -> tuple[Array, Array]:
    """Invert ``_bend`` by Newton's method with a numerical slope."""
    x, y = x_bent.copy(), y_bent.copy()
    step = 1e-6
    for _ in range(_STEPS):
        bx, by = _bend(x, y, k)
        ex, ey = x_bent - bx, y_bent - by
        if max(np.abs(ex).max(), np.abs(ey).max()) < _CLOSE:
            return x, y
        (xx, yx), (xy, yy) = _bend(x + step, y, k), _bend(x, y + step, k)
        a, c = (xx - bx) / step, (yx - by) / step
        b, d = (xy - bx) / step, (yy - by) / step
        determinant = a * d - b * c
        x = x + (d * ex - b * ey) / determinant
        y = y + (a * ey - c * ex) / determinant
        if not (np.isfinite(x).all() and np.isfinite(y).all()):
            break
    raise InputError(
        f"distortion {k.tolist()} folds the picture: some pixel sees no ray or several; "
        "give smaller coefficients"
    )
