"""The process in which a task decides, so that the arm's loop never waits for a plan."""

from __future__ import annotations

from collections.abc import Callable
from multiprocessing.connection import Connection, wait
from typing import Any

from arm3dof.errors import ArmError
from arm3dof.runtime.live.child import Child, received
from arm3dof.runtime.live.mind import Decision, Errand, Moment, Thinker, Thought
from arm3dof.runtime.tasks.machine import Phase

_GONE = "what plans tasks has ended; start the program again"


class RemoteMind:
    """The arm's end of a mind that lives in another process."""

    def __init__(self, line: Connection) -> None:
        """Take up the line to it."""
        self._line, self._errand = line, 0

    def begin(self, errand: Errand) -> None:
        """Take up an errand."""
        self._errand += 1
        self._send(errand)

    def tell(self, moment: Moment) -> None:
        """Ask for a decision."""
        self._send(moment)

    def decided(self) -> Decision | None:
        """Return the decision when it has come; those of errands before are dropped."""
        answers = received(self._line)
        if answers is None:
            raise ArmError(_GONE)
        mine = [decision for errand, decision in answers if errand == self._errand]
        return mine[-1] if mine else None

    def _send(self, message: Errand | Moment) -> None:
        try:
            self._line.send((self._errand, message))
        except OSError:
            raise ArmError(_GONE) from None


class MindProcess(Child):
    """The handle of a mind in a process of its own."""

    def __init__(self, line: Connection, on_message: Callable[[Any], None]) -> None:
        """Start the process.

        Args:
            line: the line to the arm.
            on_message: called from a thread with each message; there are none.
        """
        super().__init__("arm3dof-mind", _think, (line,), on_message)


def _think(line: Connection, pipe: Connection) -> None:
    """Be the mind's process."""
    thinker = Thinker()
    thought: Thought | None = None
    while True:
        ready = wait([line, pipe])
        if pipe in ready and received(pipe) is None:
            return
        if line not in ready:
            continue
        messages = received(line)
        if messages is None:
            return  # the arm has gone
        for number, message in messages:
            try:
                if isinstance(message, Errand):
                    thought = thinker.begin(message)
                elif thought is not None:
                    line.send((number, thought.decide(message)))
            except ArmError as error:
                line.send((number, Decision(None, None, 0.0, Phase.FAILED, str(error))))
            except OSError:
                return
