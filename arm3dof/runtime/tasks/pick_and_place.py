"""The task itself: from what the eye sees and the joints say to where the arm is to go next.

``tick`` is asked once a control step. It never waits and never blocks: pictures come when they
come, and until then the arm holds where it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from arm3dof.runtime.tasks.follower import Follower
from arm3dof.runtime.tasks.goals import Goal, Job
from arm3dof.runtime.tasks.gripping import ROOM, Gripping
from arm3dof.runtime.tasks.machine import TRANSITIONS, Event, Failure, Phase, Refusal, Step
from arm3dof.runtime.tasks.route import BRISK, CAREFUL, Leg, Pace, lifted
from arm3dof.runtime.tasks.signals import Command, Gripper, Sight
from arm3dof.state import Array, JointState
from arm3dof.vision.standing import Standing

_LOOKS = 2  # pictures in a row that must agree
_AGREE = 0.006  # [m]
_ROUGHLY = 0.02  # what is seen in part is a rough guess, and an obstacle all the same [m]
_PATIENCE = 2.5  # longest wait for pictures that agree [s]
_SETTLE = 0.12  # fingers that have not moved for so long have stopped [s]
_LONGEST_GRIP = 2.5  # [s]
_OPEN = 0.003  # fingers this near to the opening that they were asked for are open [m]
_SLOW = 0.0008  # fingers slower than this in ``_SETTLE`` have stopped [m]
_LEAST_HOLD = 0.55  # share of a thing's width that fingers leave open while they hold it; a box
# may turn between them, from corner to corner to face to face, which is no loss
_ESCAPE = 0.05  # back along the forearm, out of trouble [m]


class PickAndPlace:
    """Moves things, one after the other, as a goal wants it.

    Attributes:
        phase: what is being done.
        steps: every transition so far.
        failure: why the last thing was not done; None while nothing failed.
    """

    def __init__(
        self, goal: Goal, gripping: Gripping, home: Array, *, time_limit: float = 60.0
    ) -> None:
        """Set the task up.

        Args:
            goal: what it is for.
            gripping: what says how things are grasped.
            home: where the arm waits, out of the camera's view, shape (nv,) [rad].
            time_limit: how long the task may take [s].
        """
        self.phase, self.steps = Phase.LOOK, list[Step]()
        self.failure: Refusal | None = None
        self._goal, self._gripping, self._planner = goal, gripping, gripping.planner
        self._home, self._limit = home, time_limit
        self._open = gripping.widest
        self._job: Job | None = None
        self._sights: list[Sight] = []
        self._way = Follower(self._planner, home)
        self._opening, self._payload = self._open, 0.0
        self._start: float | None = None
        self._began = 0.0
        self._stopped_at: tuple[float, float] = (0.0, 0.0)
        self._held = 0.0
        self._worth = True
        self._returned = False  # whether the thing goes back to where it stood
        self._do: Mapping[Phase, Callable[[float, JointState, Gripper], None]] = {
            Phase.LOOK: self._look,
            Phase.DECIDE: self._decide,
            Phase.CLOSE: self._close,
            Phase.RELEASE: self._release,
            Phase.RETURN: self._return,
        }

    def tick(self, state: JointState, gripper: Gripper, sight: Sight | None) -> Command:
        """Say what is to be done now.

        Args:
            state: what the joints say.
            gripper: what the gripper says.
            sight: the latest picture's things; None before the first.
        """
        t = state.t
        if self._start is None:
            self._start = self._began = t
        if sight is not None and self.phase is Phase.LOOK:
            last = self._sights[-1].taken_at if self._sights else self._began - 1e-9
            if sight.taken_at > last:
                self._sights.append(sight)
        if not self.phase.is_final:
            self._do.get(self.phase, self._move)(t, state, gripper)
            if t - self._start > self._limit and not self.phase.is_final:
                self._fail(t, Refusal(Failure.TIMED_OUT, f"{self._limit:.0f} s"))
        looking = self.phase is Phase.LOOK
        return Command(self._way.target, self._opening, self._payload, looking)

    # ---- seeing and deciding ---------------------------------------------------------------

    def _look(self, t: float, state: JointState, gripper: Gripper) -> None:
        things = _agreed(self._sights)
        if things:
            self._sights.clear()
            self._seen = things
            self._go(t, Event.SEEN, f"{len(things)} things")
        elif t - self._began > _PATIENCE:
            if self._sights and self._goal.ends_when_empty:
                self._go(t, Event.FINISHED, "nothing is left on the table")
                return
            count = len(self._sights)
            told = "no picture came" if count == 0 else f"{count} pictures showed nothing steady"
            self.failure = Refusal(Failure.NOT_SEEN, f"in {_PATIENCE:g} s {told}")
            self._go(t, Event.NOTHING_SEEN, self.failure.sentence)

    def _decide(self, t: float, state: JointState, gripper: Gripper) -> None:
        found = self._goal.choose(self._seen, self._gripping)
        if found is None:
            self._go(t, Event.NOTHING_LEFT)
            return
        if isinstance(found, Refusal):
            self.failure = found
            self._go(t, Event.REFUSED, found.sentence)
            return
        self._job, self._returned = found, False
        refusal = self._set_out(t, state, found)
        if refusal is None:
            thing = found.grip.thing
            self._go(
                t,
                Event.CHOSEN,
                f"{thing.target} at ({thing.x:.3f}, {thing.y:.3f}) m, "
                f"{1000 * thing.width_m:.0f} mm wide, sigma {1000 * thing.sigma_m:.1f} mm",
            )
            return
        self.failure = refusal
        again = self._goal.failed(found, refusal.failure)
        self._go(t, Event.LOOK_AGAIN if again else Event.REFUSED, refusal.sentence)

    def _set_out(self, t: float, state: JointState, job: Job) -> Refusal | None:
        start = self._planner.tool(job.grip.reach.q[0])
        around = (*job.obstacles, self._gripping.obstacle(job.grip.thing))
        legs = self._planner.travel(self._planner.tool(state.q), start, job.grip.opening, around)
        if isinstance(legs, Refusal):
            return legs
        carried = self._ways(job)
        if isinstance(carried, Refusal):
            return carried
        self._opening = job.grip.opening
        self._way.follow(legs, state)
        return None

    def _ways(self, job: Job) -> list[Leg] | Refusal:
        """Return the ways with what is held: up, over, and down onto its place; or why not."""
        planner, point, place = self._planner, job.grip.point, job.placing.point
        top = lifted(point)
        above = _above(place, top)
        held = job.grip.held(planner)
        width = job.grip.thing.width_m
        over = planner.travel(top, above, width, job.obstacles, held)
        if isinstance(over, Refusal):
            return over
        ends = [planner.line(point, top, BRISK), planner.line(above, place, CAREFUL)]
        for line in ends:
            if isinstance(line, str):
                return Refusal(Failure.OUT_OF_REACH, line)
        return over

    # ---- moving ----------------------------------------------------------------------------

    def _move(self, t: float, state: JointState, gripper: Gripper) -> None:
        """Follow the way of this phase to its end, and see that the thing is still held."""
        if self.phase in _CARRYING and not self._holds(gripper):
            self._lose(t, state, gripper)
            return
        progress = self._way.progress(state)
        if progress is Event.ARRIVED:
            self._arrive(t, state, gripper)
        elif progress is Event.STOPPED:
            self._stop(t, state)

    def _arrive(self, t: float, state: JointState, gripper: Gripper) -> None:
        job, planner = self._current, self._planner
        match self.phase:
            case Phase.APPROACH:
                self._way.follow([job.grip.reach], state)
            case Phase.REACH:
                self._opening, self._stopped_at = 0.0, (t, gripper.opening)
            case Phase.LIFT:
                if (refusal := self._carry(state)) is not None:
                    self._put_back(t, state, refusal)
                    return
            case Phase.CARRY:
                here = planner.tool(state.q)
                if (refusal := self._go_to(state, here, job.placing.point)) is not None:
                    self._recover(state, refusal)
                    self._go(t, Event.NO_WAY, refusal.sentence)
                    return
            case Phase.LOWER:
                self._let_go()
            case Phase.RETREAT | Phase.RECOVER:
                if not self._home_from(t, state):
                    return
        self._go(t, Event.ARRIVED)

    def _carry(self, state: JointState) -> Refusal | None:
        """Go above the place, clear of the others with what is held; or say why that cannot be."""
        job, planner = self._current, self._planner
        here = planner.tool(state.q)
        above, held = _above(job.placing.point, here), job.grip.held(planner)
        legs = planner.travel(here, above, self._held, job.obstacles, held)
        if isinstance(legs, Refusal):
            return legs
        self._way.follow(legs, state)
        return None

    def _put_back(self, t: float, state: JointState, refusal: Refusal) -> None:
        """Take what was lifted down to where it stood: there is no way to its place."""
        down = self._go_to(state, self._planner.tool(state.q), self._current.grip.point)
        if down is not None:
            self._fail(t, down)
            return
        self.failure, self._returned = refusal, True
        self._worth = self._goal.failed(self._current, refusal.failure)
        self._go(t, Event.NO_WAY, refusal.sentence)

    def _go_to(
        self, state: JointState, here: Array, point: Array, pace: Pace = CAREFUL
    ) -> Refusal | None:
        """Go straight to a point, or stay and say why that cannot be."""
        line = self._planner.line(here, point, pace)
        if isinstance(line, str):
            self._way.follow([], state)
            return Refusal(Failure.BLOCKED, line)
        self._way.follow([line], state)
        return None

    def _home_from(self, t: float, state: JointState) -> bool:
        """Go home by a way that is clear; give up, and say so, where there is none."""
        planner, around = self._planner, () if self._job is None else self._job.obstacles
        home = planner.tool(self._home)
        legs = planner.travel(planner.tool(state.q), home, self._open, around)
        if isinstance(legs, Refusal):
            legs = planner.direct(state.q, self._home, self._open, around)
        if isinstance(legs, Refusal):
            self._fail(t, legs)
            return False
        self._opening = self._open
        self._way.follow(legs, state)
        return True

    def _stop(self, t: float, state: JointState) -> None:
        goal, planner = self._way.end, self._planner
        miss = 1000 * float(np.linalg.norm(planner.tool(state.q) - planner.tool(goal)))
        refusal = Refusal(
            Failure.BLOCKED,
            f"while it {self.phase.sentence}, {miss:.0f} mm from where it was to be",
        )
        if TRANSITIONS[self.phase][Event.STOPPED] is Phase.RECOVER:
            self._recover(state, refusal)
        elif self.phase is Phase.LOWER:
            self._let_go()
        elif not self._home_from(t, state):
            return
        self._go(t, Event.STOPPED, refusal.detail)

    def _lose(self, t: float, state: JointState, gripper: Gripper) -> None:
        kind = Failure.SLIPPED if self.phase is Phase.LIFT else Failure.DROPPED
        detail = (
            f"while it {self.phase.sentence} the fingers closed from {1000 * self._held:.0f} to "
            f"{1000 * gripper.opening:.0f} mm"
        )
        self._recover(state, Refusal(kind, detail))
        self._go(t, Event.LOST, detail)

    def _recover(self, state: JointState, refusal: Refusal) -> None:
        self.failure, self._payload = refusal, 0.0
        self._worth = self._goal.failed(self._current, refusal.failure)
        self._opening = self._current.grip.opening  # as on the way there, which was clear
        here = self._planner.tool(state.q)
        self._go_to(state, here, here - _ESCAPE * self._planner.forearm(state.q))

    # ---- the gripper -----------------------------------------------------------------------

    def _close(self, t: float, state: JointState, gripper: Gripper) -> None:
        if not self._fingers_stopped(t, gripper):
            return
        job, width = self._current, self._current.grip.thing.width_m
        if not self._holds(gripper):
            detail = (
                f"they met at {1000 * gripper.opening:.0f} mm, the thing is "
                f"{1000 * width:.0f} mm wide"
            )
            self._recover(state, Refusal(Failure.SLIPPED, detail))
            self._go(t, Event.EMPTY, detail)
            return
        self._held, self._payload = gripper.opening, job.payload
        here = self._planner.tool(state.q)
        if (refusal := self._go_to(state, here, lifted(here), BRISK)) is not None:
            self._recover(state, refusal)
            self._go(t, Event.NO_WAY, refusal.sentence)
            return
        self._go(t, Event.HELD, f"{1000 * gripper.opening:.0f} mm")

    def _release(self, t: float, state: JointState, gripper: Gripper) -> None:
        enough = gripper.opening >= self._opening - _OPEN
        if enough or t - self._began > _LONGEST_GRIP:
            back = self._current.placing.retreat
            if self._returned:
                back = Leg(self._current.grip.reach.q[::-1], CAREFUL)
            else:
                self._goal.did(self._current)
                self.failure = None
            self._way.follow([back], state)
            self._go(t, Event.OPENED, f"{1000 * gripper.opening:.0f} mm")

    def _let_go(self) -> None:
        self._opening, self._payload = min(self._held + ROOM, self._open), 0.0

    def _holds(self, gripper: Gripper) -> bool:
        return gripper.opening >= _LEAST_HOLD * self._current.grip.thing.width_m

    def _fingers_stopped(self, t: float, gripper: Gripper) -> bool:
        since, at = self._stopped_at
        if abs(gripper.opening - at) > _SLOW:
            self._stopped_at = (t, gripper.opening)
            return False
        return t - since > _SETTLE or t - self._began > _LONGEST_GRIP

    # ---- ending ----------------------------------------------------------------------------

    def _return(self, t: float, state: JointState, gripper: Gripper) -> None:
        progress = self._way.progress(state)
        if progress is Event.STOPPED:
            self._home_from(t, state)  # from where it is now, or not at all
        if progress is not Event.ARRIVED:
            return
        if self.failure is not None and not self._worth:
            self._go(t, Event.GIVEN_UP, self.failure.sentence)
        else:
            self._go(t, Event.FINISHED if self._goal.finished else Event.MORE)

    def _fail(self, t: float, refusal: Refusal) -> None:
        """Give up, whatever the phase."""
        self.failure = refusal
        self.steps.append(Step(t, self.phase, Event.GIVEN_UP, Phase.FAILED, refusal.sentence))
        self.phase = Phase.FAILED
        self._way.hold()

    # ---- helpers ---------------------------------------------------------------------------

    @property
    def _current(self) -> Job:
        if self._job is None:
            raise RuntimeError("there is no job")
        return self._job

    def _go(self, t: float, event: Event, detail: str = "") -> None:
        target = TRANSITIONS[self.phase][event]
        self.steps.append(Step(t, self.phase, event, target, detail))
        self.phase, self._began = target, t
        if target is Phase.LOOK:
            self._sights.clear()


def _above(place: Array, here: Array) -> Array:
    """Return the point above a place, as high as the tool is, shape (3,) [m]."""
    return np.array([place[0], place[1], max(place[2], here[2])])


_CARRYING = (Phase.LIFT, Phase.CARRY, Phase.LOWER)


def _agreed(sights: Sequence[Sight]) -> tuple[Standing, ...]:
    """Return the things on which the last pictures agree, as the latest shows them."""
    if len(sights) < _LOOKS:
        return ()
    latest, *before = reversed(sights[-_LOOKS:])
    return tuple(
        thing
        for thing in latest.things
        if all(any(_same(thing, other) for other in sight.things) for sight in before)
    )


def _same(thing: Standing, other: Standing) -> bool:
    near = _ROUGHLY if thing.hidden else _AGREE
    return thing.target == other.target and thing.distance_to(other.x, other.y) < near
