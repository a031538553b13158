"""A real browser for the tests: Debian's Chromium, or Playwright's own, without a GPU."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # it takes a second, which tests without a browser save
    from playwright.sync_api import Browser, Locator, LocatorAssertions, Page

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
ARGUMENTS = (
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-accelerated-2d-canvas",
    "--disable-gpu-rasterization",
    "--disable-gpu-compositing",
)

# The pose of a node in the scene's frame (z up), as 16 numbers column by column; null when there
# is no such node. The scene's own turn is divided out.
POSE_JS = """
const pose = (path) => {
  let node = viewer.scene_tree;
  for (const name of path.split("/").filter(Boolean)) {
    node = node.children[name];
    if (!node) return null;
  }
  viewer.scene.updateMatrixWorld(true);
  return viewer.scene.matrixWorld.clone().invert().multiply(node.object.matrixWorld)
    .elements.slice();
};
"""


@contextmanager
def chromium() -> Iterator[Browser]:
    """A running browser."""
    from playwright.sync_api import sync_playwright

    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        try:
            yield browser
        finally:
            browser.close()


def poses(page: Page, paths: list[str]) -> list[list[float] | None]:
    """Poses of nodes, all of the same instant."""
    return page.evaluate(f"(paths) => {{ {POSE_JS} return paths.map(pose); }}", paths)


def expect(shown: Locator, patience: float = 60.0) -> LocatorAssertions:
    """Playwright's assertions about what a page shows, true within ``patience`` seconds."""
    from playwright.sync_api import expect

    expect.set_options(timeout=1000 * patience)
    return expect(shown)


def wait_until(page: Page, condition: str, patience: float = 60.0) -> None:
    """Wait until an expression is true in the page, whose policy forbids Playwright's own way."""
    met = page.evaluate(
        f"""() => new Promise((done) => {{
          const end = performance.now() + {1000 * patience};
          const look = () => {{
            if ({condition}) done(true);
            else if (performance.now() > end) done(false);
            else requestAnimationFrame(look);
          }};
          look();
        }})"""
    )
    assert met, f"never in {patience:g} s: {condition}"


class Visit:
    """A page that is open, everything that it asked for, and everything that it complained of."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.requests: list[str] = []
        self.complaints: list[str] = []
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("websocket", lambda socket: self.requests.append(socket.url))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("console", self._hear)

    def _hear(self, message) -> None:
        if message.type == "error":
            self.complaints.append(message.text)


@contextmanager
def visit(browser: Browser, url: str, *, width: int = 1280, height: int = 720) -> Iterator[Visit]:
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(30_000)
    try:
        visit = Visit(page)
        page.goto(url, wait_until="domcontentloaded")
        yield visit
    finally:
        page.close()
