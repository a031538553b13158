"""Draw the pictures that the README and the manual show: run the demo, and photograph its page."""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np
from headless import IMAGES, browser, opened
from numpy.typing import NDArray

import arm3dof
from arm3dof.config.camera_file import load_camera
from arm3dof.runtime.tasks.goals import Grasping
from arm3dof.runtime.tasks.grasp_trial import judge
from arm3dof.runtime.tasks.scenes import three_objects
from arm3dof.ui.report import write_replay
from arm3dof.ui.task_story import tell_task

WIDTH, GAP = 1360, 10  # of the README's picture [px]
SEED, CARRIED = 0, 0.42  # of the table; when in the run the object is in the air

Picture = NDArray[np.uint8]


def main() -> None:
    """Write docs/images/demo.jpg: what was seen, the arm with its object, the motion in figures."""
    robot = arm3dof.load_robot()
    camera, targets = load_camera("front")
    task = three_objects(robot, np.random.default_rng(SEED), "green", ("green", "red", "blue"))
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        story = tell_task(
            robot,
            task.world,
            Grasping(task.target, task.place, task.body.mass),
            lambda result, verdicts: judge(task, result, verdicts[task.body.name]),
            camera,
            tuple(targets.values()),
            folder,
            np.random.default_rng(SEED),
        )
        if not story.judgement.yes:
            raise SystemExit(f"nothing to photograph: {story.judgement.sentence}")
        replay = write_replay(story.recording, folder / "replay.html")
        seen = cv2.imread(str(folder / "seen.png"))
        page = photograph(replay, folder / "page.png")
        figures = [cv2.imread(str(folder / f"{name}.png")) for name in ("error", "torque")]
    top = row([seen, page])
    bottom = row(figures)
    gap = np.full((GAP, WIDTH, 3), 255, np.uint8)
    IMAGES.mkdir(parents=True, exist_ok=True)
    whole = np.concatenate([top, gap, bottom])
    cv2.imwrite(str(IMAGES / "demo.jpg"), whole, [cv2.IMWRITE_JPEG_QUALITY, 88])
    print(f"wrote {IMAGES / 'demo.jpg'}, {(IMAGES / 'demo.jpg').stat().st_size / 1024:.0f} KiB")


def photograph(page: Path, to: Path) -> Picture:
    """Open a replay in a browser, wind it to where the object is carried, and photograph it."""
    with browser() as chromium, opened(chromium, page.as_uri(), 1080, 720) as tab:
        tab.evaluate(
            "(share) => { player.setPlaying(false);"
            " player.seek(Math.round(share * player.frames)); }",
            CARRIED,
        )
        tab.wait_for_timeout(4000)  # the page sharpens a picture that stands still
        tab.screenshot(path=to)
    return np.asarray(cv2.imread(str(to)), dtype=np.uint8)


def row(pictures: list[Picture]) -> Picture:
    """Put pictures side by side at one height, filling the width."""
    ratio = sum(picture.shape[1] / picture.shape[0] for picture in pictures)
    height = round((WIDTH - GAP * (len(pictures) - 1)) / ratio)
    parts = [np.full((height, 0, 3), 255, np.uint8)]
    for picture in pictures:
        width = round(height * picture.shape[1] / picture.shape[0])
        parts.append(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA))
        parts.append(np.full((height, GAP, 3), 255, np.uint8))
    return cv2.resize(np.concatenate(parts[:-1], axis=1), (WIDTH, height))


if __name__ == "__main__":
    main()
