"""From a picture to a motion: vision, inverse kinematics and model predictive control for arms.

The names below are the package's public surface. Each is imported when it is first used, so that
``import arm3dof`` is quick and ``arm3dof doctor`` can speak even when Pinocchio cannot be loaded.
Colour vision, the physics world, drawing and the browser page live in ``arm3dof.vision``,
``arm3dof.sim`` and ``arm3dof.ui``.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from arm3dof.control.mpc import MpcController
    from arm3dof.control.reference import JointTrajectory, cartesian_path
    from arm3dof.control.settings import MpcSettings
    from arm3dof.control.step import Controller, ControlStatus, ControlStep, TorqueSource
    from arm3dof.errors import (
        ArmError,
        FrameNotFound,
        InputError,
        MissingExtra,
        MissingFile,
        Problem,
        RobotError,
    )
    from arm3dof.model.dh import DhGeometry
    from arm3dof.model.dynamics import ClosedForm
    from arm3dof.model.kinematics import Reach, inverse_kinematics
    from arm3dof.model.library import list_robots, load_robot
    from arm3dof.model.reach import Reason, Singularity
    from arm3dof.model.robot import Description, Limits, Robot
    from arm3dof.runtime.loop import run_loop
    from arm3dof.runtime.metrics import Metrics, summarise
    from arm3dof.runtime.recording import Recording
    from arm3dof.sim.pinocchio_plant import PinocchioPlant
    from arm3dof.sim.plant import Plant
    from arm3dof.state import JointState
    from arm3dof.ui.notebook import show

__version__ = "0.1.0"

__all__ = [
    "ArmError",
    "ClosedForm",
    "ControlStatus",
    "ControlStep",
    "Controller",
    "Description",
    "DhGeometry",
    "FrameNotFound",
    "InputError",
    "JointState",
    "JointTrajectory",
    "Limits",
    "Metrics",
    "MissingExtra",
    "MissingFile",
    "MpcController",
    "MpcSettings",
    "PinocchioPlant",
    "Plant",
    "Problem",
    "Reach",
    "Reason",
    "Recording",
    "Robot",
    "RobotError",
    "Singularity",
    "TorqueSource",
    "__version__",
    "cartesian_path",
    "inverse_kinematics",
    "list_robots",
    "load_robot",
    "run_loop",
    "show",
    "summarise",
]

_HOME = {
    "arm3dof.control.mpc": ("MpcController",),
    "arm3dof.control.reference": ("JointTrajectory", "cartesian_path"),
    "arm3dof.control.settings": ("MpcSettings",),
    "arm3dof.control.step": ("ControlStatus", "ControlStep", "Controller", "TorqueSource"),
    "arm3dof.errors": (
        "ArmError",
        "FrameNotFound",
        "InputError",
        "MissingExtra",
        "MissingFile",
        "Problem",
        "RobotError",
    ),
    "arm3dof.model.dh": ("DhGeometry",),
    "arm3dof.model.dynamics": ("ClosedForm",),
    "arm3dof.model.kinematics": ("Reach", "inverse_kinematics"),
    "arm3dof.model.library": ("list_robots", "load_robot"),
    "arm3dof.model.reach": ("Reason", "Singularity"),
    "arm3dof.model.robot": ("Description", "Limits", "Robot"),
    "arm3dof.runtime.loop": ("run_loop",),
    "arm3dof.runtime.metrics": ("Metrics", "summarise"),
    "arm3dof.runtime.recording": ("Recording",),
    "arm3dof.sim.pinocchio_plant": ("PinocchioPlant",),
    "arm3dof.sim.plant": ("Plant",),
    "arm3dof.state": ("JointState",),
    "arm3dof.ui.notebook": ("show",),
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}


if not TYPE_CHECKING:  # a type checker sees the imports above, and refuses unknown names

    def __getattr__(name: str) -> object:
        """Import a public name from the module that defines it (PEP 562)."""
        if name not in _MODULE_OF:
            raise AttributeError(f"module 'arm3dof' has no attribute '{name}'")
        value = getattr(import_module(_MODULE_OF[name]), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
