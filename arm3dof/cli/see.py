"""``arm3dof see`` and ``arm3dof calibrate``: what a picture shows, and what its camera is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape

from arm3dof.cli import output
from arm3dof.cli.options import JsonFlag, numbers
from arm3dof.errors import InputError
from arm3dof.ui.summary import view_report

if TYPE_CHECKING:  # OpenCV loads only where a picture is looked at
    from arm3dof.vision.colour import ColourTarget, HsvRange
    from arm3dof.vision.locate import View

calibrate = typer.Typer(help="Measure a camera.", no_args_is_help=True)

Picture = Annotated[Path, typer.Argument(metavar="IMAGE", help="A picture file.")]
CameraName = Annotated[
    str | None,
    typer.Option(
        "--camera",
        metavar="CAMERA",
        help="The camera that took the picture: a CAMERA.toml, or a preset (paper, desk).",
        show_default=False,
    ),
]
TargetNames = Annotated[
    list[str] | None,
    typer.Option(
        "--target",
        metavar="NAME",
        help="What to look for, by its name in the camera's file. Repeatable.",
        show_default=False,
    ),
]
Hsv = Annotated[
    str | None,
    typer.Option(
        "--hsv",
        metavar="H0,S0,V0,H1,S1,V1",
        help="What to look for, by its colour: low and high hue (0-179), saturation and value "
        "(0-255). A low hue above the high one wraps around red.",
        show_default=False,
    ),
]
WidthM = Annotated[
    float | None,
    typer.Option(
        "--width-m",
        metavar="W",
        help="True width of what --hsv describes, in metres.",
        show_default=False,
    ),
]


def see(
    image: Picture,
    camera: CameraName = None,
    target: TargetNames = None,
    hsv: Hsv = None,
    width_m: WidthM = None,
    annotated: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="PICTURE",
            help="Write the picture with frames and labels.",
            show_default=False,
        ),
    ] = None,
    as_json: JsonFlag = False,
) -> int:
    """Find coloured objects in a picture and say where they are.

    Without --target and --hsv it looks for every target of the camera's file. The answer is no
    when nothing is found.
    """
    from arm3dof.config.camera_file import load_camera
    from arm3dof.vision.annotate import annotate
    from arm3dof.vision.locate import look
    from arm3dof.vision.sources import read_image, write_image

    if camera is None:
        raise InputError("no camera: give --camera with a CAMERA.toml, or a preset (paper, desk)")
    setup = load_camera(camera)
    targets = wanted(setup.targets, camera, target, hsv, width_m)
    picture = read_image(image)
    view = look(picture, setup.camera, targets)
    if annotated is not None:
        write_image(annotated, annotate(picture, view))

    def show(console: Console) -> None:
        show_view(console, view)
        if annotated is not None:
            console.print(f"[dim]wrote[/] {escape(str(annotated))}")

    seen = bool(view.located)
    return output.deliver(view_report(view), as_json=as_json, show=show, yes=seen)


@calibrate.command()
def focal(
    image: Picture,
    distance_m: Annotated[
        float,
        typer.Option(metavar="D", help="Distance from the lens to the object, in metres."),
    ],
    width_m: Annotated[
        float, typer.Option(metavar="W", help="True width of the object, in metres.")
    ],
    hsv: Hsv = None,
    as_json: JsonFlag = False,
) -> int:
    """Measure the focal length from a picture of a flat object of known width and distance.

    Without --hsv the most conspicuous object is taken. The answer is no when none is found.
    """
    from arm3dof.vision.guess import guess_colour
    from arm3dof.vision.locate import focal_from_picture
    from arm3dof.vision.sources import read_image

    picture = read_image(image)
    colour = guess_colour(picture) if hsv is None else read_hsv(hsv)
    found = None
    if colour is not None:
        found = focal_from_picture(picture, colour, distance_m, width_m)
    report: dict[str, object] = {"focal_px": None}
    if found is not None:
        report = {
            "focal_px": found.focal_px,
            "sigma_px": found.sigma_px,
            "width_px": found.width_px,
            "box_px": found.box_px,
        }

    def show(console: Console) -> None:
        if found is None:
            console.print("[red]no whole object of that colour is in the picture[/]")
            return
        console.print(
            f"focal length [green]{found.focal_px:.1f} px[/], give or take {found.sigma_px:.1f}; "
            f"the object is {found.width_px:.1f} px wide"
        )

    return output.deliver(report, as_json=as_json, show=show, yes=found is not None)


def wanted(
    known: Mapping[str, ColourTarget],
    source: str,
    names: Sequence[str] | None,
    hsv: str | None,
    width_m: float | None,
) -> list[ColourTarget]:
    """Return the targets that the options ask for, or all that the camera's file has.

    Raises:
        InputError: the options contradict each other, or name no target of the file.
    """
    from arm3dof.vision.colour import ColourTarget

    if hsv is not None:
        if names:
            raise InputError("--target and --hsv are both given; give one of them")
        if width_m is None:
            raise InputError("--hsv needs --width-m, the true width of the object in metres")
        return [ColourTarget("object", read_hsv(hsv), width_m)]
    if width_m is not None:
        raise InputError(
            "--width-m belongs to --hsv; a --target has its width in the camera's file"
        )
    for name in names or ():
        if name not in known:
            have = ", ".join(known) or "none"
            raise InputError(f"--target {name}: {source} has the targets: {have}")
    targets = [known[name] for name in names or known]
    if not targets:
        raise InputError(f"{source} has no targets; give --hsv and --width-m, or add some to it")
    return targets


def read_hsv(text: str) -> HsvRange:
    """Read six bounds, the low ones first.

    Raises:
        InputError: they are not six numbers, or one is outside its range.
    """
    from arm3dof.vision.colour import HsvRange

    bounds = numbers(text, 6, "--hsv")
    if any(bound != int(bound) for bound in bounds):
        raise InputError(f"--hsv is '{text}'; give whole numbers")
    h0, s0, v0, h1, s1, v1 = (int(bound) for bound in bounds)
    return HsvRange((h0, s0, v0), (h1, s1, v1))


def show_view(console: Console, view: View) -> None:
    """Print what was seen for people, in centimetres."""
    if view.located:
        listing = output.table(
            "object", "x [cm]", "y [cm]", "z [cm]", "give or take [mm]", "depth [cm]", "box [px]"
        )
        for it in view.located:
            point = (f"{100 * value:.1f}" for value in it.p_base)
            box = " ".join(str(value) for value in it.box_px)
            sigma, depth = f"{1000 * it.sigma_m:.1f}", f"{100 * it.depth_m:.1f}"
            listing.add_row(escape(it.target), *point, sigma, depth, box)
        console.print(listing)
    else:
        console.print("[red]nothing found[/]")
    for patch in view.refused:
        console.print(f"[yellow]not measured[/] {escape(patch.target)}: {patch.reason.value}")
