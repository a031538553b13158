"""The error tree: one root, and under it a class for each contract that can be broken.

Every message names the thing, its value and the cure. Each class also derives from the builtin
that a caller would expect, so ``except ValueError`` keeps working. An expected outcome (a target
out of reach, nothing seen in a picture) is a value, not an error.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass


class ArmError(Exception):
    """Root of every error that arm3dof raises on purpose."""

    def __str__(self) -> str:
        """Return the message as written (``KeyError`` would quote it)."""
        return " ".join(str(arg) for arg in self.args)


class InputError(ArmError, ValueError):
    """An argument has a value, shape or type that the call cannot take."""


class MissingFile(ArmError, FileNotFoundError):
    """A file that was named does not exist or cannot be read."""


class CameraLost(ArmError, ConnectionError):
    """A camera or a stream that gave pictures gives none any more."""


class MissingExtra(ArmError, ImportError):
    """An optional dependency is needed and not installed."""

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(f"{what} needs the extra '{extra}': pip install 'arm3dof[{extra}]'")


class FrameNotFound(ArmError, KeyError):
    """A frame, link or joint was named that the robot does not have."""

    def __init__(self, name: str, known: Iterable[str], kind: str = "frame") -> None:
        super().__init__(f"no {kind} '{name}'; this robot has: {', '.join(known)}")


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with an input.

    Attributes:
        where: the element at fault, for example ``link 'forearm'``.
        what: what is wrong with it, with its value.
        cure: what to do about it.
    """

    where: str
    what: str
    cure: str

    def __str__(self) -> str:
        """Return the problem as one line."""
        return f"{self.where}: {self.what}; {self.cure}"


class RobotError(InputError):
    """A robot description is broken or unsupported.

    Attributes:
        problems: every problem that was found, in document order.
    """

    def __init__(self, source: str, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__(f"{source}: " + " | ".join(str(problem) for problem in problems))
