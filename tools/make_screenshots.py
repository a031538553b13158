"""Photograph the pages that the manual shows, and draw a pose without a browser."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from ensure_chromium import NAMES
from playwright.sync_api import Browser, Page, sync_playwright

import arm3dof
from arm3dof.config.camera_file import load_camera
from arm3dof.runtime.recording import Recording
from arm3dof.ui.demo import tell
from arm3dof.ui.demo_scene import draw_demo
from arm3dof.ui.report import write_report
from arm3dof.ui.report_data import read_picture
from arm3dof.ui.run_frames import save_stills

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
ARGUMENTS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-accelerated-2d-canvas",
    "--disable-gpu-rasterization",
    "--disable-gpu-compositing",
)
LARGEST = 300_000  # bytes of a picture in the manual
SETTLE = 3000  # ms in which a page sharpens a picture that stands still


def main() -> None:
    """Write docs/images/report*.png and pose.png."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch, browser() as chromium:
        folder = Path(scratch)
        recording = make_run(folder)
        report = write_report(recording, folder / "report.html", read_picture(folder / "seen.png"))
        with opened(chromium, report, 1280, 900) as page:
            photograph(page, "report.png")
        with opened(chromium, report, 390, 844, dark=True) as page:
            page.evaluate("document.querySelector('.motion').scrollIntoView()")
            photograph(page, "report-phone.png")
        _, end = save_stills(recording, folder)
        keep(end, "pose.png")


def make_run(folder: Path) -> Recording:
    """See, aim and move; leaves seen.png in the folder."""
    camera, targets = load_camera("paper")
    picture = draw_demo(camera, np.random.default_rng(0))
    story = tell(arm3dof.load_robot(), picture, camera, [targets["green"]], folder, duration=3.0)
    if story.recording is None:
        raise SystemExit(f"nothing to photograph: {story.outcome.sentence}")
    return story.recording


@contextmanager
def browser() -> Iterator[Browser]:
    """Run a browser without a screen or a graphics card."""
    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        try:
            yield chromium
        finally:
            chromium.close()


@contextmanager
def opened(
    chromium: Browser, report: Path, width: int, height: int, *, dark: bool = False
) -> Iterator[Page]:
    """Open a report, and stop it shortly after its start, when much is going on."""
    context = chromium.new_context(
        viewport={"width": width, "height": height}, color_scheme="dark" if dark else "light"
    )
    page = context.new_page()
    page.goto(report.as_uri(), wait_until="domcontentloaded")
    page.evaluate(
        """() => new Promise((done) => {
          const look = () => (player.frames > 1 ? done() : requestAnimationFrame(look));
          look();
        })"""
    )
    page.evaluate("() => { player.setPlaying(false); player.seek(14); }")
    yield page
    context.close()


def photograph(page: Page, name: str) -> None:
    """Keep what a page shows once it stands still."""
    page.wait_for_timeout(SETTLE)
    with tempfile.TemporaryDirectory() as scratch:
        page.screenshot(path=Path(scratch) / name)
        keep(Path(scratch) / name, name)


def keep(picture: Path, name: str) -> None:
    """Put a picture into the manual, in fewer colours when it is too large."""
    shutil.copyfile(picture, IMAGES / name)
    if (IMAGES / name).stat().st_size > LARGEST:
        shown = cv2.imread(str(picture))
        shown = cv2.resize(shown, None, fx=0.8, fy=0.8, interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(IMAGES / name), shown, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    size = (IMAGES / name).stat().st_size
    if size > LARGEST:
        raise SystemExit(f"{IMAGES / name} has {size} bytes; at most {LARGEST} fit the manual")
    print(f"wrote {IMAGES / name}, {size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
