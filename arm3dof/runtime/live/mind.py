"""What decides in a task, apart from what moves: it is told of moments and answers with decisions.

To choose a grip and a way to it takes longer than a control step. So the arm tells, goes on with
what it was to do, and takes the decision when it comes; who decides may live in another process.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from arm3dof.control.reference import Target
from arm3dof.runtime.parallel import PackedRobot
from arm3dof.runtime.tasks.goals import Goal
from arm3dof.runtime.tasks.gripping import Gripping
from arm3dof.runtime.tasks.machine import Phase
from arm3dof.runtime.tasks.pick_and_place import PickAndPlace
from arm3dof.runtime.tasks.signals import Sight
from arm3dof.state import Array, JointState


class Errand(NamedTuple):
    """A task and all that has to be known to decide in it.

    Attributes:
        goal: what it is for.
        robot: the arm as its controller knows it.
        home: where the arm waits while the camera looks, shape (nv,) [rad].
        table_height: of the table in the base frame [m].
        time_limit: how long the task may take [s].
    """

    goal: Goal
    robot: PackedRobot
    home: Array
    table_height: float
    time_limit: float


@dataclass(frozen=True)
class Hand:
    """What the gripper says of itself, at one moment.

    Attributes:
        opening: distance of the pads [m].
        moving: whether its set-point is still on its way.
    """

    opening: float
    moving: bool


class Moment(NamedTuple):
    """What a task is told.

    Attributes:
        state: what the joints say.
        hand: what the gripper says.
        sight: the latest that the eye knows.
    """

    state: JointState
    hand: Hand
    sight: Sight | None


class Decision(NamedTuple):
    """What a task asks for until the next decision.

    Attributes:
        target: where the joints are to be; ``None`` for where they were to be before.
        opening: of the gripper [m]; ``None`` for no wish.
        payload: what is held, as far as it is known [kg].
        phase: what is being done.
        why: why it failed, in words; empty while it has not.
    """

    target: Target | None
    opening: float | None
    payload: float
    phase: Phase
    why: str = ""


class Mind(Protocol):
    """Takes up one errand at a time and decides, one moment after the other."""

    def begin(self, errand: Errand) -> None:
        """Take up an errand, and forget the one before.

        Raises:
            ArmError: nobody is there to decide.
        """

    def tell(self, moment: Moment) -> None:
        """Ask for a decision; ask again when it has come.

        Raises:
            ArmError: nobody is there to decide.
        """

    def decided(self) -> Decision | None:
        """Return the decision, once; ``None`` while there is none.

        Raises:
            ArmError: nobody is there to decide.
        """


class Thought:
    """Decides in one errand, and takes the time that it takes."""

    def __init__(self, errand: Errand, gripping: Gripping) -> None:
        """Begin.

        Args:
            errand: the task.
            gripping: what says how things are grasped.
        """
        self._task = PickAndPlace(errand.goal, gripping, errand.home, time_limit=errand.time_limit)
        self._told: Target | None = None

    def decide(self, moment: Moment) -> Decision:
        """Return what is to be done."""
        task = self._task
        wish = task.tick(moment.state, moment.hand, moment.sight)
        target = None if wish.target is self._told else wish.target
        self._told = wish.target
        why = "" if task.failure is None else task.failure.sentence
        return Decision(target, wish.opening, wish.payload, task.phase, why)


class Thinker:
    """Begins errands; what it knows of an arm it keeps from one to the next."""

    def __init__(self) -> None:
        """Know no arm."""
        self._arm: tuple[PackedRobot, float] | None = None
        self._gripping: Gripping | None = None

    def begin(self, errand: Errand) -> Thought:
        """Return what decides in an errand."""
        arm = (errand.robot, errand.table_height)
        if self._gripping is None or arm != self._arm:
            self._arm = arm
            self._gripping = Gripping(errand.robot.unpack(), errand.table_height)
        return Thought(errand, self._gripping)


class OwnMind:
    """A mind in this process: its decisions are there at once, and time waits for them."""

    def __init__(self) -> None:
        """Have nothing to do."""
        self._thinker = Thinker()
        self._thought: Thought | None = None
        self._decision: Decision | None = None

    def begin(self, errand: Errand) -> None:
        """Take up an errand."""
        self._thought, self._decision = self._thinker.begin(errand), None

    def tell(self, moment: Moment) -> None:
        """Decide."""
        if self._thought is not None:
            self._decision = self._thought.decide(moment)

    def decided(self) -> Decision | None:
        """Return the decision."""
        decision, self._decision = self._decision, None
        return decision
