"""The wall of a server that listens beyond this machine."""

from __future__ import annotations

import asyncio
import socket

import pytest
from starlette.types import Receive, Scope, Send

from arm3dof.errors import InputError
from arm3dof.ui.server import LocalServer
from arm3dof.ui.token import COOKIE, TokenGuard

TOKEN = "correct horse battery/staple+"
HOST = (b"host", b"192.168.1.7:7000")


def knock(
    *headers: tuple[bytes, bytes], kind: str = "http", query: bytes = b"", path: str = "/"
) -> tuple[bool, list[dict]]:
    """Whether a request got through, and what was answered."""
    passed, sent = [], []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        passed.append(scope)

    async def receive() -> dict[str, str]:
        return {"type": "websocket.connect"}

    async def send(message: dict) -> None:
        sent.append(message)

    scope = {"type": kind, "headers": list(headers), "query_string": query, "path": path}
    asyncio.run(TokenGuard(app, 7000, TOKEN)(scope, receive, send))
    return bool(passed), sent


def cookie() -> tuple[bytes, bytes]:
    """The cookie of somebody who has opened the page with the token."""
    query = b"token=correct+horse+battery%2Fstaple%2B&panel=see"
    passed, sent = knock(HOST, query=query, path="/a b")
    assert not passed
    assert sent[0]["status"] == 303
    headers = dict(sent[0]["headers"])
    assert headers[b"location"] == b"/a%20b?panel=see"  # the secret is gone from the address
    flags = headers[b"set-cookie"].decode()
    assert "HttpOnly" in flags
    assert "SameSite=Strict" in flags
    return b"cookie", flags.partition(";")[0].encode()


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_who_knows_the_token_enters(kind: str) -> None:
    assert knock(HOST, cookie(), kind=kind)[0]
    assert knock(HOST, cookie(), (b"origin", b"http://192.168.1.7:7000"), kind=kind)[0]
    name = socket.gethostname().encode()
    assert knock((b"host", name + b":7000"), cookie(), kind=kind)[0]


@pytest.mark.parametrize(
    "headers",
    [
        (HOST,),
        (HOST, (b"cookie", f"{COOKIE}=wrong".encode())),
        (HOST, (b"cookie", f"{COOKIE}=".encode())),
        (HOST, (b"cookie", b"\xff\xfe=;;;,")),
        ((b"host", b"evil.example:7000"), "cookie"),
        ((b"host", b"192.168.1.7:1"), "cookie"),
        ((b"host", b"192.168.1.7"), "cookie"),
        (HOST, HOST, "cookie"),
        ("cookie",),
        (HOST, "cookie", (b"origin", b"http://evil.example")),
        (HOST, "cookie", (b"origin", b"null")),
        (HOST, "cookie", (b"origin", b"http://192.168.1.8:7000")),
    ],
)
def test_who_does_not_is_refused(headers: tuple) -> None:
    real = [cookie() if header == "cookie" else header for header in headers]
    passed, sent = knock(*real)
    assert not passed
    assert sent[0]["status"] == 403
    passed, sent = knock(*real, kind="websocket")
    assert not passed
    assert sent == [{"type": "websocket.close", "code": 1008}]


def test_a_token_in_the_address_opens_no_websocket_and_no_foreign_page() -> None:
    query = b"token=correct+horse+battery%2Fstaple%2B"
    assert not knock(HOST, kind="websocket", query=query)[0]
    assert knock((b"host", b"evil.example:7000"), query=query)[1][0]["status"] == 403
    assert knock(HOST, query=b"token=wrong")[1][0]["status"] == 403
    assert knock(kind="lifespan")[0]


@pytest.mark.parametrize("token", ["", "short", "with a line\nbreak in it", "with a café in it ok"])
def test_a_token_that_is_none_is_refused(token: str) -> None:
    with pytest.raises(InputError, match="give 16 or more plain ones"):
        TokenGuard(lambda: None, 7000, token)


def test_a_server_beyond_this_machine_needs_a_token() -> None:
    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        pass

    with pytest.raises(InputError, match=r"host is 0\.0\.0\.0, .*give a token"):
        LocalServer(app, host="0.0.0.0")
    with pytest.raises(InputError, match="give an address of this machine"):
        LocalServer(app, host="203.0.113.9", token=TOKEN)
    server = LocalServer(app, host="0.0.0.0", token=TOKEN)
    server.stop()
    assert server.url == f"http://0.0.0.0:{server.port}/"
