"""The wall of a server that listens beyond this machine: who enters must know a secret.

The page is opened once as ``http://ADDRESS:PORT/?token=SECRET``; from then on a cookie carries the
secret, which no other site can read or send. It is compared in constant time. The ``Host`` must be
a plain address or this machine's name, so that no foreign name can be made to lead here, and every
``Origin`` must be that same host.
"""

from __future__ import annotations

import hmac
import ipaddress
import socket
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qsl, quote, unquote, urlencode

from starlette.types import ASGIApp, Receive, Scope, Send

from arm3dof.errors import InputError
from arm3dof.ui.guard import POLICY_VIOLATION

HOST = "127.0.0.1"
"""The address that only this machine reaches."""
LEAST = 16
"""Letters that a token has at least."""
COOKIE = "arm3dof_token"
_REFUSAL = b"refused: open this page as http://ADDRESS:PORT/?token=SECRET\n"


class TokenGuard:
    """ASGI middleware that lets a request pass when it knows the token."""

    def __init__(self, app: ASGIApp, port: int, token: str) -> None:
        """Put up the wall.

        Args:
            app: the application behind it.
            port: the port that the server listens on.
            token: the secret.

        Raises:
            InputError: the token is too short to be one, or has letters that no cookie can carry.
        """
        check_token(token)
        self._app, self._port, self._token = app, port, token.encode()
        name = socket.gethostname().lower()
        self._names = {"localhost", name, f"{name}.local"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the connection on, hand out the cookie, or refuse."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
        elif not self._is_addressed(scope):
            await self._refuse(scope, receive, send)
        elif self._knows(_cookie(scope)):
            await self._app(scope, receive, send)
        elif scope["type"] == "http" and self._knows(_query(scope).get("token", "")):
            await self._welcome(scope, send)
        else:
            await self._refuse(scope, receive, send)

    def _is_addressed(self, scope: Scope) -> bool:
        hosts = _headers(scope, b"host")
        if len(hosts) != 1:
            return False
        name, _, port = hosts[0].rpartition(":")
        named = name in self._names or _is_address(name.strip("[]"))
        ours = f"http://{hosts[0]}"
        return (
            named
            and port == str(self._port)
            and all(origin == ours for origin in _headers(scope, b"origin"))
        )

    def _knows(self, word: str) -> bool:
        return hmac.compare_digest(word.encode("utf-8", "replace"), self._token)

    async def _welcome(self, scope: Scope, send: Send) -> None:
        rest = {name: value for name, value in _query(scope).items() if name != "token"}
        where = quote(scope["path"]) + (f"?{urlencode(rest)}" if rest else "")
        cookie = f"{COOKIE}={quote(self._token.decode())}; Path=/; HttpOnly; SameSite=Strict"
        headers = [
            (b"location", where.encode()),
            (b"set-cookie", cookie.encode()),
            (b"cache-control", b"no-store"),
            (b"referrer-policy", b"no-referrer"),
            (b"content-length", b"0"),
        ]
        await send({"type": "http.response.start", "status": 303, "headers": headers})
        await send({"type": "http.response.body", "body": b""})

    async def _refuse(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": POLICY_VIOLATION})
            return
        headers = [
            (b"content-type", b"text/plain; charset=utf-8"),
            (b"content-length", str(len(_REFUSAL)).encode()),
        ]
        await send({"type": "http.response.start", "status": 403, "headers": headers})
        await send({"type": "http.response.body", "body": _REFUSAL})


def check_token(token: str) -> None:
    """Refuse a token that is too short, or that no cookie can carry.

    Raises:
        InputError: it is.
    """
    if len(token) < LEAST or not token.isascii() or not token.isprintable():
        raise InputError(
            f"the token has {len(token)} characters; give {LEAST} or more plain ones, such as "
            "those of: python3 -c 'import secrets; print(secrets.token_urlsafe())'"
        )


def check_entry(host: str, token: str | None) -> None:
    """Refuse to listen beyond this machine without a secret, and a secret that is none.

    Raises:
        InputError: a token is missing or too short.
    """
    if token is not None:
        check_token(token)
    elif host != HOST:
        raise InputError(
            f"host is {host}, which lets the network in; give a token, or leave it at {HOST}"
        )


def _headers(scope: Scope, wanted: bytes) -> list[str]:
    return [
        value.decode("latin-1").strip().lower()
        for name, value in scope["headers"]
        if name.lower() == wanted
    ]


def _cookie(scope: Scope) -> str:
    raw = "; ".join(
        value.decode("latin-1") for name, value in scope["headers"] if name.lower() == b"cookie"
    )
    try:
        morsel = SimpleCookie(raw).get(COOKIE)
    except CookieError:
        return ""
    return "" if morsel is None else unquote(morsel.value)


def _query(scope: Scope) -> dict[str, str]:
    return dict(parse_qsl(scope.get("query_string", b"").decode("latin-1")))


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
