"""The server: what it answers, what it refuses, and that nothing of it is left after a stop."""

from __future__ import annotations

import asyncio
import http.client
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import psutil
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocket
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from arm3dof.errors import ArmError, InputError
from arm3dof.ui.broadcast import MAX_PENDING_BYTES
from arm3dof.ui.guard import LoopbackGuard
from arm3dof.ui.meshcat_window import MeshcatWindow
from arm3dof.ui.server import MAX_FRAME, LocalServer, serve
from arm3dof.ui.shapes import set_property

DEADLINE = 60.0  # of what takes no time on an idle machine [s]


@pytest.fixture
def window() -> MeshcatWindow:
    return MeshcatWindow()


@pytest.fixture
def server(window: MeshcatWindow) -> Iterator[LocalServer]:
    with serve(window) as running:
        yield running


@pytest.fixture(scope="module")
def shared() -> Iterator[LocalServer]:
    """One server for the tests that only ask."""
    with serve(MeshcatWindow()) as running:
        yield running


def get(server: LocalServer, path: str = "/", **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=DEADLINE)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    answer.body = answer.read()
    connection.close()
    return answer


def listen(server: LocalServer, **options: object) -> ClientConnection:
    return connect(f"ws://127.0.0.1:{server.port}/scene", proxy=None, **options)


def raw(server: LocalServer, *lines: str) -> bytes:
    """Send a request as it is and return the answer's first line."""
    with socket.create_connection(("127.0.0.1", server.port), DEADLINE) as client:
        client.sendall(("\r\n".join(lines) + "\r\n\r\n").encode("latin-1"))
        return client.makefile("rb").readline()


def eventually(condition: Callable[[], bool], server: LocalServer) -> None:
    """Ask the server for a page until a condition holds: it serves, and time passes."""
    end = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        assert get(server, "/scene.css").status == 200


# ---- what it serves ----------------------------------------------------------------------------


def test_page_and_its_parts_come_from_this_server_alone(shared: LocalServer) -> None:
    assert shared.url == f"http://127.0.0.1:{shared.port}/"
    for path, kind in {
        "/": "text/html",
        "/scene.css": "text/css",
        "/figures.js": "text/javascript",
        "/shading.js": "text/javascript",
        "/region.js": "text/javascript",
        "/drawing.js": "text/javascript",
        "/scene.js": "text/javascript",
        "/meshcat.js": "text/javascript",
    }.items():
        answer = get(shared, path)
        assert answer.status == 200
        assert answer.getheader("content-type", "").startswith(kind)
        assert answer.getheader("x-content-type-options") == "nosniff"
        assert len(answer.body) > 500
    page = get(shared).body.decode()
    assert "{{" not in page
    assert "http:" not in page
    assert "https:" not in page
    assert "default-src 'none'" in page


@pytest.mark.parametrize(
    "path", ["/nothing", "/../server.py", "/web/../../server.py", "/%2e%2e/page.py", "//etc/passwd"]
)
def test_nothing_else_is_served(shared: LocalServer, path: str) -> None:
    assert get(shared, path).status == 404


def test_other_methods_are_refused(shared: LocalServer) -> None:
    assert b" 405 " in raw(shared, "POST / HTTP/1.1", f"Host: 127.0.0.1:{shared.port}")


def test_mounts_share_the_port_and_the_guard(window: MeshcatWindow) -> None:
    async def hello(request: Request) -> Response:
        return PlainTextResponse("hello")

    with serve(window, mounts=[Route("/hello", hello)]) as server:
        assert get(server, "/hello").body == b"hello"
        assert get(server, "/").status == 200
        assert get(server, "/hello", Origin="http://evil.example").status == 403


def test_the_page_can_be_mounted_below_another_path(window: MeshcatWindow) -> None:
    with LocalServer(Starlette(routes=[Mount("/3d", routes=window.routes())])) as server:
        assert get(server, "/3d/scene.js").status == 200
        with connect(f"ws://127.0.0.1:{server.port}/3d/scene", proxy=None) as client:
            assert client.recv()


# ---- the wall ----------------------------------------------------------------------------------


def test_it_listens_on_loopback_only(shared: LocalServer) -> None:
    sockets = [
        each.laddr
        for each in psutil.Process().net_connections("inet")
        if each.status == psutil.CONN_LISTEN
    ]
    assert ("127.0.0.1", shared.port) in sockets
    assert {address.ip for address in sockets} == {"127.0.0.1"}


