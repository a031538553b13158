"""A walk through the studio as a person takes it, with a picture at every stop."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from headless import opened, photograph
from playwright.sync_api import Browser, Page

PROGRAM = "import sys; from arm3dof.cli import main; sys.exit(main())"
LAST = "studio.live.last"
PATIENCE = 60  # s
CALM = 2500  # ms after which charts and 3-D have drawn what happened
SHARP = "document.getElementById('view').contentWindow.quality.level === 0"
PIXEL = """([u, v]) => {
  const canvas = document.getElementById("picture");
  const box = canvas.getBoundingClientRect();
  const scale = Math.min(box.width / canvas.width, box.height / canvas.height);
  return [(box.width - scale * canvas.width) / 2 + scale * (u + 0.5),
          (box.height - scale * canvas.height) / 2 + scale * (v + 0.5)];
}"""


def walk(chromium: Browser, folder: Path) -> None:
    """Write docs/images/studio*.png: aim, arrive, see, tune, understand, and all on a phone."""
    with studio(folder) as url:
        with opened(chromium, url, 1280, 720) as page:
            ready(page)
            aim_at_object(page, "green")
            page.get_by_role("switch", name="Show the reachable region").click()
            stop_at(page, "studio-aim.png")
            page.get_by_role("switch", name="Show the reachable region").click()
            page.get_by_role("button", name="Run", exact=True).click()
            page.wait_for_function(f"{LAST}.arrived && {LAST}.mode === 1")
            stop_at(page, "studio.png")
            panel(page, "See")
            page.get_by_role("switch", name="Show the mask").click()
            page.locator("#mask").wait_for()
            stop_at(page, "studio-see.png")
            page.get_by_role("switch", name="Show the mask").click()
            panel(page, "Tune")
            stop_at(page, "studio-tune.png")
        with opened(chromium, url, 390, 844, dark=True) as page:
            ready(page)
            stop_at(page, "studio-phone.png")


@contextmanager
def studio(folder: Path) -> Iterator[str]:
    """Run the studio as a program of its own; yields its address."""
    words = ["studio", "--json", "--no-browser", "--port", "0", "--out", str(folder)]
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *words], stdout=subprocess.PIPE, text=True
    )
    try:
        text = ""
        for line in process.stdout or ():
            text += line
            if line == "}\n":
                break
        yield json.loads(text)["url"]
        process.send_signal(signal.SIGINT)
        process.wait(timeout=PATIENCE)
    finally:
        process.kill()
        process.communicate()


def ready(page: Page) -> None:
    """Wait until the page shows the live arm and the camera's picture."""
    page.wait_for_function(f"window.studio && studio.live.pictures > 0 && {LAST}?.holder")


def panel(page: Page, name: str) -> None:
    """Open one of the panels."""
    page.get_by_role("tab", name=name).click()


def aim_at_object(page: Page, name: str) -> None:
    """Click an object in the camera's picture."""
    panel(page, "Aim")
    page.wait_for_function(f"{LAST}.seen.some((it) => it.name === '{name}')")
    pixel = page.evaluate(f"{LAST}.seen.find((it) => it.name === '{name}').pixel")
    x, y = page.evaluate(PIXEL, pixel)
    page.locator("#picture").click(position={"x": x, "y": y})
    page.locator(".answer").wait_for()


def stop_at(page: Page, name: str) -> None:
    """Wait until all is drawn, and in full, and take a picture."""
    page.mouse.move(640, 8)
    page.wait_for_timeout(CALM)
    page.wait_for_function(SHARP)
    photograph(page, name)
