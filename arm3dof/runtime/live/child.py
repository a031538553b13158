"""A process that serves this one: spoken to through a pipe, and ended cleanly.

On Linux it is forked from a server that has loaded ``ahead`` and runs one thread; elsewhere it is
spawned, and loads all that by itself.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from select import select
from typing import Any

from arm3dof.errors import ArmError

_FORKS = sys.platform == "linux"  # elsewhere system libraries do not bear to be forked
CONTEXT = (
    multiprocessing.get_context("forkserver") if _FORKS else multiprocessing.get_context("spawn")
)


def prepare() -> None:
    """Begin to load what children need, beside what this process goes on with.

    A first child does the same; the sooner it is begun, the sooner that child is ready.
    """
    if not _FORKS:
        return
    forkserver.set_forkserver_preload(["arm3dof.runtime.live.ahead"])
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # the server inherits it
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Child:
    """The handle of a child process.

    The child's function is called with the arguments and its end of the pipe. It is to return when
    ``received`` gives ``None``.
    """

    def __init__(
        self,
        name: str,
        function: Callable[..., None],
        arguments: Sequence[Any],
        on_message: Callable[[Any], None],
    ) -> None:
        """Start the process.

        Args:
            name: what the process is called.
            function: what it does, a function of some module.
            arguments: what is handed to it; its end of the pipe comes last.
            on_message: called from a thread with each message of the child.
        """
        prepare()
        self._name = name
        self._ours, theirs = CONTEXT.Pipe()
        self._process = CONTEXT.Process(
            target=_serve,
            args=(dict(os.environ), function, (*arguments, theirs)),
            name=name,
            daemon=True,
        )
        with _without_main():
            self._process.start()
        theirs.close()
        self._lock = threading.Lock()
        self._thread = threading.Thread(
            target=self._listen, args=(on_message,), name=f"{name}-messages", daemon=True
        )
        self._thread.start()

    @property
    def is_alive(self) -> bool:
        """Whether the process runs."""
        return self._process.is_alive()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return int(self._process.pid or 0)

    def send(self, message: object) -> None:
        """Send a message, from any thread.

        Raises:
            ArmError: the process has ended.
        """
        try:
            with self._lock:
                self._ours.send(message)
        except OSError:
            raise ArmError(f"{self._name} has ended; start the program again") from None

    def ask_to_end(self) -> None:
        """Ask the process to end, without waiting for it."""
        with contextlib.suppress(OSError), self._lock:
            self._ours.send(None)

    def close(self, patience: float = 2.0) -> None:
        """Ask the process to end, and see to it; twice is as good as once.

        Args:
            patience: how long it may take [s].
        """
        self.ask_to_end()
        self._process.join(patience)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._thread.join()
        self._ours.close()

    def _listen(self, on_message: Callable[[Any], None]) -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                on_message(self._ours.recv())


def received(pipe: Connection, wait: float = 0.0) -> list[Any] | None:
    """Return the messages that have come, or ``None`` when the other side has left.

    Args:
        pipe: the child's end.
        wait: how long to wait for a first one [s].
    """
    messages: list[Any] = []
    try:
        while pipe.poll(0.0 if messages else wait):
            message = pipe.recv()
            if message is None:
                return None
            messages.append(message)
    except (EOFError, OSError):
        return None
    return messages


def offer(pipe: Connection, message: object) -> None:
    """Send a small message if that takes no waiting; drop it otherwise."""
    with contextlib.suppress(OSError, ValueError):
        if select([], [pipe.fileno()], [], 0)[1]:
            pipe.send(message)


def _serve(
    environment: dict[str, str], function: Callable[..., None], arguments: Sequence[Any]
) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the parent, and that the child
    os.environ.clear()
    os.environ.update(environment)  # the server's is as old as the server
    function(*arguments)
    os._exit(0)  # all has been said; to take an engine apart piece by piece would cost a second


@contextlib.contextmanager
def _without_main() -> Iterator[None]:
    """Keep a spawned process from running this program's main module anew.

    A child needs nothing from it, and a script without a main guard would start itself again.
    """
    main = sys.modules["__main__"]
    kept = {name: getattr(main, name) for name in ("__spec__", "__file__") if hasattr(main, name)}
    for name in kept:
        setattr(main, name, None)
    try:
        yield
    finally:
        for name, value in kept.items():
            setattr(main, name, value)
