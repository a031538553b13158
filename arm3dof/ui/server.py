"""One web server on one loopback port, in a thread of this process.

``LocalServer`` runs any ASGI application, so the 3-D page can be served alone or be mounted
beside other pages. The socket listens on 127.0.0.1 only and ``LoopbackGuard`` stands before
every route; who wants it to listen elsewhere has to give a token, and ``TokenGuard`` stands there.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import os
import socket
import threading
from collections.abc import Sequence
from types import TracebackType

import uvicorn
from starlette.applications import Starlette
from starlette.routing import BaseRoute
from starlette.types import ASGIApp
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from arm3dof.errors import ArmError, InputError
from arm3dof.ui.guard import LoopbackGuard
from arm3dof.ui.meshcat_window import MeshcatWindow
from arm3dof.ui.token import HOST, TokenGuard, check_entry

# A broken frame from a client is no news for the terminal; who configures logging still gets it.
logging.getLogger("uvicorn").addHandler(logging.NullHandler())

MAX_PORT = 65535
MAX_FRAME = 1 << 20  # bytes in a websocket message from a client
GRACE = 2  # s: how long open requests may take to end when the server stops
WAIT_STEP = 0.2  # s: a wait without a timeout cannot be interrupted on every system
PING_PERIOD = 1.0  # s between an answer on a watched websocket and the next ping
PONG_PATIENCE = 2.0  # s for a browser to answer one, which it does even while its page is busy


class _Config(uvicorn.Config):
    """uvicorn's configuration, and which websockets are watched."""

    watched: tuple[str, ...] = ()


class _WebSocketProtocol(WebSocketsSansIOProtocol):
    """uvicorn's websocket protocol, which also lets go of a client that stopped reading.

    ``transport.close`` waits for the peer to take what is buffered, and a peer that never reads
    would hold its socket for ever. Watched websockets are pinged often.
    """

    def start_keepalive(self) -> None:
        """Ping the client from now on."""
        path = self.request.path  # as it was asked for: a mounted application changes its scope
        if isinstance(self.config, _Config) and path.startswith(self.config.watched):
            self.ping_interval, self.ping_timeout = PING_PERIOD, PONG_PATIENCE
        super().start_keepalive()

    def keepalive_timeout(self) -> None:
        """Let go of a client that has not answered, without waiting for it to take anything."""
        super().keepalive_timeout()
        self.transport.abort()

    async def run_asgi(self) -> None:
        """Run the endpoint, then abort the connection if its buffer is stuck."""
        await super().run_asgi()
        if not self.writable.is_set():
            self.transport.abort()


