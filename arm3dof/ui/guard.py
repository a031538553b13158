"""The outermost wall of the server: it answers only pages that it served itself.

A page of another site can make a browser send requests to 127.0.0.1, and a name that resolves to
127.0.0.1 makes that site look local. Such requests carry a foreign ``Origin`` or a foreign
``Host``; both are refused here, before any route is reached, for plain requests and websockets.
"""

from __future__ import annotations

from starlette.types import ASGIApp, Receive, Scope, Send

REFUSAL = b"refused: this server answers only its own pages; open http://127.0.0.1:PORT/ instead\n"
POLICY_VIOLATION = 1008
HTTP_PORT = 80


class LoopbackGuard:
    """ASGI middleware that lets a request pass when its Host and its Origins are ours.

    Exactly one ``Host`` header must name this server (``127.0.0.1`` or ``localhost`` with the
    port); each ``Origin`` header, where there is one, must be this server's. A foreign, missing
    or doubled host and a foreign or ``null`` origin get 403, a websocket close code 1008.

    Args:
        app: the application behind the wall.
        port: the port that the server listens on.
    """

    def __init__(self, app: ASGIApp, port: int) -> None:
        self._app = app
        self._port = port
        names = ("127.0.0.1", "localhost")
        hosts = {f"{name}:{port}" for name in names}
        if port == HTTP_PORT:  # browsers leave the scheme's own port out
            hosts.update(names)
        self._hosts = frozenset(host.encode() for host in hosts)
        self._origins = frozenset(f"http://{host}".encode() for host in hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the connection on, or refuse it."""
        if scope["type"] == "lifespan" or self._is_ours(scope):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": POLICY_VIOLATION})
        else:
            await self._forbid(send)

    def _is_ours(self, scope: Scope) -> bool:
        headers = [(name.lower(), value.strip().lower()) for name, value in scope["headers"]]
        hosts = [value for name, value in headers if name == b"host"]
        origins = [value for name, value in headers if name == b"origin"]
        return (
            len(hosts) == 1
            and hosts[0] in self._hosts
            and all(origin in self._origins for origin in origins)
        )

    async def _forbid(self, send: Send) -> None:
        body = REFUSAL.replace(b"PORT", str(self._port).encode())
        headers = [
            (b"content-type", b"text/plain; charset=utf-8"),
            (b"content-length", str(len(body)).encode()),
        ]
        await send({"type": "http.response.start", "status": 403, "headers": headers})
        await send({"type": "http.response.body", "body": body})
