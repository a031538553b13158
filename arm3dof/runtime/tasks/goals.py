"""What a task is for: which thing comes next, and where it belongs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Protocol

from arm3dof.runtime.tasks.clearance import Obstacle
from arm3dof.runtime.tasks.gripping import Grip, Gripping, Placing
from arm3dof.runtime.tasks.machine import Failure, Refusal
from arm3dof.vision.standing import Standing

_DROPS = (0.0, 0.015, 0.03)  # above a bin's walls, from which a thing may fall into it [m]
_SAME = 0.02  # things nearer than this to where one was before are the same thing [m]


@dataclass(frozen=True, eq=False)
class Job:
    """One thing to be moved.

    Attributes:
        grip: how it is grasped.
        placing: how it is put down.
        place: where it is to stand, (x, y) [m].
        obstacles: what else stands around.
        payload: its mass as far as it is known [kg].
    """

    grip: Grip
    placing: Placing
    place: tuple[float, float]
    obstacles: tuple[Obstacle, ...]
    payload: float


class Goal(Protocol):
    """Decides what a task does next from what the eye sees."""

    def choose(self, things: Sequence[Standing], gripping: Gripping) -> Job | Refusal | None:
        """Return the next job, why what is wanted cannot be done, or None when all is done."""

    @property
    def finished(self) -> bool:
        """Whether all is done, without another look."""

    @property
    def ends_when_empty(self) -> bool:
        """Whether an empty table means that all is done."""

    def did(self, job: Job) -> None:
        """Note that a job's thing was put down."""

    def failed(self, job: Job, failure: Failure) -> bool:
        """Note that a job failed, and return whether it is worth another attempt."""


@dataclass(frozen=True)
class Tray:
    """A bin as the task knows it: where it is and what belongs into it.

    Attributes:
        target: name of the target that belongs into it.
        x: of its middle [m].
        y: of its middle [m].
        half_size: (x, y) of its half lengths inside the walls [m].
        wall_m: height of its walls [m].
    """

    target: str
    x: float
    y: float
    half_size: tuple[float, float]
    wall_m: float

    def holds(self, thing: Standing, slack: float = 0.015) -> bool:
        """Whether a thing stands inside the walls, or on them."""
        dx, dy = abs(thing.x - self.x), abs(thing.y - self.y)
        return dx <= self.half_size[0] + slack and dy <= self.half_size[1] + slack

    def slots(self, count: int = 3) -> tuple[tuple[float, float], ...]:
        """Return places in it, evenly around its middle, (x, y) each [m]."""
        radius = 0.62 * min(self.half_size)
        outwards = math.atan2(self.y, self.x)
        turns = (outwards + 2 * math.pi * k / count for k in range(count))
        return tuple((self.x + radius * math.cos(a), self.y + radius * math.sin(a)) for a in turns)


class Grasping:
    """One thing of a colour, from where it is to a place."""

    def __init__(
        self, target: str, place: tuple[float, float], payload: float = 0.0, attempts: int = 3
    ) -> None:
        """Say what is wanted.

        Args:
            target: name of the target.
            place: where it belongs, (x, y) in the base frame [m].
            payload: its mass as far as it is known [kg].
            attempts: how often it is tried.
        """
        self._target, self._place, self._payload = target, place, payload
        self._left, self.finished, self.ends_when_empty = attempts, False, False

    def choose(self, things: Sequence[Standing], gripping: Gripping) -> Job | Refusal | None:
        """Return the job of the first thing that can be grasped; see ``Goal``."""
        if self.finished:
            return None
        wanted = [thing for thing in things if thing.target == self._target]
        refusal = Refusal(Failure.NOT_SEEN, f"wanted is '{self._target}'")
        for thing in wanted:
            others = tuple(gripping.obstacle(it) for it in things if it is not thing)
            job = _job(gripping, thing, others, self._place, self._payload)
            if isinstance(job, Job):
                return job
            refusal = job
        return refusal

    def did(self, job: Job) -> None:
        """Note that the thing was put down."""
        self.finished = True

    def failed(self, job: Job, failure: Failure) -> bool:
        """Count an attempt; return whether there is another."""
        self._left -= 1
        return self._left > 0


