"""What the arm, the eye and the mind have in common, loaded once in the process they fork from.

Only the server of ``child`` imports this module. What is missing here each process loads, and
misses, by itself.
"""

from __future__ import annotations

import contextlib
import gc
import os
from importlib import import_module

from arm3dof.errors import ArmError

_GL = "MUJOCO_GL"
_SHARED = ("process", "eye_process", "mind_process")
_WITH_MUJOCO = "physics"


def _load() -> None:
    for name in _SHARED:
        import_module(f"arm3dof.runtime.live.{name}")
    asked = os.environ.get(_GL)
    os.environ[_GL] = "disable"  # to load a renderer takes time, and only the eye draws
    try:
        with contextlib.suppress(ImportError, ArmError):
            import_module(f"arm3dof.runtime.live.{_WITH_MUJOCO}")
    finally:
        del os.environ[_GL]
        if asked is not None:
            os.environ[_GL] = asked


gc.disable()  # nothing that is loaded here is ever freed
_load()
gc.freeze()
gc.enable()
