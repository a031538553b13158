"""What the studio's server keeps out, tried on the program itself."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator
from contextlib import closing

import psutil
import pytest
from studio import Program, studio
from test_server import BAD_FRAMES, read_to_the_end
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

NICEGUI = "/_nicegui_ws/socket.io/?EIO=4&transport="
SOCKETS = {"live": "/live", "3-D": "/3d/scene", "page": f"{NICEGUI}websocket&client_id=x"}
MORE = (f"{NICEGUI}polling", "/studio/studio.js", "/studio/studio.css", "/3d/", "/3d/meshcat.js")


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    with studio(tmp_path_factory.mktemp("studio")) as running:
        yield running


def get(program: Program, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    with closing(http.client.HTTPConnection("127.0.0.1", program.port, timeout=30)) as line:
        line.putrequest("GET", path, skip_host="Host" in headers)
        for name, value in headers.items():
            line.putheader(name, value)
        line.endheaders()
        answer = line.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()


def paths(program: Program) -> list[str]:
    """Every address that the page names, and some more."""
    _, _, body = get(program, "/")
    words = body.decode().replace("'", '"').split('"')
    named = {word for word in words if word.startswith("/") and " " not in word}
    ours = sorted(path for path in named if path.startswith(("/_nicegui", "/studio")))
    return [*ours, *MORE]


def listen(program: Program, path: str, **options: object) -> ClientConnection:
    return connect(
        f"ws://127.0.0.1:{program.port}{path}",
        proxy=None,
        max_size=None,
        open_timeout=30,
        **options,
    )


def test_every_route_refuses_foreign_hosts_and_origins(program: Program) -> None:
    known = paths(program)
    assert len(known) > 8
    for path in ("/", *known):
        for headers in (
            {"Host": "evil.example"},
            {"Host": f"evil.example:{program.port}"},
            {"Origin": "http://evil.example"},
            {"Origin": "null"},
        ):
            assert get(program, path, **headers)[0] == 403, (path, headers)
    assert get(program, "/", Origin=f"http://127.0.0.1:{program.port}")[0] == 200


@pytest.mark.parametrize("path", SOCKETS.values(), ids=SOCKETS)
@pytest.mark.parametrize("headers", [{"Origin": "http://evil.example"}, {"Origin": "null"}])
def test_every_websocket_refuses_foreign_origins(
    program: Program, path: str, headers: dict[str, str]
) -> None:
    with pytest.raises(InvalidStatus) as refusal:
        listen(program, path, additional_headers=headers)
    assert refusal.value.response.status_code == 403


def test_no_path_leaves_the_static_folders(program: Program) -> None:
    folders = {path.rsplit("/", 1)[0] for path in paths(program) if path.count("/") > 1}
    ways = ("../" * 12, "..%2f" * 12, "%2e%2e/" * 12, "..%5c" * 12, "....//" * 12, "/")
    for folder in sorted(folders):
        for way in ways:
            for file in ("etc/passwd", "nicegui.py"):
                status, _, body = get(program, f"{folder}/{way}{file}")
                assert b"root:" not in body, (folder, way, file)
                assert b"from nicegui" not in body, (folder, way, file)
                assert b"from . import" not in body, (folder, way, file)
                assert status in (400, 403, 404), (folder, way, file)


def test_pages_may_load_from_here_alone(program: Program) -> None:
    _, headers, body = get(program, "/")
    policy = headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "connect-src 'self'" in policy
    assert "frame-ancestors 'self'" in policy
    assert b"https://" not in body
    assert headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize("bad", BAD_FRAMES.values(), ids=BAD_FRAMES)
@pytest.mark.parametrize("path", ["/live", "/3d/scene"])
def test_a_bad_frame_closes_that_client_only(program: Program, path: str, bad: bytes) -> None:
    with listen(program, path) as good, listen(program, path) as evil:
        good.recv(timeout=30)
        evil.recv(timeout=30)
        evil.socket.sendall(bad)
        closed = read_to_the_end(evil)
        assert closed.rcvd is None or closed.rcvd.code in (1002, 1007, 1008, 1009)
        assert listen_again(good, path)


def listen_again(client: ClientConnection, path: str) -> bool:
    """Whether a client is still served: the feed never pauses, the 3-D view may have no news."""
    if path == "/live":
        return bool(client.recv(timeout=30))
    client.ping().wait(30)
    return True


@pytest.mark.parametrize("bad", ["too big", "broken UTF-8", "said to be huge", "not a frame"])
def test_the_pages_own_websocket_bears_bad_frames(program: Program, bad: str) -> None:
    path = SOCKETS["page"]
    with listen(program, path) as good, listen(program, path) as evil:
        assert json.loads(good.recv(timeout=30)[1:])["sid"]
        evil.recv(timeout=30)
        evil.socket.sendall(BAD_FRAMES[bad])
        read_to_the_end(evil)
        good.ping().wait(30)
    assert get(program, "/")[0] == 200


def test_it_listens_on_loopback_and_speaks_to_nobody_else(program: Program) -> None:
    family = [psutil.Process(program.pid), *psutil.Process(program.pid).children(recursive=True)]
    assert len(family) >= 3  # the page, the arm, the eye
    for process in family:
        for line in process.net_connections("inet"):
            assert line.laddr.ip == "127.0.0.1"
            assert not line.raddr or line.raddr.ip == "127.0.0.1"


@pytest.mark.slow
def test_another_address_needs_a_token(refused) -> None:
    assert "give a token" in refused("studio", "--host", "0.0.0.0")
    assert "give 16 or more" in refused("studio", "--host", "0.0.0.0", "--token", "short")
