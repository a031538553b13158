"""What a camera in the simulated world sees: pixels, and nothing else."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm3dof.closing import Closing
from arm3dof.errors import InputError
from arm3dof.sim.changes import Changes
from arm3dof.sim.engine import mujoco
from arm3dof.sim.lens import Lens
from arm3dof.sim.mujoco_plant import MujocoPlant
from arm3dof.sim.renderer import DRAWN, Image, Renderer
from arm3dof.state import Array, frozen_array

Levels = NDArray[np.int16]

_SUBFRAMES = 5  # moments that a blurred picture is the mean of
_SPARE = 64  # by how many pixels the noise is larger than the picture, to shift it about
_SHADOW_MAPS = (1024, 2048, 4096)  # widths of the map that shadows are made with [px]
_SAMPLES = 4  # places at which a pixel is drawn to smooth its edges


class WorldCamera(Closing):
    """A camera that stands in a plant's world and draws it off the screen, on the CPU.

    Attributes:
        width: of its pictures [px].
        height: of its pictures [px].
        camera_matrix: its intrinsics, shape (3, 3) [px].
        transform_base_camera: its pose, shape (4, 4); may be set to move it.
    """

    def __init__(
        self,
        plant: MujocoPlant,
        camera_matrix: ArrayLike,
        transform_base_camera: ArrayLike,
        width: int,
        height: int,
        *,
        distortion: ArrayLike = (),
        noise: float = 0.0,
        exposure: float = 0.0,
        shadows: bool = True,
        smooth: bool = True,
        onto_last: bool = False,
        rng: np.random.Generator | None = None,
    ) -> None:
        """Put a camera into a world.

        Args:
            plant: whose world it sees.
            camera_matrix: intrinsics ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]``, shape (3, 3) [px];
                the middle of the first pixel is (0, 0), as in OpenCV.
            transform_base_camera: pose of the optical frame (x right, y down, z forward) in the
                base frame, shape (4, 4).
            width: of its pictures [px].
            height: of its pictures [px].
            distortion: of its lens, OpenCV's k1 k2 p1 p2 [k3 [k4 k5 k6]]; none when empty.
            noise: standard deviation of the sensor's noise [grey levels].
            exposure: time that a picture takes [s]; what moves meanwhile is blurred.
            shadows: whether things cast shadows.
            smooth: whether edges are drawn smooth, which takes about twice as long.
            onto_last: whether a picture is drawn onto the last one, only where something has
                moved; not with shadows, which reach far.
            rng: source of the noise; needed where there is noise.

        Raises:
            InputError: an argument cannot belong to a camera, there is noise without ``rng``, or
                shadows are to be drawn onto the last picture.
            ArmError: this machine can draw nothing; the message says what to install.
        """
        if width < 1 or height < 1:
            raise InputError(f"the picture is {width} x {height} px; give sizes of 1 or more")
        for name, value in (("noise", noise), ("exposure", exposure)):
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"{name} is {value!r}; give 0 or more")
        if onto_last and shadows:
            raise InputError("onto_last goes without shadows; give shadows=False")
        self.width, self.height = int(width), int(height)
        self.camera_matrix = _intrinsics(camera_matrix)
        self.transform_base_camera = frozen_array(
            transform_base_camera, 4, 4, name="transform_base_camera"
        )
        self._plant, self._exposure, self._rng = plant, exposure, rng
        bends = np.size(distortion) > 0
        self._lens = Lens(self.camera_matrix, distortion, width, height) if bends else None
        self._noise = _noise_bank(self.width, self.height, noise, rng)
        self._data = mujoco.MjData(plant.model)
        size = (width, height) if self._lens is None else (self._lens.width, self._lens.height)
        self._renderer = Renderer(
            plant.model,
            *size,
            shadows=_shadow_map(max(size)) if shadows else 0,
            samples=_SAMPLES if smooth else 0,
        )
        self._changes = Changes(plant.model, DRAWN, *size) if onto_last else None
        self._last: Image = np.zeros((size[1], size[0], 3), np.uint8)

    def close(self) -> None:
        """Give back what it draws with."""
        self._renderer.close()

    def take(self) -> Image:
        """Take a picture of the present moment, BGR, shape (height, width, 3), uint8.

        Raises:
            InputError: another thread than the one that made the camera asks.
        """
        picture = self._straight()
        if self._lens is not None:
            picture = self._lens.bend(picture)
        if self._noise is None or self._rng is None:
            return picture
        return self._with_noise(picture, self._noise, self._rng)

    def _straight(self) -> Image:
        """Return what a pinhole camera sees in the exposure, as large as the lens needs it."""
        qpos, qvel = self._plant.data.qpos.copy(), self._plant.data.qvel.copy()
        if self._exposure == 0 or not np.any(qvel):
            return self._draw(qpos)
        pictures = []
        for moment in np.linspace(-self._exposure, 0.0, _SUBFRAMES):
            then = qpos.copy()
            mujoco.mj_integratePos(self._plant.model, then, qvel, moment)
            pictures.append(self._draw(then))
        total = np.stack(pictures).sum(axis=0, dtype=np.uint16)
        blurred: Image = ((total + _SUBFRAMES // 2) // _SUBFRAMES).astype(np.uint8)
        return blurred

    def _draw(self, qpos: Array) -> Image:
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._plant.model, self._data)
        mujoco.mj_camlight(self._plant.model, self._data)
        matrix = self.camera_matrix if self._lens is None else self._lens.matrix
        if self._changes is None:
            return self._renderer.draw(self._data, matrix, self.transform_base_camera)
        window = self._changes.window(self._data, matrix, self.transform_base_camera)
        if window is not None:
            self._last[window.slices] = self._renderer.draw(
                self._data, matrix, self.transform_base_camera, window
            )
        return self._last.copy()

    def _with_noise(self, picture: Image, bank: Levels, rng: np.random.Generator) -> Image:
        row, column = rng.integers(0, _SPARE, 2)
        noise = bank[row : row + self.height, column : column + self.width]
        return np.asarray(cv2.add(picture, noise, dtype=cv2.CV_8U), np.uint8)  # it saturates


def _shadow_map(width: int) -> int:
    """Return how wide the map of shadows must be for a picture of some width, both [px]."""
    return next((size for size in _SHADOW_MAPS if size >= 2.5 * width), _SHADOW_MAPS[-1])


def _intrinsics(values: ArrayLike) -> Array:
    matrix = frozen_array(values, 3, 3, name="camera_matrix")
    bare = np.array([[matrix[0, 0], 0, matrix[0, 2]], [0, matrix[1, 1], matrix[1, 2]], [0, 0, 1]])
    if not (
        np.isfinite(matrix).all()
        and np.array_equal(matrix, bare)
        and (bare[[0, 1], [0, 1]] > 0).all()
    ):
        raise InputError(
            f"camera_matrix is {matrix.tolist()}; give [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] "
            "with positive focal lengths [px] and no skew"
        )
    return matrix


def _noise_bank(
    width: int, height: int, sigma: float, rng: np.random.Generator | None
) -> Levels | None:
    """Return noise that is larger than a picture: each picture takes another part of it."""
    if sigma == 0:
        return None
    if rng is None:
        raise InputError("noise needs a source: give rng=numpy.random.default_rng(seed)")
    values = rng.standard_normal((height + _SPARE, width + _SPARE, 3), dtype=np.float32)
    bank: Levels = np.rint(values * np.float32(sigma)).astype(np.int16)
    return bank
