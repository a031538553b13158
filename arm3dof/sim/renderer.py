"""Drawing a MuJoCo world without a screen: a context of EGL or OSMesa, and pinhole pictures."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import threading
import weakref
from functools import lru_cache
from importlib import import_module
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from arm3dof.errors import ArmError, InputError
from arm3dof.sim.changes import Window
from arm3dof.sim.engine import mujoco
from arm3dof.state import Array

Image = NDArray[np.uint8]

BACKENDS = ("egl", "osmesa")
"""What MuJoCo can draw with where there is no screen, best first."""

_CURE = (
    "install EGL (Debian and Ubuntu: sudo apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri "
    "libopengl0) or OSMesa (libosmesa6)"
)
_NEAR, _FAR = 0.01, 20.0  # what is nearer or farther is not drawn [m]
_MOST_GEOMS = 4000
DRAWN = 1
"""Group of the geoms that are drawn."""


class Renderer:
    """Draws one world with one size of picture; it belongs to the thread that made it.

    Raises:
        ArmError: this machine can draw nothing; the message says what to install.
    """

    def __init__(
        self, model: mujoco.MjModel, width: int, height: int, *, shadows: int, samples: int
    ) -> None:
        """Get a context and load the world's meshes and textures into it.

        Args:
            model: the world.
            width: of the pictures [px].
            height: of the pictures [px].
            shadows: width of the map that shadows are made with [px]; 0 for none.
            samples: places at which a pixel is drawn; 0 for its middle alone.
        """
        self._model, self._thread = model, threading.get_ident()
        _free_dropped()
        self._context = backend()[1](width, height)
        self._context.make_current()
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        model.vis.quality.shadowsize, model.vis.quality.offsamples = shadows, samples
        self._gl = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        self._drop = weakref.finalize(self, _put_aside, self._thread, self._context, self._gl)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._gl)
        self._scene = mujoco.MjvScene(model, maxgeom=_MOST_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows > 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[DRAWN] = 1
        self._free_camera = mujoco.MjvCamera()
        self._whole = Window(0, 0, width, height)

    def draw(
        self,
        data: mujoco.MjData,
        camera_matrix: Array,
        transform_base_camera: Array,
        window: Window | None = None,
    ) -> Image:
        """Draw what a pinhole camera sees, as BGR; the caller may keep the picture.

        Args:
            data: the world's state, its kinematics computed.
            camera_matrix: intrinsics, shape (3, 3) [px]; the middle of the first pixel is (0, 0).
            transform_base_camera: pose of the optical frame, shape (4, 4).
            window: the part of the picture that is drawn; all of it without.

        Raises:
            InputError: another thread made the renderer.
        """
        if threading.get_ident() != self._thread:
            raise InputError(
                "the camera was made in another thread; make one in the thread that takes pictures"
            )
        _free_dropped()
        self._context.make_current()
        mujoco.mjv_updateScene(
            self._model,
            data,
            self._option,
            None,
            self._free_camera,
            mujoco.mjtCatBit.mjCAT_ALL,
            self._scene,
        )
        part = window or self._whole
        for camera in self._scene.camera:
            _aim(camera, camera_matrix, transform_base_camera, part)
        rect = mujoco.MjrRect(0, 0, part.right - part.left, part.bottom - part.top)
        rgb = np.empty((rect.height, rect.width, 3), np.uint8)
        mujoco.mjr_render(rect, self._scene, self._gl)
        mujoco.mjr_readPixels(rgb, None, rect, self._gl)
        return np.asarray(cv2.flip(cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), 0), np.uint8)

    def close(self) -> None:
        """Give the context back, in another thread when its own draws next; twice does nothing."""
        self._drop()
        _free_dropped()


def _aim(camera: Any, matrix: Array, pose: Array, part: Window) -> None:
    """Let a camera of the scene see a part of what the one with these intrinsics sees."""
    near_x, near_y = _NEAR / matrix[0, 0], _NEAR / matrix[1, 1]
    left = (part.left - 0.5 - matrix[0, 2]) * near_x
    right = (part.right - 0.5 - matrix[0, 2]) * near_x
    camera.pos, camera.forward, camera.up = pose[:3, 3], pose[:3, 2], -pose[:3, 1]
    camera.frustum_center, camera.frustum_width = (left + right) / 2, (right - left) / 2
    camera.frustum_top = (matrix[1, 2] + 0.5 - part.top) * near_y
    camera.frustum_bottom = (matrix[1, 2] + 0.5 - part.bottom) * near_y
    camera.frustum_near, camera.frustum_far = _NEAR, _FAR
    camera.orthographic = 0


# What a context holds is freed in whichever context is current, by numbers that the other one uses
# for its own pictures. So renderers that were dropped, at a time and in a thread of the garbage
# collector's choice, wait here, by thread, until their thread makes their contexts current.
_DROPPED: dict[int, list[tuple[Any, Any]]] = {}


def _put_aside(thread: int, context: Any, gl: Any) -> None:
    _DROPPED.setdefault(thread, []).append((context, gl))


def _free_dropped() -> None:
    """Free what this thread's dropped renderers held."""
    for context, gl in _DROPPED.pop(threading.get_ident(), ()):
        context.make_current()
        gl.free()
        with contextlib.suppress(ctypes.ArgumentError):  # what OSMesa's own clean-up trips over
            context.free()


_VARIABLES = ("MUJOCO_GL", "PYOPENGL_PLATFORM")  # MuJoCo and PyOpenGL read them when imported


@lru_cache(maxsize=1)
def backend() -> tuple[str, Any]:
    """Return the name and the context class of the first backend that works on this machine.

    The environment variable ``MUJOCO_GL`` names one to try before the others.

    Raises:
        ArmError: none works; the message says what to install.
    """
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    names = sorted(BACKENDS, key=lambda name: name != asked)
    reasons = []
    before = {name: os.environ.get(name) for name in _VARIABLES}
    for name in names:
        os.environ.update(dict.fromkeys(_VARIABLES, name))
        try:
            make = import_module(f"mujoco.{name}").GLContext
            context = make(16, 16)
            context.make_current()
            with contextlib.suppress(ctypes.ArgumentError):
                context.free()
        except (ImportError, OSError, RuntimeError, AttributeError, TypeError) as error:
            reasons.append(f"{name}: {(str(error) or repr(error)).splitlines()[0]}")
            for module in [m for m in sys.modules if m.partition(".")[0] == "OpenGL"]:
                del sys.modules[module]  # PyOpenGL settles for one platform when it is imported
            continue
        return name, make
    for variable, value in before.items():  # MuJoCo does not start where they name nonsense
        if value is None:
            del os.environ[variable]
        else:
            os.environ[variable] = value
    raise ArmError(f"nothing to draw with on this machine ({'; '.join(reasons)}); {_CURE}")