HOSTS = {
    "127.0.0.1:{port}": True,
    "localhost:{port}": True,
    "LOCALHOST:{port}": True,
    "127.0.0.1": False,
    "localhost": False,
    "127.0.0.1:1": False,
    "evil.example": False,
    "evil.example:{port}": False,
    "127.0.0.1.evil.example:{port}": False,
    "0.0.0.0:{port}": False,
    "": False,
}
ORIGINS = {
    "http://127.0.0.1:{port}": True,
    "http://localhost:{port}": True,
    "https://127.0.0.1:{port}": False,
    "http://127.0.0.1": False,
    "http://127.0.0.1:1": False,
    "http://evil.example": False,
    "http://127.0.0.1:{port}.evil.example": False,
    "null": False,
    "": False,
}


@pytest.mark.parametrize(("host", "is_ours"), HOSTS.items())
def test_foreign_hosts_are_refused(shared: LocalServer, host: str, is_ours: bool) -> None:
    line = raw(shared, "GET / HTTP/1.1", "Host: " + host.format(port=shared.port))
    assert line.split()[1] == (b"200" if is_ours else b"403")


@pytest.mark.parametrize(("origin", "is_ours"), ORIGINS.items())
def test_foreign_origins_are_refused(shared: LocalServer, origin: str, is_ours: bool) -> None:
    origin = origin.format(port=shared.port)
    line = raw(shared, "GET / HTTP/1.1", f"Host: 127.0.0.1:{shared.port}", f"Origin: {origin}")
    assert line.split()[1] == (b"200" if is_ours else b"403")


def test_missing_and_double_headers_are_refused(shared: LocalServer) -> None:
    host = f"Host: 127.0.0.1:{shared.port}"
    ours, foreign = f"Origin: http://127.0.0.1:{shared.port}", "Origin: http://evil.example"
    assert raw(shared, "GET / HTTP/1.0").split()[1] == b"403"
    assert raw(shared, "GET / HTTP/1.1", host, host).split()[1] in (b"400", b"403")
    assert raw(shared, "GET / HTTP/1.1", host, ours, foreign).split()[1] == b"403"
    assert raw(shared, "GET / HTTP/1.1", host, ours, ours).split()[1] == b"200"


@pytest.mark.parametrize("origin", [o for o, is_ours in ORIGINS.items() if not is_ours])
def test_websockets_of_foreign_origin_are_refused(shared: LocalServer, origin: str) -> None:
    origin = origin.format(port=shared.port)
    with pytest.raises(InvalidStatus) as refusal:
        listen(shared, additional_headers={"Origin": origin})
    assert refusal.value.response.status_code == 403


def test_websockets_of_our_own_origin_are_accepted(shared: LocalServer) -> None:
    with listen(shared, origin=f"http://localhost:{shared.port}") as client:
        assert client.recv()


@pytest.mark.parametrize(
    ("kind", "headers", "passes"),
    [
        ("http", [(b"host", b"127.0.0.1:80")], True),
        ("http", [(b"host", b"localhost")], True),  # browsers leave port 80 out
        ("http", [(b"Host", b"localhost"), (b"Origin", b"http://localhost")], True),
        ("http", [], False),
        ("http", [(b"host", b"localhost"), (b"host", b"localhost")], False),
        ("websocket", [(b"host", b"localhost"), (b"origin", b"null")], False),
        ("lifespan", [], True),
    ],
)
def test_guard_by_itself(kind: str, headers: list[tuple[bytes, bytes]], passes: bool) -> None:
    passed, sent = [], []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        passed.append(scope["type"])

    async def receive() -> dict[str, str]:
        return {"type": "websocket.connect"}

    async def send(message: dict[str, object]) -> None:
        sent.append(message)

    asyncio.run(LoopbackGuard(app, 80)({"type": kind, "headers": headers}, receive, send))
    assert bool(passed) is passes
    if not passes and kind == "websocket":
        assert sent == [{"type": "websocket.close", "code": 1008}]
    elif not passes:
        assert sent[0]["status"] == 403


# ---- the port ----------------------------------------------------------------------------------


def test_a_taken_port_is_one_clear_line(shared: LocalServer, window: MeshcatWindow) -> None:
    with pytest.raises(InputError, match=rf"^port {shared.port} is taken; .*another port") as error:
        serve(window, shared.port)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("port", [-1, 65536])
def test_what_is_no_port_number_is_refused(window: MeshcatWindow, port: int) -> None:
    with pytest.raises(InputError, match=f"port is {port}; give a number"):
        serve(window, port)


