"""NiceGUI without what the studio has no use for: clients, and servers other than its own.

NiceGUI's websocket library can be a client as well, and run under Tornado; it takes up what it
finds installed for that, and goes on without where it finds nothing. To find nothing saves a
quarter of the time in which the page loads.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

UNUSED = ("aiohttp", "requests", "tornado", "websocket")


@contextmanager
def without_clients() -> Iterator[None]:
    """Let nothing that is imported in this block find the modules ``UNUSED``.

    Those that have been loaded before stay, and later imports find them all again.
    """
    hidden: dict[str, Any] = {name: None for name in UNUSED if name not in sys.modules}
    sys.modules.update(hidden)  # None stands for a module that is not to be found
    try:
        yield
    finally:
        for name in hidden:
            del sys.modules[name]
