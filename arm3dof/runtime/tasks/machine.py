"""The states of a task, and what leads from one to the next: all of it as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Self


class Worded(StrEnum):
    """A word with a sentence: members are made of both.

    Attributes:
        sentence: what it means, in plain words.
    """

    sentence: str

    def __new__(cls, word: str, sentence: str = "") -> Self:
        """Make a member of a word and its sentence."""
        member = str.__new__(cls, word)
        member._value_ = word
        member.sentence = sentence
        return member


class Phase(Worded):
    """What the arm is doing; ``sentence`` says it in words."""

    LOOK = "look", "waits for pictures in which things stand still"
    DECIDE = "decide", "chooses a thing, a grip and a way to it"
    APPROACH = "approach", "goes to the pregrasp, clear of table and things"
    REACH = "reach", "goes along the forearm until the thing is between the fingers"
    CLOSE = "close", "closes the fingers until something stops them"
    LIFT = "lift", "lifts the thing straight up"
    CARRY = "carry", "carries it above its place"
    LOWER = "lower", "lowers it until it all but stands"
    RELEASE = "release", "opens the fingers"
    RETREAT = "retreat", "draws the hand back along the forearm"
    RECOVER = "recover", "opens the fingers and rises out of the way"
    RETURN = "return", "goes home, out of the camera's view"
    DONE = "done", "is done"
    FAILED = "failed", "has given up"

    @property
    def is_final(self) -> bool:
        """Whether the task is over."""
        return self in (Phase.DONE, Phase.FAILED)


class Event(Worded):
    """What happened; ``sentence`` says it in words."""

    SEEN = "seen", "the latest pictures agree"
    NOTHING_SEEN = "nothing_seen", "no picture showed what is wanted"
    CHOSEN = "chosen", "there is a grip, and a way to it that is clear"
    NOTHING_LEFT = "nothing_left", "nothing is left to be done"
    REFUSED = "refused", "what is wanted cannot be done"
    LOOK_AGAIN = "look_again", "another look may help"
    ARRIVED = "arrived", "the arm is where it was to go"
    STOPPED = "stopped", "the arm did not get where it was to go"
    HELD = "held", "the fingers have stopped at the thing's width"
    EMPTY = "empty", "the fingers have met with nothing between them"
    NO_WAY = "no_way", "there is no clear way from here"
    LOST = "lost", "the fingers have closed further: the thing is gone"
    OPENED = "opened", "the fingers are open"
    MORE = "more", "there is more to be done"
    GIVEN_UP = "given_up", "no further attempt is made"
    FINISHED = "finished", "all is done"


class Failure(Worded):
    """Why something was not done; ``sentence`` says it in words."""

    NOT_SEEN = "not_seen", "no thing of the wanted colour was seen on the table"
    PARTLY_HIDDEN = "partly_hidden", "the thing is not seen whole"
    TOO_UNCERTAIN = "too_uncertain", "it is not known well enough where the thing stands"
    OUT_OF_REACH = "out_of_reach", "the hand cannot be brought around the thing"
    TOO_WIDE = "too_wide", "the thing does not fit between the fingers"
    BLOCKED = "blocked", "something is in the way"
    SLIPPED = "slipped", "the fingers closed, but held nothing"
    DROPPED = "dropped", "the thing was lost on its way"
    TIMED_OUT = "timed_out", "it took longer than it may"


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
"""Where each event leads. An event that a phase does not list cannot happen in it, but that a task
without time or without a way on fails in any phase, by ``GIVEN_UP``."""


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