class Sorting:
    """Every thing to the bin of its colour, until the table is empty."""

    def __init__(
        self, trays: Sequence[Tray], payload: Mapping[str, float] | float = 0.0, attempts: int = 3
    ) -> None:
        """Say where things belong.

        Args:
            trays: the bins; things of other targets stay.
            payload: mass of a thing as far as it is known, or by target [kg].
            attempts: how often each thing is tried.
        """
        self._trays = {tray.target: tray for tray in trays}
        self._payload, self._attempts = payload, attempts
        self._filled: dict[str, list[Obstacle]] = {name: [] for name in self._trays}
        self._tried: list[tuple[Standing, int]] = []
        self.given_up: list[Refusal] = []
        self.finished, self.ends_when_empty = False, True

    def choose(self, things: Sequence[Standing], gripping: Gripping) -> Job | Refusal | None:
        """Return the job that is easiest to do; see ``Goal``."""
        loose = [it for it in things if not any(t.holds(it) for t in self._trays.values())]
        wanted = [it for it in loose if it.target in self._trays and self._tries(it) > 0]
        # what lies in a bin may be out of the camera's view, and is remembered
        stored = [it for filled in self._filled.values() for it in filled]
        found = [
            self._job(
                gripping,
                thing,
                (*(gripping.obstacle(it) for it in loose if it is not thing), *stored),
            )
            for thing in wanted
        ]
        if jobs := [it for it in found if isinstance(it, Job)]:
            return max(jobs, key=_ease)
        self.given_up = [it for it in found if isinstance(it, Refusal)]
        if self.given_up:
            return self.given_up[0]
        return None

    def did(self, job: Job) -> None:
        """Note that a thing is in its bin."""
        thing, (x, y) = job.grip.thing, job.place
        name = f"what was put down at ({x:.3f}, {y:.3f}) m"
        radius = thing.width_m / 2
        top = job.placing.point[2] - job.grip.height + thing.height_m
        self._filled[thing.target].append(Obstacle(name, x, y, radius, float(top)))

    def failed(self, job: Job, failure: Failure) -> bool:
        """Count an attempt at a thing; there are always others."""
        thing = job.grip.thing
        left = self._tries(thing) - 1
        self._tried = [it for it in self._tried if it[0].distance_to(thing.x, thing.y) > _SAME]
        self._tried.append((thing, left))
        return True

    def _tries(self, thing: Standing) -> int:
        for before, left in self._tried:
            if before.target == thing.target and before.distance_to(thing.x, thing.y) < _SAME:
                return left
        return self._attempts

    def _job(
        self, gripping: Gripping, thing: Standing, others: tuple[Obstacle, ...]
    ) -> Job | Refusal:
        tray, payload = self._trays[thing.target], self._payload
        mass = payload if isinstance(payload, float | int) else payload.get(thing.target, 0.0)
        slots = tray.slots()
        first = len(self._filled[thing.target]) % len(slots)
        job: Job | Refusal = Refusal(Failure.OUT_OF_REACH, "there is no such bin")
        free = slots[first:] + slots[:first]
        for drop, slot in product(_DROPS, free):  # from higher up where the hand has no room
            job = _job(gripping, thing, others, slot, float(mass), tray.wall_m + drop)
            if isinstance(job, Job):
                break
        return job


def _job(
    gripping: Gripping,
    thing: Standing,
    others: tuple[Obstacle, ...],
    place: tuple[float, float],
    payload: float,
    floor: float = 0.0,
) -> Job | Refusal:
    grip = gripping.grip(thing, others)
    if isinstance(grip, Refusal):
        return grip
    placing = gripping.placing(grip, *place, others, floor)
    if isinstance(placing, Refusal):
        return placing
    return Job(grip, placing, place, others, payload)


def _ease(job: Job) -> float:
    """Return how far the thing is from the others [m]: what stands free goes first."""
    thing = job.grip.thing
    gaps = [thing.distance_to(it.x, it.y) - it.radius for it in job.obstacles]
    return min(gaps, default=1.0)
