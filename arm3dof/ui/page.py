"""The page of the 3-D view, served live or written as one file that needs nothing else.

Both are made of the same parts, ``web/scene.html``, ``.css`` and ``.js``, and of the viewer that
the installed ``meshcat`` package carries; a run's report adds ``web/report.html`` and its
neighbours. None sends a request anywhere but to its own server: the content security policy in
the page forbids it.
"""

from __future__ import annotations

import base64
import gzip
import html
import importlib.util
import re
from collections.abc import Sequence
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
# the scripts of the 3-D view
_SCENE = ("figures.js", "shading.js", "region.js", "drawing.js", "scene.js")
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
        "scene.html",
        title=html.escape(title),
        policy=LIVE_POLICY,
        style='<link rel="stylesheet" href="scene.css">',
        scripts="\n".join(f'<script src="{name}"></script>' for name in ("meshcat.js", *_SCENE)),
    )


def static_page(scene: bytes, title: str = "arm3dof") -> str:
    """Return the page with its scene inside, for opening from a file.

    Args:
        scene: a message of ``MeshcatWindow.snapshot``.
        title: the title of the browser's window.
    """
    return _complete("scene.html", scene, title, ["scene.css"], _SCENE)


def report_page(scene: bytes, title: str = "arm3dof") -> str:
    """Return the page of a run's report: the scene, and charts that move with it.

    Args:
        scene: a message of ``MeshcatWindow.snapshot``, a ``report`` command in it.
        title: the title of the browser's window.
    """
    styles, scripts = ["scene.css", "report.css"], (*_SCENE, "charts.js", "report.js")
    return _complete("report.html", scene, title, styles, scripts)


def page_routes() -> list[Route]:
    """Return the routes of the live page, relative to where they are mounted."""
    return [
        _route("/", live_page(), "text/html"),
        _route("/scene.css", _asset("scene.css"), "text/css"),
        *(_route(f"/{name}", _asset(name), "text/javascript") for name in _SCENE),
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


def _complete(
    page: str, scene: bytes, title: str, styles: Sequence[str], scripts: Sequence[str]
) -> str:
    """Return a page with its scene, styles and scripts inside."""
    data = base64.b64encode(gzip.compress(scene, mtime=0)).decode()
    embedded = f'<script id="embedded-scene" type="application/octet-stream">{data}</script>'
    code = (viewer_script(), *(f"\n{_asset(name)}" for name in scripts))
    return _fill(
        page,
        title=html.escape(title),
        policy=FILE_POLICY,
        style="<style>\n" + "\n".join(map(_asset, styles)) + "</style>",
        scripts="\n".join([embedded, *(f"<script>{text}</script>" for text in code)]),
    )


def _fill(page: str, **parts: str) -> str:
    """Fill the holes of a page; what is not given is a file of that name."""

    def fill(hole: re.Match[str]) -> str:
        return parts[hole[1]] if hole[1] in parts else _asset(f"{hole[1]}.html")

    return re.sub(r"\{\{(\w+)\}\}", fill, _asset(page))


def _route(path: str, text: str, media_type: str) -> Route:
    body = text.encode()

    async def answer(request: Request) -> Response:
        return Response(body, media_type=media_type, headers=HEADERS)

    return Route(path, answer)
