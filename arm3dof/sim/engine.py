"""MuJoCo, or the one line that says how to get it."""

from __future__ import annotations

import os

from arm3dof.errors import InputError, MissingExtra

try:
    import mujoco
except ImportError as error:
    raise MissingExtra("the physics world", "physics") from error
except RuntimeError as error:
    raise InputError(
        f"MUJOCO_GL is {os.environ.get('MUJOCO_GL')!r}: {str(error).splitlines()[0]}; "
        "unset it, or name egl or osmesa"
    ) from error

# MuJoCo would write MUJOCO_LOG.TXT wherever one stands; a plant says itself when it breaks down
if mujoco.get_mju_user_warning() is None:
    mujoco.set_mju_user_warning(lambda message: None)

__all__ = ["mujoco"]
