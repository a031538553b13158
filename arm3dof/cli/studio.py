"""``arm3dof studio``: one live page on which a person sees, aims, moves, tunes and understands."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from arm3dof.cli import output
from arm3dof.cli.options import (
    JsonFlag,
    Overrides,
    RobotName,
    read_overrides,
    writable,
)
from arm3dof.cli.serving import Browser, Port, serve_until_interrupted, show_address
from arm3dof.errors import InputError, MissingExtra

if TYPE_CHECKING:  # the page and its processes load only where they are shown
    from arm3dof.runtime.live.eye_process import EyeSpec
    from arm3dof.runtime.live.tuned import Tuned
    from arm3dof.ui.studio.studio import Store
    from arm3dof.vision.camera import Camera
    from arm3dof.vision.colour import ColourTarget


USUAL_ROBOT = "arm3dof"


def studio(
    robot: RobotName = USUAL_ROBOT,
    changes: Overrides = None,
    camera: Annotated[
        str,
        typer.Option(
            metavar="WHERE",
            help="What the eye looks through: 'world' (the simulated table), the number of a "
            "camera device, a video file, a folder of pictures, or the http:// address of an MJPEG "
            "stream.",
        ),
    ] = "world",
    camera_file: Annotated[
        str | None,
        typer.Option(
            metavar="CAMERA",
            help="A CAMERA.toml, or a preset such as desk or paper. Default: desk; for the "
            "simulated table a camera before the arm.",
            show_default=False,
        ),
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option(
            metavar="STUDIO",
            help="Begin with what was tuned: a studio.toml that the studio has written.",
            show_default=False,
        ),
    ] = None,
    folder: Annotated[
        Path,
        typer.Option("--out", metavar="DIR", help="The only folder that files are written to."),
    ] = Path("out/studio"),
    port: Port = None,
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Listen on this address, to be reached from other machines; needs --token.",
        ),
    ] = "127.0.0.1",
    token: Annotated[
        str | None,
        typer.Option(
            metavar="SECRET",
            help="What a browser has to know: it opens http://ADDRESS:PORT/?token=SECRET.",
            envvar="ARM3DOF_TOKEN",
            show_default=False,
        ),
    ] = None,
    browser: Browser = True,
    as_json: JsonFlag = False,
) -> int:
    """Open the studio: a live arm, its camera and its controller on one page, until Ctrl-C.

    With --json the object is printed when the page is ready.
    """
    if find_spec("nicegui") is None:
        raise MissingExtra("the studio", "studio")
    from arm3dof.runtime.live.child import prepare
    from arm3dof.ui.token import check_entry

    check_entry(host, token)
    prepare()  # what the arm and the eye need loads beside what the page needs
    from arm3dof.ui.server import LocalServer
    from arm3dof.ui.studio.site import WATCHED, build_site
    from arm3dof.ui.studio.start import home
    from arm3dof.ui.studio.studio import Studio

    tuned = tuned_by(robot, changes, settings)
    arm = tuned.load_robot()
    eye = eye_spec(camera, camera_file)
    writable(folder)

    def announce(url: str) -> None:
        def show(console: Console) -> None:
            show_address(console, "The studio is open", url)

        output.deliver({"url": url, "robot": arm.name}, as_json=as_json, show=show)

    live = Studio(tuned, arm, home(arm), eye, folder, file_store())
    try:
        serve = partial(LocalServer, build_site(live), host=host, token=token, watched=WATCHED)
        serve_until_interrupted(serve, port, browser=browser, announce=announce)
    finally:
        live.close()
    return output.DONE


def tuned_by(robot: str, changes: list[str] | None, settings: Path | None) -> Tuned:
    """Return what the studio begins with.

    Args:
        robot: its name or path; the settings' own robot goes before the usual one.
        changes: of ``--set``, on top of the settings' own.
        settings: a STUDIO.toml.

    Raises:
        ArmError: the file cannot be read, or is of another robot than the one that is named.
    """
    from arm3dof.runtime.live.tuned import Tuned

    tuned = Tuned(robot)
    if settings is not None:
        from arm3dof.config.studio_file import load_tuned

        tuned = load_tuned(settings)
    if robot not in (USUAL_ROBOT, tuned.source):
        raise InputError(
            f"--settings {settings} is of the robot {tuned.source}; leave --robot {robot} away"
        )
    return replace(tuned, overrides={**tuned.overrides, **read_overrides(changes)})


class _Files:
    """Writes and reads settings files."""

    def save_targets(self, path: Path, camera: Camera, targets: Sequence[ColourTarget]) -> Path:
        from arm3dof.config.camera_file import save_camera

        return save_camera(path, camera, targets)

    def load_targets(self, path: Path) -> tuple[ColourTarget, ...]:
        from arm3dof.config.camera_file import load_camera

        return tuple(load_camera(path).targets.values())

    def save_tuned(self, path: Path, tuned: Tuned) -> Path:
        from arm3dof.config.studio_file import save_tuned

        return save_tuned(path, tuned)

    def load_tuned(self, path: Path) -> Tuned:
        from arm3dof.config.studio_file import load_tuned

        return load_tuned(path)


def file_store() -> Store:
    """Return what writes and reads settings files, which the page itself may not know."""
    return _Files()


def eye_spec(where: str, camera_file: str | None) -> EyeSpec:
    """Return what the eye looks through.

    Args:
        where: ``world``, the number of a device, or what ``frames`` takes.
        camera_file: a CAMERA.toml or a preset; ``None`` for the usual one.

    Raises:
        ArmError: the file cannot be read.
    """
    from arm3dof.config.camera_file import load_camera
    from arm3dof.runtime.live.eye import Watch
    from arm3dof.runtime.live.eye_process import EyeSpec
    from arm3dof.sim.world import World
    from arm3dof.ui.studio.start import camera, table

    setup = load_camera(camera_file or "desk")
    targets = tuple(setup.targets.values())
    if where != "world":
        return EyeSpec(setup.camera, Watch(targets), picture_source(where))
    world = table()
    if not isinstance(world, World):
        return EyeSpec(setup.camera, Watch(targets), world)
    names = [body.name for body in world.bodies]  # parts of the arm have colours too
    targets = tuple(target for target in targets if target.name in names) or targets
    return EyeSpec(camera() if camera_file is None else setup.camera, Watch(targets), world)


def picture_source(where: str) -> str | int:
    """Return what ``frames`` takes, once the first picture of a file or folder has been read.

    Args:
        where: the number of a device, which may come later, as a stream's address may; a video,
            a folder or a picture.

    Raises:
        ArmError: it cannot be read.
    """
    from arm3dof.vision.sources import frames, is_stream

    if where.isdecimal() and not Path(where).exists():
        return int(where)
    if not is_stream(where):
        with closing(frames(where)) as pictures:
            next(pictures)
    return where
