"""The whole story on one picture: see, aim, move, and write down what happened."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import cv2
import numpy as np

from arm3dof.control.settings import MpcSettings
from arm3dof.files import write_atomically
from arm3dof.model.kinematics import inverse_kinematics
from arm3dof.model.reach import Reach
from arm3dof.model.robot import Robot
from arm3dof.runtime.experiment import PAPER_DURATION, default_start, simulate
from arm3dof.runtime.loop import Observer
from arm3dof.runtime.metrics import Metrics, summarise
from arm3dof.runtime.recording import Recording
from arm3dof.ui.pictures import read_picture
from arm3dof.ui.plots import save_figures
from arm3dof.ui.report import write_report
from arm3dof.ui.summary import run_report, to_json, view_report
from arm3dof.vision.annotate import annotate
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import ColourTarget, Image
from arm3dof.vision.locate import View, look


class Outcome(StrEnum):
    """How the story ended; ``sentence`` says it in words."""

    SETTLED = "settled"
    NOTHING_SEEN = "nothing_seen"
    OUT_OF_REACH = "out_of_reach"
    NOT_SETTLED = "not_settled"

    @property
    def sentence(self) -> str:
        """The outcome in plain words."""
        return _SENTENCES[self]


_SENTENCES = {
    Outcome.SETTLED: "the arm settled at the object",
    Outcome.NOTHING_SEEN: "no object of the wanted colour was found in the picture",
    Outcome.OUT_OF_REACH: "the object was found, but the arm does not reach it",
    Outcome.NOT_SETTLED: "the arm did not settle at the object in time",
}


@dataclass(frozen=True, eq=False)
class Story:
    """What happened from the picture to the end of the motion.

    Attributes:
        outcome: how it ended.
        view: what was seen; the first located object is the target.
        reach: what inverse kinematics said about it; ``None`` when nothing was seen.
        recording: the motion; ``None`` when there was none.
        metrics: its figures of merit.
        files: what was written.
    """

    outcome: Outcome
    view: View
    reach: Reach | None
    recording: Recording | None
    metrics: Metrics | None
    files: tuple[Path, ...]

    @property
    def succeeded(self) -> bool:
        """Whether the arm settled at the object."""
        return self.outcome is Outcome.SETTLED

    def report(self) -> dict[str, object]:
        """Return the story as names and values with their units: the schema of summary.json."""
        reach, recording = self.reach, self.recording
        return {
            "outcome": self.outcome,
            **run_report(self.metrics, self.files),
            **view_report(self.view),
            "target_m": reach and reach.target,
            "target_deg": None if recording is None else np.rad2deg(recording.q_target),
            "reason": reach and reach.reason,
            "distance_m": reach and reach.distance,
            "nearest_m": reach and reach.nearest,
            "joint": reach and reach.joint,
        }


def tell(
    robot: Robot,
    picture: Image,
    camera: Camera,
    targets: Iterable[ColourTarget] | Mapping[str, ColourTarget],
    folder: str | Path,
    *,
    settings: MpcSettings | None = None,
    duration: float = PAPER_DURATION,
    observers: Sequence[Observer] = (),
) -> Story:
    """See an object, aim at it, move there under MPC, and write everything into a folder.

    The target is the largest object that is found. The files are ``seen.png``, and once there is
    a motion the paper's figures, ``report.html`` and ``run.npz``, and always ``summary.json``.

    Args:
        robot: the robot; it starts at rest at ``default_start``.
        picture: BGR picture, shape (h, w, 3), uint8.
        camera: the camera that took it.
        targets: the objects to look for.
        folder: where to write to; it is made when missing.
        settings: the controller's settings.
        duration: how long to simulate [s].
        observers: called after each control step.

    Raises:
        InputError: an argument is not valid, or the folder cannot be written.
    """
    folder = Path(folder)
    view = look(picture, camera, targets)
    files = [_write_picture(folder / "seen.png", annotate(picture, view))]
    outcome, reach, recording, metrics = Outcome.NOTHING_SEEN, None, None, None
    if view.located:
        start = default_start(robot)
        reach = inverse_kinematics(robot, view.located[0].p_base, near=start)
        outcome = Outcome.OUT_OF_REACH
        if reach.best is not None:
            recording = simulate(
                robot,
                start,
                reach.best,
                settings=settings,
                duration=duration,
                observers=observers,
            )
            metrics = summarise(recording)
            outcome = Outcome.SETTLED if metrics.settled else Outcome.NOT_SETTLED
            files += [
                *save_figures(recording, folder),
                write_report(recording, folder / "report.html", read_picture(files[0])),
                recording.save(folder / "run.npz"),
            ]
    summary = folder / "summary.json"
    story = Story(outcome, view, reach, recording, metrics, (*files, summary))
    write_atomically(summary, to_json(story.report()).encode())
    return story


def _write_picture(path: Path, picture: Image) -> Path:
    _, data = cv2.imencode(".png", picture)
    write_atomically(path, data.tobytes())
    return path
