"""The demonstration in the physics world: see, grasp, lift, place, and write down what happened."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from arm3dof.control.step import ControlStep
from arm3dof.errors import InputError
from arm3dof.files import write_atomically
from arm3dof.model.robot import Robot
from arm3dof.runtime.metrics import Metrics, summarise
from arm3dof.runtime.recording import Recording
from arm3dof.runtime.tasks.goals import Goal
from arm3dof.runtime.tasks.machine import Phase
from arm3dof.runtime.tasks.record import TaskRecorder, steps_report
from arm3dof.runtime.tasks.run import TaskResult
from arm3dof.runtime.tasks.sight import look_at_table
from arm3dof.runtime.tasks.simulated import (
    Faults,
    Judge,
    Judgement,
    SimulatedTask,
)
from arm3dof.sim.world import World
from arm3dof.state import JointState
from arm3dof.ui.plots import save_figures
from arm3dof.ui.replay import ACHIEVED, VERDICT
from arm3dof.ui.report import write_report
from arm3dof.ui.summary import run_report, to_json, view_report
from arm3dof.ui.video import write_mp4
from arm3dof.vision.annotate import annotate
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import ColourTarget, Image
from arm3dof.vision.locate import View

_EVERY = 4  # control steps between two frames of the video
_SECONDS_BETWEEN = 0.08  # these are so far apart [s]
_INK, _PAPER = (255, 255, 255), (32, 28, 24)

Watcher = Callable[[JointState, ControlStep, Phase], None]


@dataclass(frozen=True, eq=False)
class TaskStory:
    """What happened in a task.

    Attributes:
        result: how the task went, as it says itself.
        judgement: what the physics says.
        view: what was seen first.
        picture: what it was seen in, with frames.
        ages: how old the latest picture was, each time that it was asked for [s].
        recording: the motion.
        metrics: its figures of merit.
        files: what was written.
    """

    result: TaskResult
    judgement: Judgement
    view: View
    picture: Image
    ages: tuple[float, ...]
    recording: Recording
    metrics: Metrics
    files: tuple[Path, ...]

    def report(self) -> dict[str, object]:
        """Return the story as names and values with their units: the schema of summary.json."""
        return {
            "outcome": self.judgement.outcome,
            **self.judgement.figures,
            "reason": self.judgement.sentence,
            "duration_s": self.result.duration,
            "picture_age_s": {"max": max(self.ages, default=None)},
            "steps": steps_report(self.result.steps),
            **run_report(self.metrics, self.files),
            **view_report(self.view),
        }


def tell_task(
    robot: Robot,
    world: World,
    goal: Goal,
    judge: Judge,
    camera: Camera,
    targets: Sequence[ColourTarget],
    folder: str | Path,
    rng: np.random.Generator,
    *,
    faults: Faults | None = None,
    time_limit: float = 60.0,
    video: bool = False,
    observers: Sequence[Watcher] = (),
) -> TaskStory:
    """Run a task in the physics world and write everything into a folder.

    The files are ``seen.png``, ``run.npz``, the paper's figures, ``report.html``,
    ``summary.json``, and ``camera.mp4`` where a video is wanted.

    Args:
        robot: the robot.
        world: what stands around it.
        goal: what the task is for.
        judge: says what came of it.
        camera: what the task's pictures are taken by.
        targets: what the eye looks for.
        folder: where to write to; it is made when missing.
        rng: source of all noise.
        faults: what is wrong; nothing without.
        time_limit: how long the task may take [s].
        video: whether to write what the camera sees all the time.
        observers: called after each control step.

    Raises:
        InputError: an argument is not valid, or the folder cannot be written.
        ArmError: this machine cannot draw what a camera sees.
    """
    folder = Path(folder)
    with SimulatedTask(robot, world, targets, rng, faults=faults, camera=camera) as scene:
        recorder, film = TaskRecorder(scene), Film(scene, targets) if video else None
        watchers: list[Watcher] = [recorder, *([] if film is None else [film]), *observers]

        def watch(state: JointState, answer: ControlStep, phase: Phase) -> None:
            for observe in watchers:
                observe(state, answer, phase)

        result = scene.run(goal, time_limit=time_limit, watch=watch)
        verdicts = {body.name: scene.verdict(body.name) for body in world.bodies}
        if scene.eye.first is None:
            raise InputError("the camera took no picture; let the task run longer")
        first = scene.eye.first
    judgement = judge(result, verdicts)
    achieved = {VERDICT: judgement.sentence, ACHIEVED: "yes" if judgement.yes else "no"}
    recording = recorder.recording(result, achieved)
    picture = annotate(first.image, first.view)
    _, data = cv2.imencode(".png", picture)
    files = [folder / "seen.png"]
    write_atomically(files[0], data.tobytes())
    files += [
        *save_figures(recording, folder),
        write_report(recording, folder / "report.html", data.tobytes()),
        recording.save(folder / "run.npz"),
    ]
    if film is not None:
        files.append(write_mp4(folder / "camera.mp4", film.frames, 1 / _SECONDS_BETWEEN))
    summary = folder / "summary.json"
    story = TaskStory(
        result,
        judgement,
        first.view,
        picture,
        tuple(scene.eye.ages),
        recording,
        summarise(recording),
        (*files, summary),
    )
    write_atomically(summary, to_json(story.report()).encode())
    return story


class Film:
    """What the camera sees, with what the eye makes of it and what the arm is doing.

    Attributes:
        frames: the pictures so far.
    """

    def __init__(self, scene: SimulatedTask, targets: Sequence[ColourTarget]) -> None:
        """Begin with no picture.

        Args:
            scene: what is filmed, with its own camera.
            targets: what the eye looks for.
        """
        self._scene, self._targets, self._count = scene, tuple(targets), 0
        self.frames: list[Image] = []

    def __call__(self, state: JointState, answer: ControlStep, phase: Phase) -> None:
        """Take a picture, every few control steps."""
        self._count += 1
        if self._count % _EVERY:
            return
        scene = self._scene
        seen = look_at_table(
            scene.picture(), scene.camera, self._targets, scene.gripping.table_height
        )
        framed = annotate(seen.image, seen.view)
        self.frames.append(_captioned(framed, f"{state.t:5.2f} s   {phase}: {phase.sentence}"))


def _captioned(picture: Image, text: str) -> Image:
    height = picture.shape[0]
    cv2.rectangle(picture, (0, height - 26), (picture.shape[1], height), _PAPER, -1)
    cv2.putText(
        picture, text, (10, height - 9), cv2.FONT_HERSHEY_SIMPLEX, 0.45, _INK, 1, cv2.LINE_AA
    )
    return picture
