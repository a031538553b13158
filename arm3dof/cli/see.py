"""``arm3dof see``: what a picture shows and where, and colours learned from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
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
    from arm3dof.vision.colour import ColourTarget, HsvRange, Image, Shape
    from arm3dof.vision.locate import View

Picture = Annotated[Path, typer.Argument(metavar="IMAGE", help="A picture file.")]
CameraName = Annotated[
    str | None,
    typer.Option(
        "--camera",
        metavar="CAMERA",
        help="The camera that took the picture: a CAMERA.toml, or a preset (paper, desk, front).",
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


Learn = Annotated[
    str | None,
    typer.Option(
        metavar="U,V[,W,H]",
        help="Learn the colour of the thing at this point, or in this box, and look for it. "
        "With --width-m.",
        show_default=False,
    ),
]
ShapeName = Annotated[
    str | None,
    typer.Option(
        "--shape",
        metavar="SHAPE",
        help="What --hsv or --learn describes: flat, ball, cylinder, cube or bottle.",
        show_default=False,
    ),
]


def see(
    image: Annotated[
        str,
        typer.Argument(
            metavar="SOURCE",
            help="A picture; or the first of a folder, a video, the number of a camera device or "
            "the http:// address of an MJPEG stream.",
        ),
    ],
    camera: CameraName = None,
    target: TargetNames = None,
    hsv: Hsv = None,
    width_m: WidthM = None,
    shape: ShapeName = None,
    learn: Learn = None,
    save: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Keep what was learned in the camera's file, as the target of this name.",
            show_default=False,
        ),
    ] = None,
    table_m: Annotated[
        float | None,
        typer.Option(
            "--table-m",
            metavar="Z",
            help="Height of the table on which things stand, in the base frame: makes places more "
            "certain.",
            show_default=False,
        ),
    ] = None,
    limit_mm: Annotated[
        float,
        typer.Option(metavar="S", min=0.001, help="Sigma up to which a place is good enough."),
    ] = 8.0,
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
    """Find coloured objects in a picture and say where they are, and how certain that is.

    Without --target, --hsv and --learn it looks for every target of the camera's file. The answer
    is no when nothing is found; then nothing is saved.
    """
    from arm3dof.config.camera_file import load_camera, update_camera
    from arm3dof.vision.annotate import annotate
    from arm3dof.vision.budget import Table
    from arm3dof.vision.locate import look
    from arm3dof.vision.sources import write_image

    if camera is None:
        raise InputError(
            "no camera: give --camera with a CAMERA.toml, or a preset (paper, desk, front)"
        )
    if save is not None and learn is None:
        raise InputError("--save keeps what --learn has learned; give --learn U,V too")
    setup = load_camera(camera)
    picture = _first_picture(image)
    if learn is None:
        targets = wanted(setup.targets, camera, target, hsv, width_m, shape)
    else:
        known = setup.targets.get(save or "")
        targets = [_learned(picture, learn, save, width_m, shape, known, (target, hsv))]
    table = None if table_m is None else Table(table_m)
    view = look(picture, setup.camera, targets, table=table)
    report = view_report(view, limit_mm / 1000)
    if learn is not None:
        report["learned"] = {
            "name": targets[0].name,
            "hsv_low": targets[0].hsv.low,
            "hsv_high": targets[0].hsv.high,
        }
    written = [] if annotated is None else [write_image(annotated, annotate(picture, view))]
    if save is not None and view.located:
        written.append(update_camera(camera, target=targets[0]))

    def show(console: Console) -> None:
        if learn is not None:
            low, high = (",".join(map(str, it)) for it in (targets[0].hsv.low, targets[0].hsv.high))
            console.print(f"learned [green]--hsv {low},{high}[/]")
        show_view(console, view)
        show_verdicts(console, view, limit_mm / 1000)
        for path in written:
            console.print(f"[dim]wrote[/] {escape(str(path))}")

    return output.deliver(report, as_json=as_json, show=show, yes=bool(view.located))


def _first_picture(source: str) -> Image:
    """Take the first picture of a source."""
    from arm3dof.vision.sources import VIDEO_SUFFIXES, frames, is_stream, read_image

    if source.isdecimal() and not Path(source).exists():
        pictures = frames(int(source))
    elif is_stream(source) or Path(source).is_dir():
        pictures = frames(source)
    elif Path(source).suffix.lower() in VIDEO_SUFFIXES:
        pictures = frames(Path(source))
    else:
        return read_image(source)
    with closing(pictures):
        for frame in pictures:
            return frame.image
    raise InputError(f"{source} gives no pictures")


def _learned(
    picture: Image,
    place: str,
    name: str | None,
    width_m: float | None,
    shape: str | None,
    known: ColourTarget | None,
    others: tuple[object, ...],
) -> ColourTarget:
    """Return the target that a place in the picture shows.

    Width and shape are those of the target that is replaced, where they are not given.
    """
    from arm3dof.vision.colour import ColourTarget
    from arm3dof.vision.learn import learn_colour

    if any(others):
        raise InputError("--learn is given with --target or --hsv; give one of them")
    if width_m is None and known is None:
        raise InputError("--learn needs --width-m, the true width of the object in metres")
    spot = [int(it) for it in numbers(place, len(place.split(",")), "--learn")]
    colour = learn_colour(picture, spot).hsv
    if known is None:
        return ColourTarget(name or "learned", colour, width_m or 0, checked_shape(shape))
    kept = known.shape if shape is None else checked_shape(shape)
    return replace(known, hsv=colour, width_m=width_m or known.width_m, shape=kept)


def wanted(
    known: Mapping[str, ColourTarget],
    source: str,
    names: Sequence[str] | None,
    hsv: str | None,
    width_m: float | None,
    shape: str | None = None,
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
        return [ColourTarget("object", read_hsv(hsv), width_m, checked_shape(shape))]
    if width_m is not None or shape is not None:
        option = "--width-m" if shape is None else "--shape"
        raise InputError(f"{option} belongs to --hsv; a --target has its own in the camera's file")
    for name in names or ():
        if name not in known:
            have = ", ".join(known) or "none"
            raise InputError(f"--target {name}: {source} has the targets: {have}")
    targets = [known[name] for name in names or known]
    if not targets:
        raise InputError(f"{source} has no targets; give --hsv and --width-m, or add some to it")
    return targets


def checked_shape(name: str | None) -> Shape:
    """Return a shape by its name; flat without one.

    Raises:
        InputError: there is no such shape.
    """
    from arm3dof.vision.colour import SHAPES

    for shape in SHAPES:
        if shape == (name or "flat"):
            return shape
    raise InputError(f"--shape is '{name}'; give one of: {', '.join(SHAPES)}")


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


def show_verdicts(console: Console, view: View, limit_m: float) -> None:
    """Print what makes each place uncertain, and what would help where it is too uncertain."""
    for it in view.located:
        verdict = it.judge(limit_m)
        parts = ", ".join(
            f"{cause.name.lower()} {1000 * sigma:.2f}"
            for cause, sigma in verdict.by_cause.items()
            if sigma > 0
        )
        colour = "green" if verdict.good else "red"
        console.print(
            f"  {escape(it.target)}: [{colour}]{verdict.sentence}[/] [dim]({parts} mm)[/]"
        )
