"""MuJoCo, or the one line that says how to get it."""

from __future__ import annotations

from arm3dof.errors import MissingExtra

try:
    import mujoco
except ImportError as error:
    raise MissingExtra("the physics world", "physics") from error

# MuJoCo would write MUJOCO_LOG.TXT wherever one stands; a plant says itself when it breaks down
if mujoco.get_mju_user_warning() is None:
    mujoco.set_mju_user_warning(lambda message: None)

__all__ = ["mujoco"]