def test_a_port_that_may_not_be_used_says_why(
    window: MeshcatWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    def forbid(self: socket.socket, address: tuple[str, int]) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(socket.socket, "bind", forbid)
    with pytest.raises(InputError, match=r"port 80 is not usable \(Permission denied\)"):
        serve(window, 80)


# ---- its end -----------------------------------------------------------------------------------


def test_after_a_stop_nothing_is_left_and_the_port_is_free(window: MeshcatWindow) -> None:
    before, children = set(threading.enumerate()), psutil.Process().children()
    with serve(window) as server, ExitStack() as stack:
        clients = [stack.enter_context(listen(server)) for _ in range(3)]
        assert all(client.recv() for client in clients)
        assert server.is_running
        server.stop()
        for client in clients:
            with pytest.raises(ConnectionClosed) as closed:
                client.recv(timeout=DEADLINE)
            assert closed.value.rcvd.code == 1012  # "service restart": pages connect again
    assert not server.is_running
    assert window.client_count == 0
    assert not [thread for thread in set(threading.enumerate()) - before if thread.is_alive()]
    assert not [
        each for each in psutil.Process().net_connections() if each.laddr[1:] == (server.port,)
    ]
    assert psutil.Process().children() == children
    server.stop()
    with serve(window, server.port) as again:
        assert get(again).status == 200


def test_a_server_starts_once(window: MeshcatWindow) -> None:
    server = serve(window)
    server.stop()
    with pytest.raises(ArmError, match="make a new LocalServer"):
        server.start()
    with serve(window) as server, pytest.raises(ArmError, match="make a new LocalServer"):
        server.start()


def test_wait_returns_when_the_server_is_stopped(server: LocalServer) -> None:
    waiting = threading.Thread(target=server.wait)
    waiting.start()
    server.stop()
    waiting.join(DEADLINE)
    assert not waiting.is_alive()


def test_an_application_that_fails_to_start_is_reported() -> None:
    async def broken(scope: Scope, receive: Receive, send: Send) -> None:
        await receive()
        await send({"type": "lifespan.startup.failed", "message": "no"})

    server = LocalServer(broken)
    with pytest.raises(ArmError, match="failed to start"):
        server.start()
    assert not server.is_running


def test_a_client_that_hangs_does_not_hold_the_stop(window: MeshcatWindow) -> None:
    with serve(window) as server, socket.create_connection(("127.0.0.1", server.port)) as idle:
        idle.sendall(b"GET / HTTP/1.1\r\n")  # and never the rest
        assert get(server).status == 200
        begin = time.monotonic()
        server.stop()
        assert time.monotonic() - begin < 4
    assert not server.is_running


SCRIPT = """
from arm3dof.ui.meshcat_window import MeshcatWindow
from arm3dof.ui.server import serve
try:
    with serve(MeshcatWindow()) as server:
        print(server.port, flush=True)
        server.wait()
except KeyboardInterrupt:
    import threading
    print("clean", threading.active_count(), flush=True)
"""


def test_ctrl_c_ends_it_cleanly() -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    with process:
        port = int(process.stdout.readline())
        with connect(f"ws://127.0.0.1:{port}/scene", proxy=None) as client:
            client.recv()
            client.socket.sendall(frame(1, b"\xff\xfe"))  # which is not worth a word either
            assert read_to_the_end(client)
            process.send_signal(signal.SIGINT)
            output, errors = process.communicate(timeout=DEADLINE)
    assert output == "clean 1\n"
    assert errors == ""
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port))


# ---- clients -----------------------------------------------------------------------------------


def test_six_hundred_connections_leave_no_trace(server: LocalServer, window: MeshcatWindow) -> None:
    window.post(set_property("/a", "visible", True))
    with listen(server) as steady:
        steady.recv()
        eventually(lambda: window.client_count == 1, server)
        descriptors, threads = psutil.Process().num_fds(), None
        for index in range(600):
            with listen(server) as client:
                assert b"visible" in client.recv()
            if index == 20:
                threads = psutil.Process().num_threads()
        eventually(lambda: window.client_count == 1, server)
        eventually(lambda: psutil.Process().num_fds() <= descriptors + 2, server)
        # a client's thread may outlive its last word by a moment on a busy machine
        eventually(lambda: psutil.Process().num_threads() <= threads, server)
        window.post(set_property("/a", "visible", False))
        assert b"visible" in steady.recv(timeout=DEADLINE)


def read_to_the_end(client: ClientConnection) -> ConnectionClosed:
    """Read what was sent before the server closed the connection, and say how it did."""
    try:
        while True:
            client.recv(timeout=DEADLINE)
    except ConnectionClosed as closed:
        return closed


def frame(opcode: int, payload: bytes, *, mask: bool = True, length: int | None = None) -> bytes:
    """A websocket frame, made by hand so that it can be wrong."""
    size = len(payload) if length is None else length
    head = bytes([0x80 | opcode, (0x80 if mask else 0) | 127]) + struct.pack("!Q", size)
    return head + (b"\0\0\0\0" if mask else b"") + payload


