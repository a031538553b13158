"""An in-process MeshCat: it keeps the scene and sends it to every browser that connects.

``MeshcatWindow`` has the methods of ``meshcat.visualizer.ViewerWindow``, so that
``meshcat.Visualizer(window=window)`` and Pinocchio's ``MeshcatVisualizer`` draw into it, without
MeshCat's own server: no subprocess, no ZMQ, no thread. Drawing is allowed from any thread.

A scene is a set of commands. The window keeps the last one of each kind for each path, so its
memory is bounded by what is drawn, however often a property is set. Clients only listen: a client
that sends anything is disconnected, and one that reads too slowly is dropped (its page connects
again and gets the whole scene anew).
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
import webbrowser
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Protocol

import msgpack
import numpy as np
from starlette.routing import BaseRoute, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from arm3dof.errors import InputError
from arm3dof.ui.page import page_routes, static_page

Command = Mapping[str, object]

ANIMATION = "set_animation"
# MeshCat's "set_control" is missing on purpose: the viewer would evaluate its text as code.
SCENE_COMMANDS = frozenset({"set_object", "set_transform", "set_property", "delete", ANIMATION})
PAGE_COMMANDS = frozenset({"caption", "views", "replay"})  # understood by our own page
MAX_PENDING = 512  # messages a client may be behind, some 15 s of a moving arm
MAX_PENDING_BYTES = 1 << 25
CLOSE_WAIT = 0.5  # s

POLICY_VIOLATION = 1008
TRY_AGAIN_LATER = 1013


class MeshcatCommand(Protocol):
    """A command object of the ``meshcat`` package."""

    def lower(self) -> Command:
        """Return the command as plain data."""
        ...


class MeshcatWindow:
    """The scene, and the browsers that show it.

    Attributes:
        web_url: address of the page, once a server serves it.
    """

    def __init__(self) -> None:
        self.web_url = ""
        self._changed = threading.Condition()
        self._scene: dict[tuple[str, ...], bytes] = {}
        self._clients: set[_Client] = set()

    # ---- drawing ---------------------------------------------------------------------------

    def send(self, command: MeshcatCommand) -> None:
        """Keep one command of the ``meshcat`` package and show it.

        Raises:
            InputError: the command is of a kind that the page does not take.
        """
        self.post(command.lower())

    def post(self, *commands: Command) -> None:
        """Keep commands and show them together, in one frame.

        Args:
            commands: plain MeshCat commands, or the page's own (caption, views, replay).

        Raises:
            InputError: a command is of a kind that the page does not take.
        """
        packed = [(command, _pack(command)) for command in commands]
        with self._changed:
            for command, data in packed:
                self._keep(command, data)
            message = _batch([data for _, data in packed])
            for client in self._clients:
                client.offer(message)

    def snapshot(self) -> bytes:
        """Return the whole scene as one message."""
        with self._changed:
            return self._snapshot()

    def get_scene(self) -> str:
        """Return the scene as one HTML page that needs no server."""
        return static_page(self.snapshot())

    # ---- the rest of ViewerWindow ----------------------------------------------------------

    def open(self) -> MeshcatWindow:
        """Open the page in the desktop's browser.

        Raises:
            InputError: no server serves this window.
        """
        if not self.web_url:
            raise InputError("web_url is empty; serve the window first, for example with serve()")
        webbrowser.open(self.web_url, new=2)
        return self

    def wait(self, timeout: float | None = None) -> bool:
        """Block until a browser shows the scene; return whether one does.

        Args:
            timeout: longest wait [s]; ``None`` waits for ever.
        """
        with self._changed:
            return self._changed.wait_for(lambda: bool(self._clients), timeout)

    @property
    def client_count(self) -> int:
        """Number of browsers that are connected."""
        with self._changed:
            return len(self._clients)

    # ---- serving ---------------------------------------------------------------------------

    def routes(self) -> list[BaseRoute]:
        """Return the routes of the page and its scene, to serve alone or to mount elsewhere."""
        return [*page_routes(), WebSocketRoute("/scene", self.endpoint)]

    async def endpoint(self, websocket: WebSocket) -> None:
        """Serve one browser until it leaves, speaks, or falls too far behind."""
        await websocket.accept()
        client = _Client(asyncio.get_running_loop())
        with self._changed:
            client.offer(self._snapshot())
            self._clients.add(client)
            self._changed.notify_all()
        heard = asyncio.create_task(_hear(websocket))
        behind = asyncio.create_task(client.is_behind.wait())
        tasks = {heard, behind, asyncio.create_task(client.pump(websocket))}
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            with self._changed:
                self._clients.discard(client)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        spoke = heard in done and heard.result()
        if spoke or behind in done:
            code = POLICY_VIOLATION if spoke else TRY_AGAIN_LATER
            with contextlib.suppress(TimeoutError, WebSocketDisconnect):
                await asyncio.wait_for(websocket.close(code), CLOSE_WAIT)

    # ---- the scene -------------------------------------------------------------------------

    def _keep(self, command: Command, data: bytes) -> None:
        kind = str(command["type"])
        if kind in PAGE_COMMANDS:
            self._scene[kind,] = data
            return
        path = _normalise(str(command["path"]))
        if kind == "delete":
            self._forget(path)
        elif kind == "set_property":
            self._scene[kind, path, str(command["property"])] = data
        else:
            if kind == "set_object":  # the new object starts without the old one's properties
                self._forget(path.rstrip("/") + "/<object>")
            self._scene[kind, path] = data

    def _forget(self, path: str) -> None:
        below = path.rstrip("/") + "/"
        gone = [
            key
            for key in self._scene
            if len(key) > 1 and (key[1] == path or key[1].startswith(below))
        ]
        for key in gone:
            del self._scene[key]

    def _snapshot(self) -> bytes:
        # an animation binds to nodes by path, and the replay moves them: both come last
        return _batch(
            [
                self._scene[key]
                for late in (False, True)
                for key in self._scene
                if (key[0] in (ANIMATION, "replay")) is late
            ]
        )


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


# ---- packing -----------------------------------------------------------------------------------


def _pack(command: Command) -> bytes:
    kind = command.get("type")
    if kind not in SCENE_COMMANDS | PAGE_COMMANDS:
        known = ", ".join(sorted(SCENE_COMMANDS | PAGE_COMMANDS))
        raise InputError(f"the page takes no command {kind!r}; it takes: {known}")
    data: bytes = msgpack.packb(command, default=_plain)
    return data


def _plain(value: object) -> object:
    """Turn numpy numbers and the ``meshcat`` package's arrays into what msgpack packs."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    code, data = getattr(value, "type", None), getattr(value, "data", None)
    if isinstance(code, int) and isinstance(data, bytes):  # umsgpack.Ext
        return msgpack.ExtType(code, data)
    raise InputError(f"cannot send {value!r} to the page; give plain numbers, text, lists or bytes")


def _batch(commands: Sequence[bytes]) -> bytes:
    """Join packed commands into one, which the page carries out in one go."""
    packer = msgpack.Packer(autoreset=False)
    packer.pack_map_header(2)
    for text in ("type", "batch", "commands"):
        packer.pack(text)
    packer.pack_array_header(len(commands))
    return bytes(packer.bytes()) + b"".join(commands)


def _normalise(path: str) -> str:
    return "/" + "/".join(part for part in path.split("/") if part)
