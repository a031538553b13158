"""The page of the 3-D view, served live or written as one file that needs nothing else.

Both are made of the same parts, ``web/scene.html``, ``.css`` and ``.js``, and of the viewer that
the installed ``meshcat`` package carries. Neither sends a request anywhere but to its own server:
the content security policy in the page forbids it.
"""

from __future__ import annotations

import base64
import gzip
import html
import importlib.util
import re
from functools import cache
from pathlib import Path

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from arm3dof.errors import MissingFile

LIVE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "connect-src 'self'; img-src data: blob:"
)
FILE_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
)
HEADERS = {
    "Cache-Control": "no-cache",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
}


def live_page(title: str = "arm3dof") -> str:
    """Return the page that gets its scene from the server beside it."""
    return _fill(
        title=html.escape(title),
        policy=LIVE_POLICY,
        style='<link rel="stylesheet" href="scene.css">',
        scripts='<script src="meshcat.js"></script>\n<script src="scene.js"></script>',
    )


def static_page(scene: bytes, title: str = "arm3dof") -> str:
    """Return the page with its scene inside, for opening from a file.

    Args:
        scene: a message of ``MeshcatWindow.snapshot``.
        title: the title of the browser's window.
    """
    data = base64.b64encode(gzip.compress(scene, mtime=0)).decode()
    return _fill(
        title=html.escape(title),
        policy=FILE_POLICY,
        style=f"<style>\n{_asset('scene.css')}</style>",
        scripts=(
            f'<script id="embedded-scene" type="application/octet-stream">{data}</script>\n'
            f"<script>{viewer_script()}</script>\n<script>\n{_asset('scene.js')}</script>"
        ),
    )


def page_routes() -> list[Route]:
    """Return the routes of the live page, relative to where they are mounted."""
    return [
        _route("/", live_page(), "text/html"),
        _route("/scene.css", _asset("scene.css"), "text/css"),
        _route("/scene.js", _asset("scene.js"), "text/javascript"),
        _route("/meshcat.js", viewer_script(), "text/javascript"),
    ]


@cache
def viewer_script() -> str:
    """Return MeshCat's viewer as one script, without importing the ``meshcat`` package.

    Raises:
        MissingFile: the package, or the viewer in it, is missing.
    """
    spec = importlib.util.find_spec("meshcat")
    folders = (spec.submodule_search_locations if spec else None) or []
    for folder in folders:
        path = Path(folder) / "viewer" / "dist" / "main.min.js"
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise MissingFile("MeshCat's viewer (main.min.js) is missing; run: pip install meshcat")


@cache
def _asset(name: str) -> str:
    return (Path(__file__).parent / "web" / name).read_text(encoding="utf-8")


def _fill(**parts: str) -> str:
    return re.sub(r"\{\{(\w+)\}\}", lambda hole: parts[hole[1]], _asset("scene.html"))


def _route(path: str, text: str, media_type: str) -> Route:
    body = text.encode()

    async def answer(request: Request) -> Response:
        return Response(body, media_type=media_type, headers=HEADERS)

    return Route(path, answer)
