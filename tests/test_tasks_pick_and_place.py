"""The task on a puppet: an arm that goes where it is told, and fingers that hold or do not."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from arm3dof.control.reference import JointTrajectory
from arm3dof.model.library import load_robot
from arm3dof.runtime.tasks.goals import Grasping, Sorting, Tray
from arm3dof.runtime.tasks.gripping import Gripping
from arm3dof.runtime.tasks.machine import Event, Failure, Phase, Refusal
from arm3dof.runtime.tasks.pick_and_place import PickAndPlace
from arm3dof.runtime.tasks.signals import Sight
from arm3dof.state import JointState
from arm3dof.vision.standing import Standing

ROBOT = load_robot("arm3dof")
GRIPPING = Gripping(ROBOT, -0.11)
HOME = GRIPPING.planner.solve((0.11, 0.0, 0.12))
DT = 0.02
PLACE = (0.16, -0.1)


def thing(x=0.18, y=0.05, width=0.03, sigma=0.001, target="red"):
    return Standing(target, x, y, width, 0.045, sigma**2 * np.eye(2))


@dataclass
class Fingers:
    opening: float = 0.05
    moving: bool = False


class Puppet:
    """Plays a task: ``held`` is the width that stops the fingers in a phase, 0 for nothing."""

    def __init__(self, goal, things, *, held=0.03, stuck=(), blind=False, limit=60.0):
        self.task = PickAndPlace(goal, GRIPPING, HOME, time_limit=limit)
        self.things, self.blind, self.stuck = things, blind, stuck
        self.held = held if callable(held) else (lambda phase: held)
        self.t, self.q, self.fingers = 0.0, np.array(HOME), Fingers()
        self.payloads, self.jumps = set(), 0.0

    def run(self, longest=120.0):
        sight = None
        while not self.task.phase.is_final and self.t < longest:
            phase = self.task.phase
            if phase is Phase.LOOK and not self.blind:
                sight = Sight(tuple(self.things()), self.t)
            command = self.task.tick(JointState(self.t, self.q, np.zeros(3)), self.fingers, sight)
            self.payloads.add(command.payload)
            self.t += DT
            target = command.target
            if isinstance(target, JointTrajectory):
                target = target.sample([self.t]).q[0]
            if self.task.phase not in self.stuck:
                self.jumps = max(self.jumps, float(np.abs(np.asarray(target) - self.q).max()))
                self.q = np.array(target)
            wanted = max(command.opening, self.held(self.task.phase))
            self.fingers.opening += float(np.clip(wanted - self.fingers.opening, -0.002, 0.002))
        return self.task

    def phases(self):
        return [step.target for step in self.task.steps]


def test_a_thing_is_grasped_and_placed_phase_by_phase():
    puppet = Puppet(Grasping("red", PLACE, 0.03), lambda: [thing()])
    task = puppet.run()
    assert (task.phase, task.failure) == (Phase.DONE, None)
    assert puppet.phases() == [
        Phase.DECIDE,
        Phase.APPROACH,
        Phase.REACH,
        Phase.CLOSE,
        Phase.LIFT,
        Phase.CARRY,
        Phase.LOWER,
        Phase.RELEASE,
        Phase.RETREAT,
        Phase.RETURN,
        Phase.DONE,
    ]
    assert puppet.payloads == {0.0, 0.03}
    assert puppet.jumps < 0.06  # the target never jumps
    np.testing.assert_allclose(puppet.q, HOME, atol=1e-6)
    assert all(step.reason for step in task.steps)


def test_nothing_is_seen():
    task = Puppet(Grasping("red", PLACE), list).run()
    assert (task.phase, task.failure.failure) == (Phase.FAILED, Failure.NOT_SEEN)
    task = Puppet(Grasping("red", PLACE), list, blind=True).run()
    assert "no picture came" in task.failure.detail
    task = Puppet(Grasping("red", PLACE), lambda: [thing(target="blue")]).run()
    assert task.failure.failure is Failure.NOT_SEEN
    assert "'red'" in task.failure.detail


def test_a_flickering_thing_is_not_believed():
    places = iter([0.16, 0.19] * 500)
    task = Puppet(Grasping("red", PLACE), lambda: [thing(x=next(places))]).run()
    assert task.failure.failure is Failure.NOT_SEEN
    assert "nothing steady" in task.failure.detail


@pytest.mark.parametrize("hidden", [False, True])
def test_what_is_seen_in_part_is_an_obstacle_though_its_place_is_rough(hidden):
    """A whole thing whose place flickers is not believed; a part of one is never quite steady."""
    places = iter([PLACE[0] - 0.004, PLACE[0] + 0.004] * 500)

    def things():
        there = replace(thing(x=next(places), y=PLACE[1], target="blue"), hidden=hidden)
        return [thing(), there]

    task = Puppet(Grasping("red", PLACE), things).run()
    assert (task.phase is Phase.FAILED) == hidden
    if hidden:
        assert task.failure.failure is Failure.BLOCKED
        assert "at the place, (0.160, -0.100) m, stands blue" in task.failure.detail


@pytest.mark.parametrize(
    ("it", "failure"),
    [
        (thing(sigma=0.02), Failure.TOO_UNCERTAIN),
        (thing(x=0.30), Failure.OUT_OF_REACH),
        (thing(width=0.07), Failure.TOO_WIDE),
    ],
)
def test_what_cannot_be_done_is_refused_before_the_arm_moves(it, failure):
    puppet = Puppet(Grasping("red", PLACE), lambda: [it])
    task = puppet.run()
    assert (task.phase, task.failure.failure) == (Phase.FAILED, failure)
    assert puppet.jumps == 0.0


def test_a_thing_with_no_room_beside_it_is_blocked():
    task = Puppet(
        Grasping("red", PLACE), lambda: [thing(), thing(y=0.078, x=0.17, target="blue")]
    ).run()
    assert (task.phase, task.failure.failure) == (Phase.FAILED, Failure.BLOCKED)


def column():
    """A thing so high that nothing is carried over it."""
    return Standing("blue", 0.19, -0.03, 0.03, 0.4, 1e-6 * np.eye(2))


def test_a_thing_that_cannot_be_carried_past_the_others_is_not_picked_up():
    puppet = Puppet(Grasping("red", PLACE, attempts=1), lambda: [thing(), column()])
    task = puppet.run()
    assert (task.phase, task.failure.failure) == (Phase.FAILED, Failure.BLOCKED)
    assert "blue at" in task.failure.detail
    assert Phase.APPROACH not in puppet.phases()
    assert puppet.jumps == 0.0


def test_what_was_lifted_goes_back_where_the_way_to_its_place_is_not_clear_any_more(monkeypatch):
    travel, asked = GRIPPING.planner.travel, []

    def blocked_once_it_is_lifted(start, end, opening, obstacles, held=None):
        asked.append(held is not None)
        if asked.count(True) == 2 and held is not None:
            return Refusal(Failure.BLOCKED, "a cat")
        return travel(start, end, opening, obstacles, held)

    monkeypatch.setattr(GRIPPING.planner, "travel", blocked_once_it_is_lifted)
    goal = Grasping("red", PLACE, 0.03, attempts=1)
    puppet = Puppet(goal, lambda: [thing()])
    task = puppet.run()
    assert (task.phase, task.failure.detail) == (Phase.FAILED, "a cat")
    assert puppet.phases()[-5:-1] == [Phase.LOWER, Phase.RELEASE, Phase.RETREAT, Phase.RETURN]
    assert not goal.finished
    np.testing.assert_allclose(puppet.q, HOME, atol=1e-6)


def test_an_arm_that_finds_no_clear_way_home_stays_and_says_so(monkeypatch):
    def no_way(*arguments):
        return Refusal(Failure.BLOCKED, "a cat")

    planner, puppet = GRIPPING.planner, Puppet(Grasping("red", PLACE), lambda: [thing()])
    done = puppet.task._goal.did

    def did(job):
        done(job)
        monkeypatch.setattr(planner, "travel", no_way)
        monkeypatch.setattr(planner, "direct", no_way)

    puppet.task._goal.did = did
    task = puppet.run()
    assert (task.phase, task.failure.failure) == (Phase.FAILED, Failure.BLOCKED)
    assert task.steps[-1].source is Phase.RETREAT


@pytest.mark.parametrize("where", [Phase.APPROACH, Phase.REACH, Phase.CARRY])
def test_an_arm_that_is_held_up_gives_up_after_some_attempts(where):
    task = Puppet(Grasping("red", PLACE, attempts=2), lambda: [thing()], stuck=(where,)).run()
    assert (task.phase, task.failure.failure) == (Phase.FAILED, Failure.BLOCKED)
    assert where.sentence in task.failure.detail
    assert sum(step.target is Phase.RECOVER for step in task.steps) == 2


def test_fingers_that_hold_nothing_have_slipped():
    task = Puppet(Grasping("red", PLACE, attempts=2), lambda: [thing()], held=0.0).run()
    assert (task.phase, task.failure.failure) == (Phase.FAILED, Failure.SLIPPED)
    assert sum(step.event is Event.EMPTY for step in task.steps) == 2


def test_what_slips_while_it_is_lifted_and_what_is_dropped_on_the_way():
    def lost_in(phases):
        return lambda phase: 0.0 if phase in phases else 0.03

    for phases, failure in (
        ((Phase.LIFT, Phase.CARRY), Failure.SLIPPED),
        ((Phase.CARRY, Phase.LOWER), Failure.DROPPED),
    ):
        puppet = Puppet(
            Grasping("red", PLACE, 0.02, attempts=1), lambda: [thing()], held=lost_in(phases)
        )
        task = puppet.run()
        assert (task.phase, task.failure.failure) == (Phase.FAILED, failure)
        assert task.steps[-1].event is Event.GIVEN_UP


def test_a_second_attempt_may_succeed():
    tries = []

    def held(phase):
        if (
            phase is Phase.CLOSE and (not tries or tries[-1] is not phase)
        ) or phase is not Phase.CLOSE:
            tries.append(phase)
        return 0.03 if tries.count(Phase.CLOSE) > 1 else 0.0

    task = Puppet(Grasping("red", PLACE), lambda: [thing()], held=held).run()
    assert (task.phase, task.failure) == (Phase.DONE, None)


def test_a_task_ends_when_its_time_is_up():
    task = Puppet(Grasping("red", PLACE), lambda: [thing()], limit=1.0).run()
    assert (task.phase, task.failure.failure) == (Phase.FAILED, Failure.TIMED_OUT)


# ---- sorting -------------------------------------------------------------------------------------

TRAYS = [
    Tray("red", 0.02, -0.19, (0.06, 0.06), 0.012),
    Tray("blue", 0.02, 0.19, (0.06, 0.06), 0.012),
]


def test_sorting_goes_on_until_the_table_is_empty():
    left = [thing(y=-0.06), thing(y=0.06, target="blue"), thing(x=0.16, y=0.0)]
    goal = Sorting(TRAYS, {"red": 0.02, "blue": 0.03})
    puppet = Puppet(goal, lambda: left)
    done = goal.did

    def did(job):
        done(job)
        left.remove(job.grip.thing)

    goal.did = did
    task = puppet.run()
    assert (task.phase, task.failure, left) == (Phase.DONE, None, [])
    assert puppet.payloads == {0.0, 0.02, 0.03}
    assert sum(step.target is Phase.RELEASE for step in task.steps) == 3


def test_what_lies_in_a_bin_or_belongs_nowhere_stays():
    things = [thing(x=0.03, y=-0.18), thing(target="yellow")]
    task = Puppet(Sorting(TRAYS), lambda: things).run()
    assert task.phase is Phase.DONE
    assert [step.event for step in task.steps] == [Event.SEEN, Event.NOTHING_LEFT]


def test_sorting_tries_each_thing_some_times_and_says_what_is_left():
    task = Puppet(Sorting(TRAYS, attempts=2), lambda: [thing()], held=0.0).run()
    assert sum(step.event is Event.EMPTY for step in task.steps) == 2
    task = Puppet(Sorting(TRAYS), lambda: [thing(x=0.3)]).run()
    assert (task.phase, task.failure.failure) == (Phase.FAILED, Failure.OUT_OF_REACH)


def test_the_slots_of_a_bin_are_apart_and_inside():
    for tray in TRAYS:
        slots = np.array(tray.slots())
        for slot in slots:
            assert (np.abs(slot - (tray.x, tray.y)) < tray.half_size).all()
        apart = np.linalg.norm(slots[:, None] - slots[None], axis=-1)
        assert apart[np.triu_indices(3, 1)].min() > 0.055
