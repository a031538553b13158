"""``arm3dof demo``: from a picture to a settled arm, and a page that plays the motion."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
import typer
from rich.console import Console

from arm3dof.cli import output
from arm3dof.cli.options import JsonFlag, Overrides, RobotName, ServoNames, robot_from, writable
from arm3dof.cli.progress import control_steps
from arm3dof.cli.see import CameraName, Hsv, TargetNames, WidthM, read_hsv, show_view, wanted
from arm3dof.cli.serving import Browser, Port, show_address
from arm3dof.cli.simulate import show_files, show_metrics
from arm3dof.cli.tasks import Video, finish_story, grasp_story, why_no_physics
from arm3dof.cli.view import PLAYS, play
from arm3dof.control.settings import MpcSettings
from arm3dof.errors import InputError
from arm3dof.runtime.experiment import PAPER_DURATION

if TYPE_CHECKING:  # OpenCV and matplotlib load only where a story is told
    from arm3dof.ui.demo import Story
    from arm3dof.vision.camera import Camera
    from arm3dof.vision.colour import ColourTarget, Image

_DRAWN_TARGET = "green"  # the paper's colour


class Setting(NamedTuple):
    """What the story is told about.

    Attributes:
        picture: the picture.
        camera: the camera that took it.
        targets: what to look for.
        guessed: what was taken for granted, by name.
    """

    picture: Image
    camera: Camera
    targets: list[ColourTarget]
    guessed: dict[str, object]


def demo(
    image: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Any picture. Default: what the camera sees in the physics world, where the "
            "arm grasps an object, lifts it and places it.",
            show_default=False,
        ),
    ] = None,
    camera: CameraName = None,
    target: TargetNames = None,
    hsv: Hsv = None,
    width_m: WidthM = None,
    robot: RobotName = "arm3dof",
    changes: Overrides = None,
    servos: ServoNames = None,
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, help="Where things stand in that world.")
    ] = 0,
    video: Video = False,
    folder: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder to write into.")
    ] = Path("out"),
    serve: Annotated[
        bool, typer.Option(help="Play the motion on a page of this machine until Ctrl-C.")
    ] = True,
    port: Port = None,
    browser: Browser = True,
    as_json: JsonFlag = False,
) -> int:
    """See an object, grasp it, lift it, place it, and show the motion.

    Three objects stand in a physics world (extra 'physics'); the task gets its camera's pictures
    and the joint angles, and what counts is the object itself. Without that extra, or for an arm
    without a gripper, a table is drawn and the arm goes to the object. With --image the arm goes
    to what the picture shows.

    A photograph needs nothing else: without --camera an ordinary lens at the paper's place is
    assumed, without --hsv the most conspicuous object is taken, and without --width-m it is taken
    to stand 0.2 m from the lens. The answer is no when nothing is seen, the object is out of
    reach, the object is not placed, or the arm does not settle.
    """
    from arm3dof.ui.demo import tell

    arm = robot_from(robot, changes, servos)
    if image is None and hsv is None and width_m is None:
        reason = why_no_physics(arm)
        if reason is None:
            writable(folder)
            wish = target[0] if target else None
            story = grasp_story(arm, wish, camera, seed, folder, video)
            return finish_story(story, serve, port, browser, as_json=as_json)
        output.err().print(f"drawn, not simulated: {reason}", markup=False)
    if image is None:
        setting = _drawn(camera or "paper", target, hsv, width_m, seed)
    elif camera is not None:
        setting = _measured(image, camera, target, hsv, width_m)
    else:
        setting = _guessed(image, target, hsv, width_m)
    settings = MpcSettings()
    writable(folder)
    with control_steps("moving", PAPER_DURATION, settings.dt) as observer:
        told = tell(arm, *setting[:3], folder, settings=settings, observers=[observer])

    def announce(url: str | None) -> None:
        def show(console: Console) -> None:
            _show(console, setting, told)
            if url is not None:
                show_address(console, PLAYS, url)

        report = told.report() | {"assumed": setting.guessed, "url": url}
        output.deliver(report, as_json=as_json, show=show)

    if serve and told.recording is not None:
        play(told.recording, port, browser=browser, announce=announce)
    else:
        announce(None)
    return output.DONE if told.succeeded else output.ANSWER_IS_NO


def _drawn(
    camera: str,
    names: list[str] | None,
    hsv: str | None,
    width_m: float | None,
    seed: int,
) -> Setting:
    """Draw the table as a camera sees it."""
    from arm3dof.config.camera_file import load_camera
    from arm3dof.ui.demo_scene import draw_demo

    setup = load_camera(camera)
    default = [_DRAWN_TARGET] if hsv is None and _DRAWN_TARGET in setup.targets else None
    targets = wanted(setup.targets, camera, names or default, hsv, width_m)
    picture = draw_demo(setup.camera, np.random.default_rng(seed))
    return Setting(picture, setup.camera, targets, {})


def _measured(
    image: Path,
    camera: str,
    names: list[str] | None,
    hsv: str | None,
    width_m: float | None,
) -> Setting:
    """Read a picture of a known camera."""
    from arm3dof.config.camera_file import load_camera
    from arm3dof.vision.sources import read_image

    setup = load_camera(camera)
    targets = wanted(setup.targets, camera, names, hsv, width_m)
    return Setting(read_image(image), setup.camera, targets, {})


def _guessed(
    image: Path, names: list[str] | None, hsv: str | None, width_m: float | None
) -> Setting:
    """Read a picture that nobody has calibrated, and take for granted what is not given."""
    from arm3dof.config.camera_file import load_camera
    from arm3dof.vision.colour import ColourTarget
    from arm3dof.vision.guess import guess_camera, guess_colour, guess_width
    from arm3dof.vision.sources import read_image

    if names:
        raise InputError("--target is a name in a camera's file; give --camera too, or --hsv")
    picture = read_image(image)
    camera = guess_camera(picture, load_camera("paper").camera.transform_base_camera)
    guessed: dict[str, object] = {"focal_px": camera.focal_px[0]}
    colour = guess_colour(picture) if hsv is None else read_hsv(hsv)
    if colour is None:
        return Setting(picture, camera, [], guessed)
    if hsv is None:
        guessed["hsv"] = (*colour.low, *colour.high)
    if width_m is None:
        width_m = guess_width(picture, camera, colour)
        if width_m is None:  # no whole patch of that colour
            return Setting(picture, camera, [], guessed)
        guessed["width_m"] = width_m
    return Setting(picture, camera, [ColourTarget("object", colour, width_m)], guessed)


def _show(console: Console, setting: Setting, story: Story) -> None:
    for name, value in setting.guessed.items():
        console.print(f"[yellow]assumed[/] {_GUESSES[name].format(value)}")
    show_view(console, story.view)
    if story.reach is not None:
        console.print(story.reach.sentence, markup=False)
    if story.metrics is not None:
        show_metrics(console, story.metrics)
    show_files(console, story.files)
    console.print(story.outcome.sentence, style="green" if story.succeeded else "red")


_GUESSES = {
    "focal_px": "an ordinary lens of {:.0f} px at the paper's place (--camera)",
    "hsv": "the most conspicuous colour, {} (--hsv)",
    "width_m": "an object {:.3f} m wide, 0.2 m from the lens (--width-m)",
}
