"""One open tab: what it may do, and how its wishes reach the studio."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui

from arm3dof.errors import ArmError
from arm3dof.runtime.live import commands as cmd
from arm3dof.ui.studio.studio import Studio


class Tab:
    """A tab of the page and the studio behind it.

    Attributes:
        studio: what stands behind the page.
        id: the tab's name.
    """

    def __init__(self, studio: Studio) -> None:
        """Let the tab that is being built in."""
        self.studio = studio
        self._heard = studio.news[-1][0] if studio.news else 0
        client = ui.context.client
        self.id = client.id
        client.on_connect(lambda: studio.controls.enter(self.id))
        client.on_disconnect(lambda: studio.controls.leave(self.id))

    @property
    def holds(self) -> bool:
        """Whether this tab holds the controls."""
        return self.studio.controls.holds(self.id)

    def ask(self, make: Callable[[], cmd.Command] | cmd.Command) -> bool:
        """Send a command, or say why not; return whether it was sent.

        Args:
            make: the command, or what makes it and may refuse to.
        """
        return self.attempt(lambda: self.studio.ask(make() if callable(make) else make))

    def attempt(self, action: Callable[[], object]) -> bool:
        """Do something that needs the controls; say in one line what keeps it from being done."""
        if not self.holds:
            ui.notify("Another tab holds the controls. Press 'Take the controls' first.")
            return False
        try:
            action()
        except ArmError as error:
            ui.notify(str(error), type="negative", multi_line=True, close_button="Close")
            return False
        return True

    def tell_news(self) -> None:
        """Say what has happened since."""
        for number, news in list(self.studio.news):
            if number > self._heard:
                self._heard = number
                text = news.text[0].upper() + news.text[1:]
                ui.notify(text, type="warning" if news.bad else "info", multi_line=True)

    def take(self) -> None:
        """Take the controls."""
        self.studio.controls.take(self.id)
