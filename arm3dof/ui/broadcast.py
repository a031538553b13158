"""Websockets that only listen, and what is sent to all of them from any thread.

A client that sends anything is disconnected, and one that reads too slowly is dropped: its page
connects again and is welcomed anew.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections import deque
from collections.abc import Callable

from starlette.websockets import WebSocket, WebSocketDisconnect

MAX_PENDING = 512  # messages a client may be behind, some 15 s of a moving arm
MAX_PENDING_BYTES = 1 << 25
CLOSE_WAIT = 0.5  # s

POLICY_VIOLATION = 1008
TRY_AGAIN_LATER = 1013


class Broadcast:
    """The clients that are connected.

    Attributes:
        changed: held while clients come and go; hold it to change what ``welcome`` returns and
            to ``send`` the change in one go.
    """

    def __init__(self, welcome: Callable[[], bytes]) -> None:
        """Create a broadcast that nobody listens to.

        Args:
            welcome: returns the first message of a new client; nothing is sent when it is empty.
        """
        self.changed = threading.Condition()
        self._welcome = welcome
        self._clients: set[_Client] = set()

    def send(self, message: bytes) -> None:
        """Send a message to every client, from any thread."""
        with self.changed:
            for client in self._clients:
                client.offer(message)

    def wait(self, timeout: float | None = None) -> bool:
        """Block until somebody listens; return whether somebody does.

        Args:
            timeout: longest wait [s]; ``None`` waits for ever.
        """
        with self.changed:
            return self.changed.wait_for(lambda: bool(self._clients), timeout)

    @property
    def count(self) -> int:
        """Number of clients that are connected."""
        with self.changed:
            return len(self._clients)

    async def endpoint(self, websocket: WebSocket) -> None:
        """Serve one client until it leaves, speaks, or falls too far behind."""
        await websocket.accept()
        client = _Client(asyncio.get_running_loop())
        with self.changed:
            if first := self._welcome():
                client.offer(first)
            self._clients.add(client)
            self.changed.notify_all()
        heard = asyncio.create_task(_hear(websocket))
        behind = asyncio.create_task(client.is_behind.wait())
        tasks = {heard, behind, asyncio.create_task(client.pump(websocket))}
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            with self.changed:
                self._clients.discard(client)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        spoke = heard in done and heard.result()
        if spoke or behind in done:
            code = POLICY_VIOLATION if spoke else TRY_AGAIN_LATER
            with contextlib.suppress(TimeoutError, WebSocketDisconnect):
                await asyncio.wait_for(websocket.close(code), CLOSE_WAIT)


class _Client:
    """One browser and the messages that it has yet to get; its state belongs to the loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.is_behind = asyncio.Event()
        self._loop = loop
        self._pending: deque[bytes] = deque()
        self._pending_bytes = 0
        self._wake = asyncio.Event()

    def offer(self, message: bytes) -> None:
        """Queue a message, from any thread."""
        self._loop.call_soon_threadsafe(self._accept, message)

    def _accept(self, message: bytes) -> None:
        count, size = len(self._pending), self._pending_bytes + len(message)
        if count >= MAX_PENDING or (count > 0 and size > MAX_PENDING_BYTES):
            self._pending.clear()
            self.is_behind.set()
        elif not self.is_behind.is_set():
            self._pending.append(message)
            self._pending_bytes = size
            self._wake.set()

    async def pump(self, websocket: WebSocket) -> None:
        """Send what is pending until the browser is gone."""
        with contextlib.suppress(WebSocketDisconnect):
            while await self._wake.wait():
                self._wake.clear()
                while self._pending:
                    message = self._pending.popleft()
                    self._pending_bytes -= len(message)
                    await websocket.send_bytes(message)


async def _hear(websocket: WebSocket) -> bool:
    """Wait for the browser to speak (true, and against the rules) or to leave (false)."""
    message = await websocket.receive()
    return str(message["type"]) != "websocket.disconnect"
