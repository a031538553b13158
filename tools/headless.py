"""A browser without a screen or a graphics card, and pictures of what it shows."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
from ensure_chromium import NAMES
from playwright.sync_api import Browser, Page, sync_playwright

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
LARGEST = 300_000  # bytes of a picture in the manual
ARGUMENTS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-accelerated-2d-canvas",
    "--disable-gpu-rasterization",
    "--disable-gpu-compositing",
)


@contextmanager
def browser() -> Iterator[Browser]:
    """Run a browser, and end it."""
    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        try:
            yield chromium
        finally:
            chromium.close()


@contextmanager
def opened(
    chromium: Browser, url: str, width: int, height: int, *, dark: bool = False
) -> Iterator[Page]:
    """Open a page in a window of some size."""
    context = chromium.new_context(
        viewport={"width": width, "height": height}, color_scheme="dark" if dark else "light"
    )
    page = context.new_page()
    page.set_default_timeout(60_000)
    try:
        page.goto(url, wait_until="domcontentloaded")
        yield page
    finally:
        context.close()


def photograph(page: Page, name: str) -> None:
    """Put what a page shows into the manual."""
    with tempfile.TemporaryDirectory() as scratch:
        picture = Path(scratch) / name
        page.screenshot(path=picture)
        keep(picture, name)


def keep(picture: Path, name: str) -> None:
    """Put a picture into the manual, smaller when it is too large."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(picture, IMAGES / name)
    shown, share = cv2.imread(str(picture)), 1.0
    while (size := (IMAGES / name).stat().st_size) > LARGEST:
        share *= 0.85
        smaller = cv2.resize(shown, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(IMAGES / name), smaller, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(f"wrote {IMAGES / name}, {size / 1024:.0f} KiB")