BAD_FRAMES = {
    "text": frame(1, b'{"type": "set_control", "callback": "alert(1)"}'),
    "bytes": frame(2, b"\x81\xa4type\xa6delete"),
    "broken UTF-8": frame(1, b"\xff\xfe"),
    "unknown opcode": frame(0xB, b"?"),
    "no mask": frame(2, b"?", mask=False),
    "said to be huge": frame(2, b"", length=1 << 40),
    "too big": frame(2, bytes(MAX_FRAME + 1)),
    "not a frame": b"\xde\xad\xbe\xef" * 8,
}


@pytest.mark.parametrize("bad", BAD_FRAMES.values(), ids=BAD_FRAMES)
def test_a_bad_frame_closes_that_client_only(
    server: LocalServer, window: MeshcatWindow, bad: bytes
) -> None:
    with listen(server) as good, listen(server) as evil:
        good.recv()
        evil.recv()
        evil.socket.sendall(bad)
        closed = read_to_the_end(evil)
        assert closed.rcvd is None or closed.rcvd.code in (1002, 1007, 1008, 1009)
        eventually(lambda: window.client_count == 1, server)
        window.post(set_property("/a", "visible", True))
        assert b"visible" in good.recv(timeout=DEADLINE)


def upgrade(server: LocalServer, path: str) -> bytes:
    """The request for a websocket, of a client that is made by hand."""
    lines = (
        f"GET {path} HTTP/1.1",
        f"Host: 127.0.0.1:{server.port}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "\r\n",
    )
    return "\r\n".join(lines).encode()


def test_a_watched_client_that_answers_no_ping_is_let_go(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("arm3dof.ui.server.PING_PERIOD", 0.01)
    monkeypatch.setattr("arm3dof.ui.server.PONG_PATIENCE", 2.0)
    came, gone = (
        {name: threading.Event() for name in ("held/mute", "held/well", "free/mute")}
        for _ in range(2)
    )

    async def endpoint(websocket: WebSocket) -> None:
        name = websocket.url.path[1:]
        await websocket.accept()
        came[name].set()
        while (await websocket.receive())["type"] != "websocket.disconnect":
            await websocket.send_text("still here")
        gone[name].set()

    held = [WebSocketRoute(f"/{name}", endpoint) for name in ("mute", "well")]
    app = Starlette(routes=[Mount("/held", routes=held), WebSocketRoute("/free/mute", endpoint)])
    with LocalServer(app, watched=["/held/"]) as server, ExitStack() as stack:
        for name in ("held/mute", "free/mute"):
            mute = stack.enter_context(socket.create_connection(("127.0.0.1", server.port)))
            mute.sendall(upgrade(server, f"/{name}"))
            assert came[name].wait(DEADLINE)
        url = f"ws://127.0.0.1:{server.port}/held/well"
        well = stack.enter_context(connect(url, proxy=None, ping_interval=None))
        assert gone["held/mute"].wait(DEADLINE)
        well.send("?")
        assert well.recv(timeout=DEADLINE) == "still here"
        assert not gone["free/mute"].is_set()


def test_a_client_that_does_not_read_is_dropped(server: LocalServer, window: MeshcatWindow) -> None:
    with socket.socket() as lazy, listen(server, max_size=None) as good:
        good.recv()
        lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        lazy.connect(("127.0.0.1", server.port))
        lazy.sendall(upgrade(server, "/scene"))
        eventually(lambda: window.client_count == 2, server)
        big = "x" * (MAX_PENDING_BYTES // 8)
        for number in range(40):
            window.post(set_property("/a", f"text{number % 2}", big))
            assert len(good.recv(timeout=DEADLINE)) > len(big)
            if window.client_count == 1:
                break
        eventually(lambda: window.client_count == 1, server)
        eventually(lambda: is_cut_off(lazy), server)


def is_cut_off(client: socket.socket) -> bool:
    """Whether the other end of a connection of this process has let go of it."""
    mine = client.getsockname()
    return not any(each.raddr == mine for each in psutil.Process().net_connections("inet"))


def test_a_client_with_many_messages_waiting_is_dropped(
    server: LocalServer, window: MeshcatWindow
) -> None:
    with listen(server, max_queue=1) as lazy:
        eventually(lambda: window.client_count == 1, server)
        for number in range(200_000):
            window.post(set_property("/a", "position", [0.0, 0.0, float(number)]))
            if window.client_count == 0:
                break
        eventually(lambda: window.client_count == 0, server)
        read_to_the_end(lazy)
