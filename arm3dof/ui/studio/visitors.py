"""Pages that were sent, and whose browser has not come back for them yet."""

from __future__ import annotations

from nicegui import Client

MOST = 16
"""How many of them are kept."""


class Visitors:
    """Keeps the pages that are waited for few: for one too many, the oldest is given up.

    A page costs memory and time from when it is built, and a robot that only reads it, or a reload
    before it has come, leaves it to NiceGUI for a minute. A browser whose page was given up loads
    it anew by itself.
    """

    def __init__(self, most: int = MOST) -> None:
        """Begin without any.

        Args:
            most: how many pages may be waited for.
        """
        self._most = most
        self._expected: dict[str, Client] = {}

    @property
    def expected(self) -> int:
        """How many pages are waited for."""
        return len(self._expected)

    def expect(self, client: Client) -> None:
        """Wait for the browser of a page that is being built."""
        name = client.id

        def forget() -> None:
            self._expected.pop(name, None)

        client.on_connect(forget)
        client.on_delete(forget)
        self._expected[name] = client
        while len(self._expected) > self._most:
            oldest = next(iter(self._expected))
            self._expected.pop(oldest).delete()
