"""Tasks in the studio's world: decided elsewhere, late, or not at all."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest

from arm3dof.control.reference import JointTrajectory
from arm3dof.control.step import ControlStep
from arm3dof.errors import ArmError
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.arm import LiveArm
from arm3dof.runtime.live.child import CONTEXT
from arm3dof.runtime.live.frames import Mode
from arm3dof.runtime.live.mind import Decision, Hand, Mind, Moment, OwnMind
from arm3dof.runtime.live.mind_process import MindProcess, RemoteMind
from arm3dof.runtime.live.physics import PhysicsPlant
from arm3dof.runtime.live.plants import RigidPlant
from arm3dof.runtime.live.work import errand
from arm3dof.runtime.tasks.signals import Sight
from arm3dof.sim.world import World
from arm3dof.state import JointState
from arm3dof.ui.studio.start import home, table
from arm3dof.vision.standing import Standing

GRASP = cmd.Do("grasp", "red", (0.16, 0.08))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def world() -> World:
    made = table()
    assert isinstance(made, World)
    return made


def sight(world: World, t: float) -> Sight:
    """What a perfect eye sees of a world that nobody has touched."""
    sure = 1e-8 * np.eye(2)
    standing = (Standing(it.name, it.x, it.y, it.width_m, it.height_m, sure) for it in world.bodies)
    return Sight(tuple(standing), t)


class LateMind(OwnMind):
    """Decides as ever, but a plan comes half a second after it was asked for."""

    late = 25  # control steps

    def tell(self, moment: Moment) -> None:
        super().tell(moment)
        planned = self._decision is not None and self._decision.target is not None
        self._left = self.late if planned else 1

    def decided(self) -> Decision | None:
        self._left -= 1
        return super().decided() if self._left < 0 else None


class NoMind(OwnMind):
    """Has ended."""

    def tell(self, moment: Moment) -> None:
        raise ArmError("what plans tasks has ended; start the program again")


def work(arm: LiveArm, world: World, seconds: float = 60.0) -> np.ndarray:
    """Let the arm grasp the red thing; the frames of that."""
    arm.obey(GRASP)
    frames = []
    while arm.mode is Mode.WORKING and arm.plant.state.t < seconds:
        arm.sight = sight(world, float(arm.plant.state.t))
        frames.append(arm.advance())
    return np.array(frames)


@pytest.mark.slow
def test_a_plan_that_comes_late_is_followed_from_its_beginning(robot: Robot, world: World) -> None:
    arm = LiveArm(PhysicsPlant(robot, world), home(robot), None, world, LateMind())
    frames = work(arm, world)
    assert arm.said == ["the task is done"]
    np.testing.assert_allclose(frames["bodies"][-1, 1, :2], GRASP.place, atol=0.01)
    # no leap: what the controller asks for never leaves what the joints can do
    assert (np.abs(frames["v"]) <= robot.limits.v_max + 1e-3).all()
    assert np.abs(np.diff(frames["tau"], axis=0)).max() < 1.5


def test_a_task_without_anybody_who_decides_fails_and_the_arm_holds(
    robot: Robot, world: World
) -> None:
    arm = LiveArm(PhysicsPlant(robot, world), home(robot), None, world, NoMind())
    work(arm, world)
    assert arm.said == ["what plans tasks has ended; start the program again"]
    assert arm.mode is Mode.HOLDING


def test_another_controller_ends_the_task_with_the_brake(robot: Robot, world: World) -> None:
    arm = LiveArm(PhysicsPlant(robot, world), home(robot), None, world)
    arm.sight = sight(world, 0.0)
    arm.obey(GRASP)
    arm.advance()
    arm.obey(cmd.Control(mpc={"horizon": 15}))
    assert arm.mode is Mode.BRAKING
    assert "the task was given up" in arm.said[0]
    for _ in range(40):
        arm.advance()
    assert arm.mode is Mode.HOLDING


@pytest.fixture
def remote() -> Iterator[RemoteMind]:
    asks, answers = CONTEXT.Pipe()
    process = MindProcess(answers, lambda message: None)
    answers.close()
    mind = RemoteMind(asks)
    yield mind
    process.close()
    with pytest.raises(ArmError, match="what plans tasks has ended"):
        mind.decided()


def wait_for(mind: Mind) -> Decision:
    end = time.monotonic() + 60
    while (decision := mind.decided()) is None:
        assert time.monotonic() < end
        time.sleep(0.005)
    return decision


def test_a_mind_in_a_process_of_its_own_decides_the_same(
    robot: Robot, world: World, remote: RemoteMind
) -> None:
    q = home(robot)
    ways = []
    for mind in (OwnMind(), remote):
        mind.begin(errand(cmd.Do("grasp", "green", (0.2, 0.0)), robot, q, world))  # dropped
        mind.begin(errand(GRASP, robot, q, world))
        for step in range(10):
            t = 0.02 * step
            state = JointState(t, q, np.zeros(3))
            mind.tell(Moment(state, Hand(0.05, False), sight(world, t)))
            if isinstance(way := wait_for(mind).target, JointTrajectory):
                break
        ways.append(way)
    np.testing.assert_array_equal(ways[0].q, ways[1].q)
    np.testing.assert_array_equal(ways[0].times, ways[1].times)


# ---- what encoders tell between two control steps -----------------------------------------------


class Reader:
    """A controller that writes down what it is told."""

    dt = 0.05

    def __init__(self) -> None:
        self.readings: list[float] = []
        self.steps: list[float] = []

    def step(self, state: JointState, target: object) -> ControlStep:
        self.steps.append(state.t)
        return self._answer(state, target)

    def observe(self, state: JointState) -> None:
        self.readings.append(state.t)

    def reset(self) -> None:
        pass


def test_a_controller_is_told_every_reading_of_the_encoders(robot: Robot) -> None:
    arm = LiveArm(RigidPlant(robot), np.zeros(3))
    reader = Reader()
    reader._answer = arm._controller.step
    arm._controller = reader
    arm.obey(cmd.Run())
    while arm.plant.state.t < 0.2 - 1e-9:
        arm.advance()
    np.testing.assert_allclose(reader.steps, [0.0, 0.05, 0.1, 0.15], atol=1e-9)
    expected = np.setdiff1d(np.arange(1, 200), [50, 100, 150]) / 1000
    np.testing.assert_allclose(reader.readings, expected, atol=1e-9)  # every ms, each once
