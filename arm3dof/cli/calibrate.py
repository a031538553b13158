"""``arm3dof calibrate``: what a camera's lens is, and where the camera stands."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape

from arm3dof.cli import output
from arm3dof.cli.options import JsonFlag
from arm3dof.cli.prints import board_size, find_print, read_points
from arm3dof.cli.progress import counted
from arm3dof.cli.see import Hsv, Picture, read_hsv
from arm3dof.errors import InputError

if TYPE_CHECKING:  # OpenCV loads only where a picture is looked at
    from arm3dof.vision.camera import Camera
    from arm3dof.vision.chessboard import LensCalibration

calibrate = typer.Typer(help="Measure a camera.", no_args_is_help=True)

Board = Annotated[
    str, typer.Option("--board", metavar="CxR", help="Inner corners of the board, 9x6 for 10 x 7.")
]
SquareM = Annotated[
    float | None,
    typer.Option(metavar="S", help="Edge of a square, in metres.", show_default=False),
]
Save = Annotated[
    Path | None,
    typer.Option(
        "--save",
        metavar="CAMERA",
        help="CAMERA.toml to change in place, its comments kept, or to make.",
        show_default=False,
    ),
]


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
    from arm3dof.vision.focal import focal_from_picture
    from arm3dof.vision.guess import guess_colour
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


@calibrate.command()
def chessboard(
    images: Annotated[
        list[str], typer.Argument(metavar="IMAGES...", help="Pictures of the board, or folders.")
    ],
    board: Board = "9x6",
    square_m: SquareM = 0.025,
    save: Save = None,
    as_json: JsonFlag = False,
) -> int:
    """Measure focal lengths, principal point and distortion from pictures of a chessboard.

    The answer is no when the calibration is not to be trusted: too few boards, corners that do not
    fit, or boards that are all turned alike. Then nothing is saved.
    """
    from arm3dof.vision.chessboard import board_corners, board_points, calibrate_lens
    from arm3dof.vision.sources import frames

    columns, rows = board_size(board)
    points = board_points(columns, rows, square_m or 0)
    names, corners, size = [], [], None
    pictures = [frame for source in images for frame in frames(source)]
    with counted("finding boards", "pictures") as progress:
        for done, frame in enumerate(pictures, start=1):
            height, width = frame.image.shape[:2]
            if size not in (None, (width, height)):
                raise InputError(
                    f"{frame.name} is {width} x {height} px and others are {size}; give pictures "
                    "of one size"
                )
            size = (width, height)
            names.append(frame.name)
            corners.append(board_corners(frame.image, columns, rows))
            progress(done, len(pictures))
    found = calibrate_lens(corners, points, *(size or (1, 1)))
    files = []
    if save is not None and found.good:
        files.append(_save(save, lambda old: _with_lens(old, found)))
    report = {
        "good": found.good,
        "pictures": len(names),
        "boards": len(found.used),
        "rms_px": found.rms_px,
        "camera_matrix": found.camera_matrix,
        "distortion": found.distortion,
        "focal_sigma_px": found.focal_sigma_px,
        "centre_sigma_px": found.centre_sigma_px,
        "troubles": [it.value for it in found.troubles],
        "files": [str(it) for it in files],
    }

    def show(console: Console) -> None:
        console.print(f"board seen in {len(found.used)} of {len(names)} pictures")
        if found.camera_matrix is not None:
            (fx, _, cx), (_, fy, cy), _ = found.camera_matrix.tolist()
            console.print(
                f"focal lengths [green]{fx:.1f}, {fy:.1f} px[/], give or take "
                f"{found.focal_sigma_px:.1f}; middle {cx:.1f}, {cy:.1f} px; corners off by "
                f"{found.rms_px:.2f} px"
            )
        _finish(console, [it.value for it in found.troubles], files)

    return output.deliver(report, as_json=as_json, show=show, yes=found.good)


@calibrate.command()
def pose(
    image: Annotated[
        Path | None,
        typer.Argument(metavar="[IMAGE]", help="A picture of the print.", show_default=False),
    ] = None,
    camera: Annotated[
        str, typer.Option(metavar="CAMERA", help="A CAMERA.toml, or a preset, with the lens.")
    ] = "",
    aruco: Annotated[
        int | None,
        typer.Option(metavar="ID", help="ArUco marker (4 x 4 cells, 0 to 49).", show_default=False),
    ] = None,
    size_m: Annotated[
        float | None,
        typer.Option(metavar="S", help="Edge of the marker, in metres.", show_default=False),
    ] = None,
    board: Annotated[
        str | None,
        typer.Option(metavar="CxR", help="Instead: a chessboard's corners.", show_default=False),
    ] = None,
    square_m: SquareM = None,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z",
            help="Where the print's middle lies, face up, in the base frame, in metres.",
            show_default=False,
        ),
    ] = None,
    yaw_deg: Annotated[
        float, typer.Option(metavar="A", help="How its x axis is turned from the base's.")
    ] = 0.0,
    points: Annotated[
        Path | None,
        typer.Option(
            metavar="CSV",
            help="Instead of a print: the tool at known places, columns x,y,z [m] and u,v [px].",
            show_default=False,
        ),
    ] = None,
    save: Save = None,
    as_json: JsonFlag = False,
) -> int:
    """Measure where a camera stands, from a print at a known place or from points.

    The answer is no when the pose is not to be trusted. Then nothing is saved.
    """
    from arm3dof.config.camera_file import load_camera
    from arm3dof.vision.pose import calibrate_pose

    if not camera:
        raise InputError("no camera: give --camera with a CAMERA.toml whose lens is known")
    known = load_camera(camera).camera
    if points is not None:
        p_base, pixels = read_points(points)
    else:
        p_base, pixels = find_print(image, aruco, size_m, board, square_m, at, yaw_deg)
    found = calibrate_pose(p_base, pixels, known, same_points=board is not None)
    files = []
    if save is not None and found.good:
        files.append(_save(save, lambda _: found.applied(known)))
    transform = found.transform_base_camera
    report = {
        "good": found.good,
        "points": len(p_base),
        "rms_px": found.rms_px,
        "position_m": None if transform is None else transform[:3, 3],
        "rotation": None if transform is None else transform[:3, :3],
        "position_sigma_m": found.position_sigma_m,
        "rotation_sigma_deg": math.degrees(found.rotation_sigma_rad),
        "troubles": [it.value for it in found.troubles],
        "files": [str(it) for it in files],
    }

    def show(console: Console) -> None:
        if transform is not None:
            x, y, z = 100 * transform[:3, 3]
            console.print(
                f"the camera stands at [green]({x:.1f}, {y:.1f}, {z:.1f}) cm[/], give or take "
                f"{1000 * found.position_sigma_m:.1f} mm and "
                f"{math.degrees(found.rotation_sigma_rad):.2f} deg; points off by "
                f"{found.rms_px:.2f} px"
            )
        _finish(console, [it.value for it in found.troubles], files)

    return output.deliver(report, as_json=as_json, show=show, yes=found.good)


def _with_lens(camera: Camera, lens: LensCalibration) -> Camera:
    """Return a camera with another lens, at the same place."""
    from arm3dof.vision.camera import Camera

    if lens.camera_matrix is None:
        raise InputError("no lens was found; see its troubles")
    doubt = replace(camera.doubt, focal_px=lens.focal_sigma_px, centre_px=lens.centre_sigma_px)
    return Camera(
        lens.width,
        lens.height,
        lens.camera_matrix,
        lens.distortion,
        camera.transform_base_camera,
        camera.gamma,
        doubt,
    )


def _save(path: Path, change: Callable[[Camera], Camera]) -> Path:
    """Change the camera of a file; a new file begins at the place of the preset ``desk``."""
    from arm3dof.config.camera_file import load_camera, save_camera, update_camera

    exists = path.exists()
    new = change(load_camera(path if exists else "desk").camera)
    return update_camera(path, camera=new) if exists else save_camera(path, new)


def _finish(console: Console, troubles: list[str], files: list[Path]) -> None:
    for trouble in troubles:
        console.print(f"[red]not to be trusted[/]: {trouble}")
    for path in files:
        console.print(f"[dim]wrote[/] {escape(str(path))}")
