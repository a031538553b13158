"""The newest item of a source that has a rhythm of its own, drawn from it by a thread."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from time import monotonic
from typing import Generic, TypeVar

from arm3dof.closing import Closing
from arm3dof.errors import ArmError

Item = TypeVar("Item")

_PATIENCE = 2.0  # how long closing waits for a source that does not answer [s]


class Latest(Generic[Item], Closing):
    """Draws items from a source in a thread and keeps the newest; older ones are dropped.

    Whoever asks never waits for the source. Use it in a ``with`` block, or ``close`` it.
    """

    def __init__(self, source: Iterable[Item], name: str = "latest") -> None:
        """Begin to draw.

        Args:
            source: yields items at its own pace; an ``ArmError`` from it ends the drawing, and
                ``failure`` says it.
            name: what the thread is called.
        """
        self._source = source
        self._news = threading.Condition()
        self._item: Item | None = None
        self._count = 0
        self._failure: str | None = None
        self._ended = self._closing = False
        self._thread = threading.Thread(target=self._draw, name=name, daemon=True)
        self._thread.start()

    @property
    def item(self) -> Item | None:
        """The newest item; None before the first."""
        with self._news:
            return self._item

    @property
    def count(self) -> int:
        """How many items there have been."""
        with self._news:
            return self._count

    @property
    def failure(self) -> str | None:
        """Why the source has failed, in one line; None when it has not."""
        with self._news:
            return self._failure

    @property
    def ended(self) -> bool:
        """Whether no more items will come: the source has ended or failed, or this is closed."""
        with self._news:
            return self._ended

    def wait(self, count: int = 1, timeout: float | None = None) -> Item | None:
        """Wait until there have been some items, or no more will come.

        Args:
            count: how many.
            timeout: the longest wait; for ever without it [s].

        Returns:
            The newest item then; None when there is none.
        """
        with self._news:
            self._news.wait_for(lambda: self._count >= count or self._ended, timeout)
            return self._item

    def fresh(self) -> Iterator[Item]:
        """Yield the newest item again and again, each once, and wait where it is not new."""
        seen = 0
        while True:
            with self._news:
                while self._count == seen and not self._ended:
                    self._news.wait()
                if self._count == seen or self._item is None:
                    return
                seen, item = self._count, self._item
            yield item

    def close(self) -> None:
        """Stop drawing; a source that does not answer is left to itself."""
        with self._news:
            self._closing = self._ended = True
            self._news.notify_all()
        if threading.current_thread() is not self._thread:
            self._thread.join(_PATIENCE)

    def _draw(self) -> None:
        items = iter(self._source)
        try:
            for item in items:
                with self._news:
                    if self._closing:
                        break
                    self._item = item
                    self._count += 1
                    self._news.notify_all()
        except ArmError as error:
            with self._news:
                self._failure = " ".join(str(error).split())
        finally:
            with self._news:
                self._ended = True
                self._news.notify_all()
            if (close := getattr(items, "close", None)) is not None:
                close()


def stamped(source: Iterable[Item]) -> Iterator[tuple[Item, float]]:
    """Yield each item with the monotonic time at which it came [s]."""
    for item in source:
        yield item, monotonic()
