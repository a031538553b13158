"""The studio as one ASGI application: the page, the 3-D view and the live feed on one port."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable
from pathlib import Path

from fastapi import FastAPI
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from arm3dof.ui.page import HEADERS
from arm3dof.ui.studio.lean import without_clients
from arm3dof.ui.studio.studio import Studio

with without_clients():
    from nicegui import app as nicegui_app
    from nicegui import core, ui

from arm3dof.ui.studio.page import build_page
from arm3dof.ui.studio.visitors import Visitors

POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self'; frame-src 'self'; frame-ancestors 'self'; object-src 'none'"
)
RECONNECT = 3.0
"""How long a tab that lost its connection may take to come back as the same tab [s]."""
STALL = 10.0
"""How long a page may be too busy to answer before its tab counts as lost [s]: one on a slow
machine that stalls for a while is not to be loaded anew, for it would lose the controls."""
WATCHED = ("/_nicegui_ws/",)
"""Where a tab and its controls hang: the server pings these websockets, and the browser answers
however busy the page is, so that a tab that is gone is noticed in some three seconds."""
# what a client asks for in vain, or says wrongly, is no news for the terminal
_LOUDEST = {
    "nicegui": logging.ERROR,
    "engineio.server": logging.CRITICAL,
    "socketio.server": logging.CRITICAL,
}
_ASSETS = {
    "charts.js": "text/javascript",
    "studio.js": "text/javascript",
    "studio.css": "text/css",
}
_WEB = Path(__file__).parent / "web"


def build_site(studio: Studio) -> FastAPI:
    """Return the application; NiceGUI allows one a process.

    Args:
        studio: what stands behind the page.
    """
    for name, level in _LOUDEST.items():
        logging.getLogger(name).setLevel(level)
    logging.getLogger("nicegui").addFilter(_is_news)
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    for route in studio.routes():
        app.router.routes.append(route)
    for name, kind in _ASSETS.items():
        app.router.routes.append(Route(f"/studio/{name}", _asset(name, kind)))
    app.middleware("http")(_keep_to_itself)

    visitors = Visitors()

    @ui.page("/", title="arm3dof studio")
    def page() -> None:
        visitors.expect(ui.context.client)
        build_page(studio)

    nicegui_app.add_exception_handler(404, _unknown)  # in place of a page, which costs a client
    nicegui_app.on_startup(_bear_stalls)
    nicegui_app.on_startup(studio.begin)
    ui.run_with(
        app,
        title="arm3dof studio",
        dark=None,
        language="en-US",
        tailwind=False,
        message_history_length=0,
        reconnect_timeout=RECONNECT,
        gzip_middleware_factory=None,
        show_welcome_message=False,
    )
    return app


def _is_news(record: logging.LogRecord) -> bool:
    """Return whether a message is worth a line; what is left when all ends is not."""
    return "Could not cancel" not in record.getMessage()


def _bear_stalls() -> None:
    core.sio.eio.ping_timeout = STALL


async def _unknown(request: Request, error: Exception) -> Response:
    return PlainTextResponse("there is no such page; the studio is at /\n", status_code=404)


async def _keep_to_itself(
    request: Request, answer: Callable[[Request], Awaitable[Response]]
) -> Response:
    """Let no page of this server load from, or be shown in, another."""
    response = await answer(request)
    for name, value in HEADERS.items():
        response.headers.setdefault(name, value)
    if not request.url.path.startswith("/3d/"):  # that page carries a policy of its own
        response.headers.setdefault("Content-Security-Policy", POLICY)
    return response


def _asset(name: str, kind: str) -> Callable[[Request], Awaitable[Response]]:
    body = (_WEB / name).read_bytes()

    async def answer(request: Request) -> Response:
        return Response(body, media_type=kind, headers=HEADERS)

    return answer
