"""Who holds the controls: many tabs may look, one at a time may touch."""

from __future__ import annotations

from collections.abc import Callable


class Controls:
    """Lends the controls to one tab.

    Attributes:
        holder: the tab that holds them; ``None`` when they are free.
    """

    def __init__(self, on_lost: Callable[[], None]) -> None:
        """Create controls that nobody holds.

        Args:
            on_lost: called when the tab that held them is gone.
        """
        self.holder: str | None = None
        self._on_lost = on_lost
        self._tabs: dict[str, None] = {}

    def enter(self, tab: str) -> None:
        """Let a tab in; it gets the controls when nobody has them."""
        self._tabs[tab] = None
        if self.holder is None:
            self.holder = tab

    def leave(self, tab: str) -> None:
        """Let a tab go. When it held the controls, the arm is made safe and they are free."""
        self._tabs.pop(tab, None)
        if self.holder == tab:
            self.holder = None
            self._on_lost()

    def take(self, tab: str) -> None:
        """Give the controls to a tab that asks for them."""
        self._tabs[tab] = None
        self.holder = tab

    def holds(self, tab: str) -> bool:
        """Return whether a tab holds the controls."""
        return self.holder == tab

    @property
    def tabs(self) -> int:
        """Number of tabs that are open."""
        return len(self._tabs)
