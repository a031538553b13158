"""Photograph the pages that the manual shows, and draw a pose without a browser."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import studio_tour
from headless import browser, keep, opened, photograph
from playwright.sync_api import Browser

import arm3dof
from arm3dof.config.camera_file import load_camera
from arm3dof.runtime.recording import Recording
from arm3dof.ui.demo import tell
from arm3dof.ui.demo_scene import draw_demo
from arm3dof.ui.run_frames import save_stills

SHARP = 3000  # ms in which a page sharpens a picture that stands still
MOMENT = 14  # frame at which much is going on
PLAYS = """() => new Promise((done) => {
  const look = () => (player.frames > 1 ? done() : requestAnimationFrame(look));
  look();
})"""


def main() -> None:
    """Write docs/images/report*.png, pose.png and studio*.png; a word chooses among them."""
    wanted = sys.argv[1:] or ["report", "studio"]
    with tempfile.TemporaryDirectory() as scratch, browser() as chromium:
        folder = Path(scratch)
        if "report" in wanted:
            _, end = save_stills(make_run(folder), folder)
            keep(end, "pose.png")
            show_report(chromium, folder / "report.html")
        if "studio" in wanted:
            studio_tour.walk(chromium, folder / "studio")


def make_run(folder: Path) -> Recording:
    """See, aim and move; leaves report.html in the folder."""
    camera, targets = load_camera("paper")
    picture = draw_demo(camera, np.random.default_rng(0))
    story = tell(arm3dof.load_robot(), picture, camera, [targets["green"]], folder, duration=3.0)
    if story.recording is None:
        raise SystemExit(f"nothing to photograph: {story.outcome.sentence}")
    return story.recording


def show_report(chromium: Browser, report: Path) -> None:
    """Photograph a report in a window, and in the dark on a phone."""
    for name, width, height, dark in (
        ("report.png", 1280, 900, False),
        ("report-phone.png", 390, 844, True),
    ):
        with opened(chromium, report.as_uri(), width, height, dark=dark) as page:
            page.evaluate(PLAYS)
            page.evaluate(f"() => {{ player.setPlaying(false); player.seek({MOMENT}); }}")
            if width < 900:
                page.evaluate("document.querySelector('.motion').scrollIntoView()")
            page.wait_for_timeout(SHARP)
            photograph(page, name)


if __name__ == "__main__":
    main()
