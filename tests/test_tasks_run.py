"""A task and a plant joined: the task alone says when it is over."""

from types import SimpleNamespace

import numpy as np
import pytest

from arm3dof.control.settings import MpcSettings
from arm3dof.model.library import load_robot
from arm3dof.runtime.tasks.machine import Phase
from arm3dof.runtime.tasks.run import REST, run_task
from arm3dof.runtime.tasks.signals import Command
from arm3dof.sim.pinocchio_plant import PinocchioPlant

HOME = np.array([0.0, 0.5, -0.5])


class Arm(PinocchioPlant):
    """An arm whose gripper does nothing."""

    gripper = SimpleNamespace(opening=0.0, moving=False)

    def command_gripper(self, opening_m):
        pass


class Waiting:
    """A task that holds still for so long."""

    def __init__(self, seconds):
        self.phase, self.steps, self.failure, self.seconds = Phase.RETURN, [], None, seconds

    def tick(self, state, gripper, sight):
        if state.t >= self.seconds:
            self.phase = Phase.DONE
        return Command(HOME, 0.0, 0.0, looking=False)


@pytest.mark.parametrize("seconds", [1.0, 100.0])
def test_a_task_takes_as_long_as_it_takes(seconds):
    robot = load_robot("arm3dof")
    plant = Arm(robot, dt=0.05)
    eye = SimpleNamespace(sight=lambda t, looking: None)
    result = run_task(Waiting(seconds), plant, eye, robot, settings=MpcSettings(dt=0.1, horizon=5))
    assert result.done
    assert result.failure is None
    assert result.duration == pytest.approx(seconds, abs=0.15)
    assert plant.state.t == pytest.approx(result.duration + REST, abs=0.15)
