"""An in-process MeshCat: it keeps the scene and sends it to every browser that connects.

``MeshcatWindow`` has the methods of ``meshcat.visualizer.ViewerWindow``, so that
``meshcat.Visualizer(window=window)`` and Pinocchio's ``MeshcatVisualizer`` draw into it, without
MeshCat's own server: no subprocess, no ZMQ, no thread. Drawing is allowed from any thread.

A scene is a set of commands. The window keeps the last one of each kind for each path, so its
memory is bounded by what is drawn, however often a property is set.
"""

from __future__ import annotations

import webbrowser
from collections.abc import Mapping, Sequence
from typing import Protocol

import msgpack
import numpy as np
from starlette.routing import BaseRoute, WebSocketRoute

from arm3dof.errors import InputError
from arm3dof.ui.broadcast import Broadcast
from arm3dof.ui.page import page_routes, static_page

Command = Mapping[str, object]

ANIMATION = "set_animation"
# MeshCat's "set_control" is missing on purpose: the viewer would evaluate its text as code.
SCENE_COMMANDS = frozenset({"set_object", "set_transform", "set_property", "delete", ANIMATION})
PAGE_COMMANDS = frozenset({"caption", "views", "replay", "report"})  # understood by our own page


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
        self._listeners = Broadcast(self._snapshot)
        self._lock = self._listeners.changed
        self._scene: dict[tuple[str, ...], bytes] = {}

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
            commands: plain MeshCat commands, or the page's own (caption, views, replay,
                report).

        Raises:
            InputError: a command is of a kind that the page does not take.
        """
        packed = [(command, _pack(command)) for command in commands]
        with self._lock:
            for command, data in packed:
                self._keep(command, data)
            self._listeners.send(_batch([data for _, data in packed]))

    def snapshot(self) -> bytes:
        """Return the whole scene as one message."""
        with self._lock:
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
        return self._listeners.wait(timeout)

    @property
    def client_count(self) -> int:
        """Number of browsers that are connected."""
        return self._listeners.count

    # ---- serving ---------------------------------------------------------------------------

    def routes(self) -> list[BaseRoute]:
        """Return the routes of the page and its scene, to serve alone or to mount elsewhere."""
        return [*page_routes(), WebSocketRoute("/scene", self._listeners.endpoint)]

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
