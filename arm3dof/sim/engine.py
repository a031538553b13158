"""MuJoCo, or the one line that says how to get it."""

from __future__ import annotations

from arm3dof.errors import MissingExtra

try:
    import mujoco
except ImportError as error:
    raise MissingExtra("the physics world", "physics") from error

__all__ = ["mujoco"]
