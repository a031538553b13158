"""What stands between the torque that is commanded and the arm: the motors' delay, and a hand."""

from __future__ import annotations

from collections import deque

import numpy as np

from arm3dof.control.step import Controller, ReadsBetweenSteps
from arm3dof.errors import InputError
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.plants import LivePlant
from arm3dof.state import Array


class Motion:
    """Moves a plant step by step, and adds up what that costs.

    Attributes:
        plant: the body that moves.
        energy: integral of |tau . v| since it was set to zero [J].
        given: what the motors gave in the last step, shape (nv,) [N m].
    """

    def __init__(self, plant: LivePlant) -> None:
        """Take up a plant, whose motors answer at once."""
        self.plant, self.energy = plant, 0.0
        self.given: Array = np.zeros(plant.robot.nv)
        self._commands: deque[Array] = deque()
        self._push, self._push_left = np.zeros(plant.robot.nv), 0

    def delay(self, seconds: float, tau: Array) -> None:
        """Let commands act later from now on.

        Args:
            seconds: how much later [s].
            tau: torque of the motors until the first one acts, shape (nv,) [N m].
        """
        self.given = tau
        self._commands = deque([tau] * round(seconds / self.plant.dt))

    def push(self, push: cmd.Push) -> None:
        """Let the surroundings push a joint for a while.

        Raises:
            InputError: there is no such joint.
        """
        nv = self.plant.robot.nv
        if not 0 <= push.joint < nv:
            raise InputError(f"joint is {push.joint}; give 0 to {nv - 1}")
        self._push = push.torque * np.eye(nv)[push.joint]
        self._push_left = round(push.duration / self.plant.dt)

    def move(self, tau: Array, steps: int, told: Controller | None, *, is_last: bool) -> None:
        """Hold a torque for some steps of the plant.

        Args:
            tau: torque that is commanded, shape (nv,) [N m].
            steps: how many.
            told: who is told what the encoders read between two control steps, if it makes use
                of that.
            is_last: whether the last reading is the next control step's own.
        """
        plant = self.plant
        reader = told if isinstance(told, ReadsBetweenSteps) else None
        for left in reversed(range(steps)):
            self._commands.append(tau)
            pushed = self._push_left > 0
            push = self._push if pushed else None
            state = plant.step(self._commands.popleft(), external_torque=push)
            self._push_left -= pushed
            self.given = plant.applied_torque
            self.energy += float(np.abs(self.given @ state.v)) * plant.dt
            if reader is not None and (left or not is_last):
                reader.observe(plant.measure())
