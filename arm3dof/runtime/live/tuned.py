"""What a person has tuned: the arm's parameters and its controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.runtime.live import commands as cmd


@dataclass(frozen=True)
class Tuned:
    """An arm and its controller, as they are now.

    Attributes:
        source: name or path of the robot.
        overrides: URDF parameters that differ from the robot's file, SI units.
        servo: the servo in every joint; empty for the URDF's own limits.
        control: the controller.
    """

    source: str = "arm3dof"
    overrides: Mapping[str, float] = field(default_factory=dict)
    servo: str = ""
    control: cmd.Control = field(default_factory=cmd.Control)

    def load_robot(self) -> Robot:
        """Load the arm.

        Raises:
            ArmError: there is no such arm, or a parameter is impossible.
        """
        overrides = dict(self.overrides) or None
        return load_robot(self.source, overrides=overrides, servos=self.servo or None)
