"""The states of a task, and what leads from one to the next: all of it as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType


class Phase(StrEnum):
    """What the arm is doing; ``sentence`` says it in words."""

    LOOK = "look"
    DECIDE = "decide"
    APPROACH = "approach"
    REACH = "reach"
    CLOSE = "close"
    LIFT = "lift"
    CARRY = "carry"
    LOWER = "lower"
    RELEASE = "release"
    RETREAT = "retreat"
    RECOVER = "recover"
    RETURN = "return"
    DONE = "done"
    FAILED = "failed"

    @property
    def sentence(self) -> str:
        """The phase in plain words."""
        return _PHASE_SENTENCES[self]

    @property
    def is_final(self) -> bool:
        """Whether the task is over."""
        return self in (Phase.DONE, Phase.FAILED)


_PHASE_SENTENCES = {
    Phase.LOOK: "waits for pictures in which things stand still",
    Phase.DECIDE: "chooses a thing, a grip and a way to it",
    Phase.APPROACH: "goes to the pregrasp, clear of table and things",
    Phase.REACH: "goes along the forearm until the thing is between the fingers",
    Phase.CLOSE: "closes the fingers until something stops them",
    Phase.LIFT: "lifts the thing straight up",
    Phase.CARRY: "carries it above its place",
    Phase.LOWER: "lowers it until it all but stands",
    Phase.RELEASE: "opens the fingers",
    Phase.RETREAT: "draws the hand back along the forearm",
    Phase.RECOVER: "opens the fingers and rises out of the way",
    Phase.RETURN: "goes home, out of the camera's view",
    Phase.DONE: "is done",
    Phase.FAILED: "has given up",
}


class Event(StrEnum):
    """What happened; ``sentence`` says it in words."""

    SEEN = "seen"
    NOTHING_SEEN = "nothing_seen"
    CHOSEN = "chosen"
    NOTHING_LEFT = "nothing_left"
    REFUSED = "refused"
    LOOK_AGAIN = "look_again"
    ARRIVED = "arrived"
    STOPPED = "stopped"
    HELD = "held"
    EMPTY = "empty"
    NO_WAY = "no_way"
    LOST = "lost"
    OPENED = "opened"
    MORE = "more"
    GIVEN_UP = "given_up"
    FINISHED = "finished"

    @property
    def sentence(self) -> str:
        """The event in plain words."""
        return _EVENT_SENTENCES[self]


_EVENT_SENTENCES = {
    Event.SEEN: "the latest pictures agree",
    Event.NOTHING_SEEN: "no picture showed what is wanted",
    Event.CHOSEN: "there is a grip, and a way to it that is clear",
    Event.NOTHING_LEFT: "nothing is left to be done",
    Event.REFUSED: "what is wanted cannot be done",
    Event.LOOK_AGAIN: "another look may help",
    Event.ARRIVED: "the arm is where it was to go",
    Event.STOPPED: "the arm did not get where it was to go",
    Event.HELD: "the fingers have stopped at the thing's width",
    Event.EMPTY: "the fingers have met with nothing between them",
    Event.NO_WAY: "there is no clear way from here",
    Event.LOST: "the fingers have closed further: the thing is gone",
    Event.OPENED: "the fingers are open",
    Event.MORE: "there is more to be done",
    Event.GIVEN_UP: "every attempt has been made",
    Event.FINISHED: "all is done",
}


class Failure(StrEnum):
    """Why something was not done; ``sentence`` says it in words."""

    NOT_SEEN = "not_seen"
    PARTLY_HIDDEN = "partly_hidden"
    TOO_UNCERTAIN = "too_uncertain"
    OUT_OF_REACH = "out_of_reach"
    TOO_WIDE = "too_wide"
    BLOCKED = "blocked"
    SLIPPED = "slipped"
    DROPPED = "dropped"
    TIMED_OUT = "timed_out"

    @property
    def sentence(self) -> str:
        """The failure in plain words."""
        return _FAILURE_SENTENCES[self]


_FAILURE_SENTENCES = {
    Failure.NOT_SEEN: "no thing of the wanted colour was seen on the table",
    Failure.PARTLY_HIDDEN: "the thing is not seen whole",
    Failure.TOO_UNCERTAIN: "it is not known well enough where the thing stands",
    Failure.OUT_OF_REACH: "the hand cannot be brought around the thing",
    Failure.TOO_WIDE: "the thing does not fit between the fingers",
    Failure.BLOCKED: "something is in the way",
    Failure.SLIPPED: "the fingers closed, but held nothing",
    Failure.DROPPED: "the thing was lost on its way",
    Failure.TIMED_OUT: "it took longer than it may",
}


@dataclass(frozen=True)
class Refusal:
    """Why something cannot be done, with its figures.

    Attributes:
        failure: the kind.
        detail: what exactly, with numbers and a cure.
    """

    failure: Failure
    detail: str

    @property
    def sentence(self) -> str:
        """The whole reason."""
        return f"{self.failure.sentence}: {self.detail}"


TRANSITIONS: Mapping[Phase, Mapping[Event, Phase]] = MappingProxyType(
    {
        Phase.LOOK: {
            Event.SEEN: Phase.DECIDE,
            Event.NOTHING_SEEN: Phase.FAILED,
            Event.FINISHED: Phase.DONE,
        },
        Phase.DECIDE: {
            Event.CHOSEN: Phase.APPROACH,
            Event.LOOK_AGAIN: Phase.LOOK,
            Event.REFUSED: Phase.FAILED,
            Event.NOTHING_LEFT: Phase.DONE,
        },
        Phase.APPROACH: {Event.ARRIVED: Phase.REACH, Event.STOPPED: Phase.RECOVER},
        Phase.REACH: {Event.ARRIVED: Phase.CLOSE, Event.STOPPED: Phase.RECOVER},
        Phase.CLOSE: {
            Event.HELD: Phase.LIFT,
            Event.EMPTY: Phase.RECOVER,
            Event.NO_WAY: Phase.RECOVER,
        },
        Phase.LIFT: {
            Event.ARRIVED: Phase.CARRY,
            Event.NO_WAY: Phase.LOWER,
            Event.LOST: Phase.RECOVER,
            Event.STOPPED: Phase.RECOVER,
        },
        Phase.CARRY: {
            Event.ARRIVED: Phase.LOWER,
            Event.NO_WAY: Phase.RECOVER,
            Event.LOST: Phase.RECOVER,
            Event.STOPPED: Phase.RECOVER,
        },
        Phase.LOWER: {
            Event.ARRIVED: Phase.RELEASE,
            Event.LOST: Phase.RECOVER,
            Event.STOPPED: Phase.RELEASE,
        },
        Phase.RELEASE: {Event.OPENED: Phase.RETREAT},
        Phase.RETREAT: {Event.ARRIVED: Phase.RETURN, Event.STOPPED: Phase.RETURN},
        Phase.RECOVER: {Event.ARRIVED: Phase.RETURN, Event.STOPPED: Phase.RETURN},
        Phase.RETURN: {
            Event.FINISHED: Phase.DONE,
            Event.MORE: Phase.LOOK,
            Event.GIVEN_UP: Phase.FAILED,
        },
        Phase.DONE: {},
        Phase.FAILED: {},
    }
)
"""Where each event leads. An event that a phase does not list cannot happen in it."""


@dataclass(frozen=True)
class Step:
    """One transition of a task.

    Attributes:
        t: when [s].
        source: the phase that ended.
        event: what ended it.
        target: the phase that began.
        detail: what exactly happened, with numbers; may be empty.
    """

    t: float
    source: Phase
    event: Event
    target: Phase
    detail: str = ""

    @property
    def reason(self) -> str:
        """Why the phase ended, in a sentence."""
        return self.event.sentence + (f" ({self.detail})" if self.detail else "")
