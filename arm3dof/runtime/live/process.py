"""The process in which the arm lives, and the handle by which another process reaches it.

The arm's loop waits for nobody: commands are taken when they are there, frames go into a ring,
and news that nobody reads are dropped. When the other process falls silent or ends, the arm
brakes and holds.
"""

from __future__ import annotations

import contextlib
import gc
import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from typing import NamedTuple

import numpy as np

from arm3dof.errors import ArmError
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.arm import LiveArm
from arm3dof.runtime.live.child import CONTEXT, Child, offer, received
from arm3dof.runtime.live.frames import Mode, Ring, frame_type
from arm3dof.runtime.live.mind import Mind
from arm3dof.runtime.live.mind_process import RemoteMind
from arm3dof.runtime.live.pace import Clock, Pacer, WallClock
from arm3dof.runtime.live.plants import RigidPlant
from arm3dof.runtime.parallel import PackedRobot
from arm3dof.runtime.tasks.signals import Sight
from arm3dof.sim.world import World

_REHEARSAL = 0.2  # [s]
SILENCE = 1.0
"""How long the page may say nothing before the arm brakes [s]."""


@dataclass(frozen=True)
class ArmSpec:
    """What the arm's world is made of, as it is sent to its process.

    Attributes:
        robot: the arm.
        start: joint positions to begin at [rad].
        control: the controller to begin with.
        world: what stands around the arm, which needs MuJoCo; the arm alone without one.
    """

    robot: PackedRobot
    start: tuple[float, ...]
    control: cmd.Control = field(default_factory=cmd.Control)
    world: World | None = None

    def build(self, mind: Mind | None = None) -> LiveArm:
        """Build the world; ``mind`` decides in its tasks."""
        robot = self.robot.unpack()
        if self.world is None:
            return LiveArm(RigidPlant(robot), np.array(self.start), self.control)
        from arm3dof.runtime.live.physics import PhysicsPlant  # needs MuJoCo

        plant = PhysicsPlant(robot, self.world)
        return LiveArm(plant, np.array(self.start), self.control, self.world, mind)

    def ring(self, make: Callable[..., object] = CONTEXT.RawArray) -> Ring:
        """Return an empty ring for the frames of this world."""
        bodies = 0 if self.world is None else len(self.world.bodies)
        return Ring(frame_type(len(self.start), bodies), make)


class News(NamedTuple):
    """Something that happened in the arm's process, in words.

    Attributes:
        text: what.
        bad: whether something that was asked for was not done.
    """

    text: str
    bad: bool = False


class ArmLoop:
    """Drives a ``LiveArm`` by a clock, between a source of commands and a ring of frames."""

    def __init__(
        self,
        arm: LiveArm,
        ring: Ring,
        receive: Callable[[], list[cmd.Command] | None],
        tell: Callable[[News], None],
        clock: Clock,
        look: Callable[[], Sight | None] = lambda: None,
    ) -> None:
        """Create a loop.

        Args:
            arm: what is driven.
            ring: where its frames go.
            receive: returns the commands that have come since; ``None`` when nobody is left to
                send any.
            tell: takes news, without ever waiting.
            clock: what time is kept by.
            look: returns what the eye has found since; ``None`` for no news.
        """
        self._look = look
        self._arm, self._ring, self._receive, self._tell = arm, ring, receive, tell
        self._clock, self._pacer = clock, Pacer(clock)
        self._heard = clock.now()
        self._alone = False

    def run(self) -> None:
        """Go on until nobody is left and the arm is at rest."""
        while not (self._alone and self._arm.mode is Mode.HOLDING):
            self.tick()

    def tick(self) -> None:
        """Obey what has come, let one frame pass, and wait for the next."""
        self._listen()
        if (sight := self._look()) is not None:
            self._arm.sight = sight
        frame_time = self._arm.frame_time
        frame = self._arm.advance()
        while self._arm.said:
            self._tell(News(self._arm.said.pop(0)))
        frame["missed"] = self._pacer.missed
        frame["lateness"] = self._pacer.wait(frame_time)
        self._ring.write(frame)

    def _listen(self) -> None:
        if self._alone:
            return
        commands = self._receive()
        now = self._clock.now()
        if commands is None:
            self._alone = True
            self._arm.stop()
            return
        if commands:
            self._heard = now
        elif now - self._heard > SILENCE and self._arm.mode in (Mode.RUNNING, Mode.WORKING):
            self._arm.stop()
            self._tell(News("the page fell silent, so the arm was stopped", bad=True))
        for command in commands:
            self._obey(command)

    def _obey(self, command: cmd.Command) -> None:
        try:
            self._arm.obey(command)
        except ArmError as error:
            self._tell(News(str(error), bad=True))
        if isinstance(command, cmd.Stop) and command.why:
            self._tell(News(command.why, bad=True))


class ArmProcess(Child):
    """The handle of a running arm.

    Attributes:
        ring: its frames.
        spec: what its world is made of.
    """

    def __init__(
        self,
        spec: ArmSpec,
        on_news: Callable[[News], None],
        sights: Connection | None = None,
        mind: Connection | None = None,
    ) -> None:
        """Start the process.

        Args:
            spec: what the world is made of.
            on_news: called from a thread with what happens there.
            sights: where what the eye has found comes from.
            mind: the line to what decides in tasks, in another process; time waits without.
        """
        self.spec, self.ring = spec, spec.ring()
        super().__init__("arm3dof-arm", _live, (spec, self.ring, sights, mind), on_news)


def rehearse(spec: ArmSpec) -> None:
    """Let an arm that nobody sees make a move, so that nothing is done for the first time later.

    The first control steps fill tables and take up to 50 ms, a hundred times as long as the next.
    """
    arm = replace(spec, world=None).build()
    limits = arm.plant.robot.limits
    far = np.clip(limits.q_max, spec.start, np.add(spec.start, 2.0))
    arm.obey(cmd.Aim(tuple(far.tolist())))
    arm.obey(cmd.Run())
    while arm.plant.state.t < _REHEARSAL:
        arm.advance()


def _go_first() -> None:
    """Go before all ordinary programs, where the system lets this one; else before some of them.

    The arm takes a quarter of a core, and the system keeps a share for the others whatever it does.
    """
    with contextlib.suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, 0, -10)
    with contextlib.suppress(OSError, AttributeError):
        policy = os.SCHED_RR | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(os.sched_get_priority_min(os.SCHED_RR)))


def _live(
    spec: ArmSpec,
    ring: Ring,
    sights: Connection | None,
    mind: Connection | None,
    pipe: Connection,
) -> None:
    """Be the arm's process."""
    _go_first()
    os.environ["MUJOCO_GL"] = "disable"  # nothing is drawn here, and to load a renderer takes time
    arm = spec.build(None if mind is None else RemoteMind(mind))
    arm.advance()  # imports and first allocations happen before time counts
    rehearse(spec)
    gc.collect()
    gc.freeze()
    gc.disable()  # nothing here makes cycles; a collection would be late for the arm

    def look() -> Sight | None:
        found = [] if sights is None else received(sights)
        return found[-1] if found else None

    loop = ArmLoop(
        arm, ring, lambda: received(pipe), lambda news: offer(pipe, news), WallClock(), look
    )
    loop.run()