class _Uvicorn(uvicorn.Server):
    """uvicorn that says when it is ready and leaves no socket behind."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.ready = threading.Event()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start, then wake the thread that waits for it."""
        await super().startup(sockets=sockets)
        self.ready.set()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop, then abort connections that did not end in time."""
        await super().shutdown(sockets=sockets)
        for connection in list(self.server_state.connections):
            if connection.transport is not None:
                connection.transport.abort()
        await asyncio.sleep(0)  # the aborted transports close on the next turn of the loop


class LocalServer:
    """Serves an ASGI application, on 127.0.0.1 unless told otherwise, while a ``with`` block runs.

    The port is taken at construction, so ``url`` is known, and a taken port is reported, before
    anything is served. ``stop`` may be called at any time and twice; after it no thread, socket
    or task is left. A stopped server does not start again: make a new one.

    Attributes:
        port: the port that it listens on.

    Args:
        app: the application; wrapped in ``LoopbackGuard``, or in ``TokenGuard`` with a token.
        port: the port to listen on; 0 takes any free one.
        host: the address to listen on; one beyond this machine needs a token.
        token: the secret that a browser has to know.
        watched: how the paths of websockets begin whose loss is to be noticed in some three
            seconds, however it comes: by a cut cable, too. Few messages should go there: a
            browser answers a ping only once its page has taken what came before.

    Raises:
        InputError: the port is not a port number, is taken or may not be used; the host is no
            address of this machine; or a token is missing or too short.
    """

    def __init__(
        self,
        app: ASGIApp,
        port: int = 0,
        *,
        host: str = HOST,
        token: str | None = None,
        watched: Sequence[str] = (),
    ) -> None:
        check_entry(host, token)
        self._host = host
        self._socket = _listen(host, port)
        self.port: int = self._socket.getsockname()[1]
        config = _Config(
            _guard(app, self.port, token),
            loop="asyncio",
            http="h11",
            ws=_WebSocketProtocol,
            ws_max_size=MAX_FRAME,
            ws_per_message_deflate=False,  # pictures are packed, and numbers few
            log_config=None,
            access_log=False,
            server_header=False,
            proxy_headers=False,
            timeout_graceful_shutdown=GRACE,
        )
        config.watched = tuple(watched)
        self._server = _Uvicorn(config)
        self._ended = threading.Event()
        self._thread = threading.Thread(
            target=self._run, name=f"arm3dof-server-{self.port}", daemon=True
        )

    @property
    def url(self) -> str:
        """Address of the first page."""
        return f"http://{self._host}:{self.port}/"

    @property
    def is_running(self) -> bool:
        """Whether the server's thread is alive."""
        return self._thread.is_alive()

    def start(self) -> LocalServer:
        """Start serving and return once connections are answered.

        Raises:
            ArmError: the application failed to start, or the server was stopped before.
        """
        if self._socket.fileno() < 0 or self._thread.ident is not None:
            raise ArmError("this server has been started before; make a new LocalServer")
        self._thread.start()
        self._server.ready.wait()
        if not self._server.started:
            self.stop()
            raise ArmError(f"the application behind {self.url} failed to start; its log says why")
        return self

    def wait(self) -> None:
        """Block until the server stops; Ctrl-C raises ``KeyboardInterrupt`` here as usual."""
        # not Thread.join: interrupted by Ctrl-C, Python 3.11 takes the thread for ended
        while self._thread.ident is not None and not self._ended.wait(WAIT_STEP):
            pass

    def stop(self) -> None:
        """Stop serving: close every connection, the socket and the thread."""
        self._server.should_exit = True
        if self._thread.ident is not None:
            self._ended.wait()
            self._thread.join()
        self._socket.close()

    def __enter__(self) -> LocalServer:
        return self.start()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.stop()

    def _run(self) -> None:
        try:
            with contextlib.suppress(SystemExit):  # how uvicorn ends when the start fails
                self._server.run(sockets=[self._socket])
        finally:
            self._ended.set()
            self._server.ready.set()


def serve(window: MeshcatWindow, port: int = 0, mounts: Sequence[BaseRoute] = ()) -> LocalServer:
    """Make the server of a scene's page; use it in a ``with`` block, or call ``start``.

    Args:
        window: the scene; its ``web_url`` is set.
        port: the port to listen on; 0 takes any free one.
        mounts: further routes on the same server; they go before the page's own.

    Raises:
        InputError: the port is not a port number, is taken or may not be used.
    """
    server = LocalServer(Starlette(routes=[*mounts, *window.routes()]), port)
    window.web_url = server.url
    return server


def _guard(app: ASGIApp, port: int, token: str | None) -> ASGIApp:
    return LoopbackGuard(app, port) if token is None else TokenGuard(app, port, token)


def _listen(host: str, port: int) -> socket.socket:
    if not 0 <= port <= MAX_PORT:
        raise InputError(f"port is {port}; give a number from 0 (any free port) to {MAX_PORT}")
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    if os.name == "posix":  # elsewhere this option would let two servers share the port
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen()
    except OSError as error:
        listener.close()
        if isinstance(error, socket.gaierror) or error.errno == errno.EADDRNOTAVAIL:
            raise InputError(f"host is '{host}'; give an address of this machine") from None
        why = "taken" if error.errno == errno.EADDRINUSE else f"not usable ({error.strerror})"
        raise InputError(
            f"port {port} is {why}; stop what listens there, or give another port (0: any free one)"
        ) from None
    return listener
