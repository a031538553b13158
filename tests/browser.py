"""A real browser for the tests: Debian's Chromium, or Playwright's own, without a GPU."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, Page, sync_playwright

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


def wait_until(page: Page, condition: str) -> None:
    """Wait until an expression is true in the page, whose policy forbids Playwright's own way."""
    page.evaluate(
        f"() => new Promise((done) => {{"
        f"const look = () => ({condition}) ? done() : requestAnimationFrame(look); look(); }})"
    )
